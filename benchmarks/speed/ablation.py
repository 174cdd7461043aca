"""What each group of patches over MuJoCo Warp gains: published rows with one group left out at a time.

    python benchmarks/speed/ablation.py birch-physics [made_60-full ...] [--groups G ...] [--minutes 9] [--out DIR]
    python benchmarks/speed/ablation.py write DIR/ablation.jsonl ...        the table of docs/notes/gpu.md

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
import os
import pathlib
import queue
import signal
import statistics
import subprocess
import sys
import threading
import time
from typing import Any

HERE = pathlib.Path(__file__).resolve().parent
BENCHMARKS = HERE.parent
sys.path.insert(0, str(BENCHMARKS))

WORK = BENCHMARKS.parent / "out" / "benchmarks"
PROFILES = WORK / "profiles"
PAGE = BENCHMARKS.parent / "docs" / "notes" / "gpu.md"
WORKER = HERE / "ablation.py"
BEGIN, END = "<!-- begin: python benchmarks/speed/ablation.py write -->\n", "<!-- end of ablation -->"

MARK = "ablation: "
"""Before each line that a worker sends to the driver; the rest is its log."""

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
    """Makes a row ready, says so, and answers each line of stdin with a timed call."""
    row = ROWS[name]
    began = time.monotonic()
    prepared = _environment if row.what == "environment" else _batch
    call, carry, steps, report = prepared(row, worlds or row.worlds)
    _send({"ready_s": round(time.monotonic() - began, 1), "steps": steps})
    import jax

    for line in sys.stdin:
        if line.strip() == "end":
            break
        start = time.perf_counter()
        carry, _ = jax.block_until_ready(call(carry))
        _send({"seconds": time.perf_counter() - start})
    _send(report(carry))


def _send(message: dict[str, Any]) -> None:
    print(MARK + json.dumps(message), flush=True)


def _batch(row: Row, num_worlds: int) -> tuple[Any, Any, int, Any]:
    """A batch as of `throughput.py`."""
    import jax
    import numpy as np
    import throughput
    from batch_case import Case
    from disturbance import Watch

    from ig2mj.engine.health import CAPACITY
    from ig2mj.engine.warp.engine import WarpEngine
    from ig2mj.worlds import Core, Rules

    case = Case(str(WORK / row.home) if row.home.startswith("made_") else row.home, True, profiles=PROFILES)
    profile = case.profile.for_worlds(num_worlds)
    initial = jax.tree.map(lambda a: a[0], case.pool.physics)
    engine = WarpEngine(case.scene, num_worlds, profile=profile, initial=initial)
    core = Core(engine, Rules(case.model, case.goal), case.pool)
    watch = Watch(engine)
    call, carry = throughput.program(case, core, watch, True, row.what)
    compiled = call.lower(carry).compile()

    def report(carry: Any) -> dict[str, Any]:
        physics = carry[0].world.physics
        return {
            "capacity_overflows": int(((np.asarray(physics.overflow) & int(CAPACITY)) != 0).sum()),
            "non_finite": int((~np.asarray(engine.health(physics).finite)).sum()),
            "lost_object_worlds": watch.lost(carry[2]),
            **throughput.memory(num_worlds),
            "profile": [profile.awake_dofs, profile.constraints, profile.contacts, profile.convex_contacts],
            **_about(),
        }

    return compiled, carry, throughput.STEPS, report


def _environment(row: Row, num_worlds: int) -> tuple[Any, Any, int, Any]:
    """An environment as of `environments.py`, the humanoid with mittens."""
    import environments
    import throughput

    args = argparse.Namespace(
        robot="humanoid", engine=None, grasping="mitten", observations=[], pool_size=None, profile=None, hold=5
    )
    env, call, carry = environments.prepared(row.home, num_worlds, args)

    def report(carry: Any) -> dict[str, Any]:
        return {"metrics": env.metrics(carry[0]), **throughput.memory(num_worlds), **_about()}

    return call, carry, environments.CALL, report


def _about() -> dict[str, Any]:
    import throughput

    return throughput.device()


# The driver.


class Worker:
    """A variant of a row in a process of its own on one card."""

    def __init__(self, row: str, variant: str, card: str, out: pathlib.Path, worlds: int):
        self.variant, self.card = variant, card
        self.ready: dict[str, Any] | None = None
        self.seconds: list[float] = []
        self.report: dict[str, Any] = {}
        choice = variant if variant in (BASELINE, UNPATCHED) else f"-{variant}"
        env = {**os.environ, "IG2MJ_PATCHES": choice, "XLA_PYTHON_CLIENT_PREALLOCATE": "false"}
        if card:
            env["CUDA_VISIBLE_DEVICES"] = card
        words = [sys.executable, str(WORKER), "work", row, "--worlds", str(worlds)]
        self.log = out / "logs" / f"{row}-{variant}-{time.monotonic_ns()}.txt"
        self.log.parent.mkdir(parents=True, exist_ok=True)
        with self.log.open("a") as log:
            self._process = subprocess.Popen(
                words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=log, env=env, text=True,
                start_new_session=True,
            )  # fmt: skip
        self._answers: queue.Queue[dict[str, Any] | None] = queue.Queue()
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self) -> None:
        assert self._process.stdout is not None
        with self.log.open("a") as log:
            for line in self._process.stdout:
                if line.startswith(MARK):
                    self._answers.put(json.loads(line[len(MARK) :]))
                else:
                    log.write(line)
        self._answers.put(None)

    def answer(self, until: float) -> dict[str, Any] | None:
        """The next message; None: the process has ended, or it is too late."""
        try:
            return self._answers.get(timeout=max(0.0, until - time.monotonic()))
        except queue.Empty:
            return None

    def call(self, until: float) -> float | None:
        """Seconds of one call."""
        answer = self.ask("call", until)
        return None if answer is None else answer["seconds"]

    def ask(self, word: str, until: float) -> dict[str, Any] | None:
        """What it answers to a word."""
        assert self._process.stdin is not None
        try:
            self._process.stdin.write(word + "\n")
            self._process.stdin.flush()
        except OSError:
            return None
        return self.answer(until)

    def end(self) -> None:
        """Ends the process with its children."""
        if self._process.poll() is None:
            os.killpg(self._process.pid, signal.SIGKILL)
        self._process.wait()
        self._reader.join()
        for pipe in (self._process.stdin, self._process.stdout):
            assert pipe is not None
            with contextlib.suppress(OSError):
                pipe.close()

    @property
    def trouble(self) -> str:
        """The last line of its log."""
        lines = self.log.read_text(errors="replace").split("\n")
        return next((line.strip() for line in reversed(lines) if line.strip()), "it said nothing")


def measure(
    row: str, variants: list[str], card: str, args: argparse.Namespace, end: float, barrier: threading.Barrier
) -> list[dict[str, Any]]:
    """The rows of one batch on one card; the first worker is the baseline.

    Args:
      end: on the monotonic clock, when all is ended. barrier: of all cards; nothing is timed before all are ready.
    """
    workers = [Worker(row, name, card, args.out, args.worlds) for name in (BASELINE, *variants)]
    try:
        for worker in workers:
            worker.ready = worker.answer(end)
        with contextlib.suppress(threading.BrokenBarrierError):
            barrier.wait()
        able = [worker for worker in workers if worker.ready]
        for k in range(WARM_UP + args.calls):
            for worker in list(able):
                seconds = worker.call(end)
                if seconds is None:
                    able.remove(worker)
                elif k >= WARM_UP:
                    worker.seconds.append(seconds)
        for worker in able:
            worker.report = worker.ask("end", end) or {}
        return [_row(row, worker, workers[0], args) for worker in workers]
    finally:
        barrier.abort()
        for worker in workers:
            worker.end()


def _row(name: str, worker: Worker, baseline: Worker, args: argparse.Namespace) -> dict[str, Any]:
    row = ROWS[name]
    worlds = args.worlds or row.worlds
    found: dict[str, Any] = {"row": name, "without": "" if worker is baseline else worker.variant, "worlds": worlds}
    if not worker.seconds or not worker.ready or not baseline.seconds:
        return found | {"failed": worker.trouble if not worker.seconds else "the baseline failed"}
    steps = worker.ready["steps"]
    median = statistics.median(worker.seconds)
    found |= {
        "steps_per_s": round(worlds * steps / median),
        "ms_of_calls": [round(1e3 * s / steps, 2) for s in worker.seconds],
        "ready_s": worker.ready["ready_s"],
    }
    if worker is not baseline:
        cost = [100 * (own / base - 1) for own, base in zip(worker.seconds, baseline.seconds, strict=False)]
        found |= {
            "cost_percent": round(statistics.median(cost), 1),
            "cost_range": [round(min(cost), 1), round(max(cost), 1)],
        }
    words = [pathlib.PurePath(word).name if "/" in word else word for word in args.words]
    return found | worker.report | {"command": " ".join(["python benchmarks/speed/ablation.py", *words])}


def make_homes(rows: list[str]) -> None:
    """Homes that benchmarks make, and their buffer sizes, before several processes need them."""
    from made_home import write_home

    for home in {ROWS[row].home for row in rows}:
        if not home.startswith("made_"):
            continue
        folder = write_home(WORK / home, int(home.split("_")[1]))
        if not (PROFILES / home / "engine_profile.json").exists():
            words = [sys.executable, str(BENCHMARKS / "calibrate_home.py"), str(folder), "--out", str(PROFILES)]
            subprocess.run(words, check=True)


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
                    line = json.dumps(found)
                    print(line, flush=True)
                    with file.open("a", encoding="utf-8") as opened:
                        opened.write(line + "\n")


# The table.


def table(rows: list[dict[str, Any]]) -> str:
    """Markdown: groups of patches, their lines, and what a step costs more without them. Newer rows count."""
    from ig2mj.engine.warp.patches.table import GROUPS

    names = list(ROWS)
    cost = {(r["row"], r["without"]): r["cost_percent"] for r in rows if "cost_percent" in r}
    lines = [f"| left out | lines | {' | '.join(names)} | what it does |", "|---|--:|" + "--:|" * len(names) + "---|"]
    others = {UNPATCHED: "MuJoCo Warp as it comes", BASELINE: "nothing: a second baseline, which shows the noise"}
    reasons = {name: ("repair: " if g.repair else "") + g.reason for name, g in GROUPS.items()} | others
    for name, reason in reasons.items():
        cells = [f"{cost[row, name]:+.1f} %" if (row, name) in cost else "" for row in names]
        size = str(GROUPS[name].lines) if name in GROUPS else ""
        lines.append(f"| `{name}` | {size} | {' | '.join(cells)} | {reason} |")
    return "\n".join(lines) + "\n"


def write(files: list[pathlib.Path]) -> None:
    """The table between its marks in docs/notes/gpu.md."""
    rows = [json.loads(line) for file in files for line in file.read_text(encoding="utf-8").splitlines()]
    before, rest = PAGE.read_text(encoding="utf-8").split(BEGIN)
    PAGE.write_text(before + BEGIN + "\n" + table(rows) + "\n" + END + rest.split(END)[1], encoding="utf-8")


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
    args = parser.parse_args(words)
    args.words = words
    run(args)


if __name__ == "__main__":
    main(sys.argv[1:])
