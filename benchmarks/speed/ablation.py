"""What each group of patches over MuJoCo Warp gains: published rows with one group left out at a time.

    python -m benchmarks.speed.ablation birch-physics [made_60-full ...] [--groups G ...] [--minutes 9] [--out DIR]
    python -m benchmarks.speed.ablation write DIR/ablation.jsonl ...        the table of docs/notes/gpu.md

Each variant of a row is a process with its own `IG2MJ_PATCHES`: "all" (the baseline), one for each group that is left
out, and "none" (MuJoCo Warp as it comes). On every card a batch of variants and a baseline are compiled side by side.
When all are ready they take turns: one timed call each, as often as `--calls` says, alone on the card. The k-th calls
of all variants simulate the same seconds, so that each is compared with the baseline's k-th call. The group name "all"
measures a second baseline against the first, which shows the noise.

A line of JSON for each variant says what a step cost in each call, by how many percent more than the baseline (median
and range over the calls), the device memory, and what went wrong in the worlds. Batches that would not end within
`--minutes` are not begun, and what runs at that time is ended.
"""

from __future__ import annotations

import argparse
import concurrent.futures
import contextlib
import dataclasses
import json
import pathlib
import statistics
import subprocess
import sys
import threading
import time
from typing import Any

from benchmarks.harness.pages import between
from benchmarks.harness.paths import ROOT, WORK, environment, module
from benchmarks.harness.results import command, keep_row
from benchmarks.harness.waiting import Process, end_all

PROFILES = WORK / "profiles"
PAGE = ROOT / "docs" / "notes" / "gpu.md"
BEGIN, END = "<!-- begin: python -m benchmarks.speed.ablation write -->\n", "<!-- end of ablation -->"

WORKER = module("speed.ablation")
"""Words after `python` that run a worker, before its own."""

BASELINE, UNPATCHED = "all", "none"

WARM_UP = 2
"""Calls before the timed ones: in both a program's buffers may be in new places, and CUDA graphs are captured."""

SECONDS_OF_BATCH = 150.0
"""A batch is not begun with less time than this left."""


@dataclasses.dataclass(frozen=True)
class Row:
    """A published row: the home or environment, its number of worlds, and what is computed besides physics."""

    home: str
    worlds: int
    what: str


ROWS = {
    "birch-physics": Row("birch", 8192, "physics"),
    "birch-full": Row("birch", 8192, "full"),
    "made_60-physics": Row("made_60", 16384, "physics"),
    "made_60-full": Row("made_60", 16384, "full"),
    "cooking": Row("CookingMeat", 4096, "environment"),
}


# The worker: one variant of one row.


def work(name: str, worlds: int) -> None:
    """Makes a row ready, says so, and answers each line of standard input with a timed call.

    A line that asks for the end is answered with what became of the worlds.
    """
    import jax

    row = ROWS[name]
    began = time.monotonic()
    prepared = _environment if row.what == "environment" else _batch
    call, carry, steps, report = prepared(row, worlds or row.worlds)
    _say("READY", {"ready_s": round(time.monotonic() - began, 1), "steps": steps})
    for line in sys.stdin:
        if json.loads(line).get("end"):
            _say("DONE", report(carry))
            continue
        start = time.perf_counter()
        carry, _ = jax.block_until_ready(call(carry))
        _say("DONE", {"seconds": time.perf_counter() - start})


def _say(word: str, message: dict[str, Any]) -> None:
    print(f"{word} {json.dumps(message)}", flush=True)


def _batch(row: Row, num_worlds: int) -> tuple[Any, Any, int, Any]:
    """A batch as of `batch.py`."""
    import jax
    import numpy as np

    from benchmarks.harness.batch_case import Case
    from benchmarks.harness.disturbance import Watch
    from benchmarks.speed import batch
    from ig2mj.engine.health import CAPACITY
    from ig2mj.engine.warp.engine import WarpEngine
    from ig2mj.worlds import Core, Rules

    case = Case(str(WORK / row.home) if row.home.startswith("made_") else row.home, True, profiles=PROFILES)
    profile = case.profile.for_worlds(num_worlds)
    initial = jax.tree.map(lambda a: a[0], case.pool.physics)
    engine = WarpEngine(case.scene, num_worlds, profile=profile, initial=initial)
    core = Core(engine, Rules(case.model, case.goal), case.pool)
    watch = Watch(engine)
    call, carry = batch.program(case, core, watch, True, row.what)
    compiled = call.lower(carry).compile()

    def report(carry: Any) -> dict[str, Any]:
        physics = carry[0].world.physics
        return {
            "capacity_overflows": int(((np.asarray(physics.overflow) & int(CAPACITY)) != 0).sum()),
            "non_finite": int((~np.asarray(engine.health(physics).finite)).sum()),
            "lost_object_worlds": watch.lost(carry[2]),
            **batch.memory(num_worlds),
            "profile": [profile.awake_dofs, profile.constraints, profile.contacts, profile.convex_contacts],
            **batch.device(),
        }

    return compiled, carry, batch.STEPS, report


def _environment(row: Row, num_worlds: int) -> tuple[Any, Any, int, Any]:
    """An environment as of `environments.py`, the humanoid with mittens."""
    from benchmarks.speed import environments

    args = argparse.Namespace(
        robot="humanoid", engine=None, grasping="mitten", observations=[], pool_size=None, profile=None, hold=5
    )
    env, call, carry = environments.prepared(row.home, num_worlds, "plain", args)

    def report(carry: Any) -> dict[str, Any]:
        return {"metrics": env.metrics(carry[0]), **environments.memory(num_worlds), **environments.device()}

    return call, carry, environments.CALL, report


# The driver.


@dataclasses.dataclass
class Variant:
    """A row with a choice of groups, in a process of its own on one card.

    Attributes:
      seconds: of its timed calls. report: what became of its worlds, and what it ran on.
    """

    row: str
    without: str
    process: Process
    seconds: list[float] = dataclasses.field(default_factory=list)
    report: dict[str, Any] = dataclasses.field(default_factory=dict)

    def ask(self, message: dict[str, Any], until: float) -> dict[str, Any] | None:
        """What it answers; None: it has ended, or it is too late."""
        self.process.tell(message)
        return self.process.hear("DONE", until)


def start(row: str, without: str, card: str, args: argparse.Namespace) -> Variant:
    """Starts a variant; `without` is the name of a group, "all" or "none"."""
    choice = without if without in (BASELINE, UNPATCHED) else f"-{without}"
    more = {"IG2MJ_PATCHES": choice, "XLA_PYTHON_CLIENT_PREALLOCATE": "false"}
    more |= {"CUDA_VISIBLE_DEVICES": card} if card else {}
    log = args.out / "logs" / f"{row}-{without}-{time.monotonic_ns()}.txt"
    return Variant(row, without, Process([*WORKER, "work", row, "--worlds", str(args.worlds)], log, more))


def measure(
    row: str, variants: list[str], card: str, args: argparse.Namespace, end: float, barrier: threading.Barrier
) -> list[dict[str, Any]]:
    """The rows of one batch on one card; the first variant is the baseline.

    Args:
      end: on the monotonic clock, when all is ended. barrier: of all cards; nothing is timed before all are ready.
    """
    every = [start(row, name, card, args) for name in (BASELINE, *variants)]
    try:
        able = [each for each in every if each.process.wait_until_ready(end)]
        with contextlib.suppress(threading.BrokenBarrierError):
            barrier.wait()
        for k in range(WARM_UP + args.calls):
            for each in list(able):
                answer = each.ask({}, end)
                if answer is None:
                    able.remove(each)
                elif k >= WARM_UP:
                    each.seconds.append(answer["seconds"])
        for each in able:
            each.report = each.ask({"end": True}, end) or {}
        return [_row(each, every[0], args.worlds) for each in every]
    finally:
        barrier.abort()
        end_all([each.process for each in every], 2.0)


def _row(each: Variant, baseline: Variant, worlds: int) -> dict[str, Any]:
    worlds = worlds or ROWS[each.row].worlds
    without = "" if each is baseline else each.without
    found: dict[str, Any] = {"row": each.row, "without": without, "worlds": worlds}
    if not each.seconds or not each.process.ready or not baseline.seconds:
        return found | {"failed": "the baseline failed" if each.seconds else each.process.trouble()}
    steps = each.process.ready["steps"]
    found |= {
        "steps_per_s": round(worlds * steps / statistics.median(each.seconds)),
        "ms_of_calls": [round(1e3 * s / steps, 2) for s in each.seconds],
        "ready_s": each.process.ready["ready_s"],
    }
    if each is not baseline:
        cost = [100 * (own / base - 1) for own, base in zip(each.seconds, baseline.seconds, strict=False)]
        found |= {
            "cost_percent": round(statistics.median(cost), 1),
            "cost_range": [round(min(cost), 1), round(max(cost), 1)],
        }
    return found | each.report | {"command": command()}


def make_homes(rows: list[str]) -> None:
    """Homes that benchmarks make, and their buffer sizes, before several processes need them."""
    from benchmarks.harness.made_home import write_home

    for home in {ROWS[row].home for row in rows}:
        if not home.startswith("made_"):
            continue
        folder = write_home(WORK / home, int(home.split("_")[1]))
        if not (PROFILES / home / "engine_profile.json").exists():
            words = [sys.executable, *module("harness.calibrate_home"), str(folder), "--out", str(PROFILES)]
            subprocess.run(words, check=True, env=environment())


def run(args: argparse.Namespace) -> None:
    """Measures the rows and adds them to `--out`/ablation.jsonl."""
    from ig2mj.engine.warp.patches.table import GROUPS

    end = time.monotonic() + 60 * args.minutes
    variants = args.groups or [BASELINE, UNPATCHED, *GROUPS]
    for name in variants:
        if name not in (BASELINE, UNPATCHED, *GROUPS):
            raise SystemExit(f"there is no group of patches named '{name}'; there are {', '.join(GROUPS)}")
    args.out.mkdir(parents=True, exist_ok=True)
    make_homes(args.rows)
    cards = args.cards or [""]
    size = max(1, args.at_once - 1)
    batches = [(row, variants[k : k + size]) for row in args.rows for k in range(0, len(variants), size)]
    file = args.out / "ablation.jsonl"
    while batches:
        if end - time.monotonic() < SECONDS_OF_BATCH and not args.worlds:
            print(f"left out, no time: {batches}", flush=True)
            return
        now, batches = batches[: len(cards)], batches[len(cards) :]
        barrier = threading.Barrier(len(now))
        with concurrent.futures.ThreadPoolExecutor(len(now)) as pool:
            jobs = [
                pool.submit(measure, row, names, card, args, end, barrier)
                for (row, names), card in zip(now, cards, strict=False)
            ]
            for job in jobs:
                for found in job.result():
                    keep_row(found, file)


# The table.


def table(rows: list[dict[str, Any]]) -> str:
    """Markdown: groups of patches, their lines, and what a step costs more without them. Newer rows count."""
    from ig2mj.engine.warp.patches.table import GROUPS

    names = list(ROWS)
    cost = {(r["row"], r["without"]): _cell(r) for r in rows if "cost_percent" in r}
    lines = [f"| left out | lines | {' | '.join(names)} | what it does |", "|---|--:|" + "--:|" * len(names) + "---|"]
    others = {UNPATCHED: "MuJoCo Warp as it comes", BASELINE: "nothing: a second baseline, which shows the noise"}
    reasons = {name: ("repair: " if g.repair else "") + g.reason for name, g in GROUPS.items()} | others
    for name, reason in reasons.items():
        cells = [cost.get((row, name), "") for row in names]
        size = str(GROUPS[name].lines) if name in GROUPS else ""
        lines.append(f"| `{name}` | {size} | {' | '.join(cells)} | {reason} |")
    return "\n".join(lines) + "\n"


def _cell(row: dict[str, Any]) -> str:
    calls = len(row["ms_of_calls"])
    return f"{row['cost_percent']:+.1f} %" + (" (1 call)" if calls == 1 else "")


def write(files: list[pathlib.Path]) -> None:
    """The table between its marks in docs/notes/gpu.md."""
    rows = [json.loads(line) for file in files for line in file.read_text(encoding="utf-8").splitlines()]
    page = between(PAGE.read_text(encoding="utf-8"), BEGIN, END, f"\n{table(rows)}\n")
    PAGE.write_text(page, encoding="utf-8")


def main(words: list[str]) -> None:
    if words[:1] == ["work"]:
        parser = argparse.ArgumentParser()
        parser.add_argument("row", choices=ROWS)
        parser.add_argument("--worlds", type=int, default=0)
        found = parser.parse_args(words[1:])
        work(found.row, found.worlds)
        return
    if words[:1] == ["write"]:
        write([pathlib.Path(word) for word in words[1:]])
        return
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("rows", nargs="+", choices=ROWS)
    parser.add_argument("--groups", nargs="+", default=[], help="variants: groups to leave out, all, none; else each")
    parser.add_argument("--cards", nargs="+", default=[], help="numbers of GPUs; left out: the first that is visible")
    parser.add_argument("--at-once", type=int, default=7, help="processes on a card, the baseline's among them")
    parser.add_argument("--calls", type=int, default=6, help="timed calls of each variant")
    parser.add_argument("--minutes", type=float, default=9.0, help="when all is ended")
    parser.add_argument("--worlds", type=int, default=0, help="for small machines; 0: the row's number")
    parser.add_argument("--out", type=pathlib.Path, default=WORK / "ablation", help="folder for rows and logs")
    run(parser.parse_args(words))


if __name__ == "__main__":
    main(sys.argv[1:])
