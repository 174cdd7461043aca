"""Goal states of BEHAVIOR-100's activities, sampled: how many seeds succeed in the home where a start can be sampled.

    python -m benchmarks.sampling.behavior_goals --seeds 10 --jobs 16    every activity; writes the page of `PAGE`
    python -m benchmarks.sampling.behavior_goals --seeds 10 --resume     only the seeds that no earlier run got to
    python -m benchmarks.sampling.behavior_goals --activities making_tea --seeds 2

A seed is a start state and a goal state that is reached from it (`ig2mj.tasks.bddl.goal_states`). The goal state has
30 s of processor time. The home is the one in which `behavior_starts` sampled starts. Loading the scene and compiling
its predicates come before, once for all seeds (`preparing`). `--jobs` processes measure an activity each at a time.
An activity is one file, benchmarks/results/behavior100/goals/<activity>.json.
"""

from __future__ import annotations

import argparse
import collections
import concurrent.futures
import functools
import json
import multiprocessing
import os
import pathlib
import statistics
import time
import warnings
from typing import Any

from benchmarks.harness.paths import ROOT
from benchmarks.harness.results import provenance
from ig2mj.process.processors import available

RESULTS = ROOT / "benchmarks" / "results" / "behavior100"
PAGE = ROOT / "docs" / "notes" / "behavior_goals.md"
SECONDS = 30.0
"""Processor time that a goal state may take."""
ENOUGH = 0.8
"""Share of seeds with which an activity counts as reachable."""
ACTIVITIES = 8
"""Activities that a process measures, one after another; a fresh one has none of their memory."""
REASONS = 3
"""Reasons of failure in a row of the page."""

Row = dict[str, Any]


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--activities", nargs="*", help="just these")
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--seconds", type=float, default=SECONDS, help="processor time that a goal state may take")
    parser.add_argument("--jobs", type=int, default=0, help="processes; 0: one per processor")
    parser.add_argument("--resume", action="store_true", help="keep the seeds of earlier runs, do the others")
    parser.add_argument("--out", type=pathlib.Path, default=RESULTS)
    parser.add_argument("--page", type=pathlib.Path, default=PAGE)
    args = parser.parse_args()
    folder = args.out / "goals"
    folder.mkdir(parents=True, exist_ok=True)
    homes = sampled_homes(args.out / "starts") or sampled_homes(RESULTS / "starts")
    names = args.activities or sorted(homes)
    work = functools.partial(
        measure, folder=folder, homes=homes, seeds=args.seeds, seconds=args.seconds, resume=args.resume
    )
    made_by = {**provenance(), "seconds": args.seconds}
    context = multiprocessing.get_context("spawn")
    with concurrent.futures.ProcessPoolExecutor(
        args.jobs or available(), context, initializer=quiet, max_tasks_per_child=ACTIVITIES
    ) as pool:
        running = {pool.submit(work, name, made_by=made_by): name for name in names}
        for done in concurrent.futures.as_completed(running):
            try:
                print(done.result(), flush=True)
            except Exception as e:  # --resume tries it again
                print(f"{running[done]}: {type(e).__name__}: {e}", flush=True)
    write_page(args.page, folder)


def quiet() -> None:
    """Sets up a process."""
    warnings.simplefilter("ignore")
    os.environ.setdefault("JAX_PLATFORMS", "cpu")
    os.environ.setdefault("XLA_FLAGS", "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1")


def sampled_homes(starts: pathlib.Path) -> dict[str, str]:
    """Activity -> the home in which its starts were sampled, of activities of which any were."""
    found = {}
    for file in sorted(starts.glob("*.json")):
        row = json.loads(file.read_text(encoding="utf-8"))
        if any(seed["done"] for seed in row["seeds"]):
            found[file.stem] = row["home"]
    return found


def measure(
    name: str,
    folder: pathlib.Path,
    homes: dict[str, str],
    seeds: int,
    seconds: float,
    resume: bool,
    made_by: Row,
) -> str:
    """Samples the seeds of an activity that its file lacks; a line that says what came of it."""
    file = folder / f"{name}.json"
    known = json.loads(file.read_text(encoding="utf-8")) if resume and file.is_file() else {}
    done = known.get("seeds", [])
    if len(done) < seeds:
        row = sample_seeds(name, homes[name], seeds, known, seconds)
        row["made_by"] = made_by
        file.write_text(json.dumps(row) + "\n", encoding="utf-8")
        done = row["seeds"]
    good = sum(seed["done"] for seed in done)
    return f"{name} in {homes[name]}: {good} of {len(done)}"


def sample_seeds(name: str, home: str, seeds: int, known: Row, seconds: float) -> Row:
    """All seeds of an activity, those of `known` kept if the scene is still the same."""
    from ig2mj.errors import Ig2mjError
    from ig2mj.scene.manifest import load_manifest
    from ig2mj.scene.paths import scene_folder
    from ig2mj.tasks.bddl.binding import bind
    from ig2mj.tasks.bddl.definitions import load_activity
    from ig2mj.tasks.bddl.goal_states import GoalSampler
    from ig2mj.tasks.bddl.start import load_bound

    began = time.process_time()
    binding = bind(load_activity(name), load_manifest(scene_folder(home)))
    scene = load_bound(binding)
    row: Row = {"home": home, "added": list(binding.additions), "digest": scene.digest, "seeds": [], "reasons": {}}
    if known.get("digest") == scene.digest and "failed" not in known:
        row |= {key: known[key] for key in ("seeds", "reasons")}
    try:
        sampler = GoalSampler(binding, scene)
        sampler.compile()
        row["preparing"] = round(time.process_time() - began, 2)
        reasons = collections.Counter(row["reasons"])
        for seed in range(len(row["seeds"]), seeds):
            row["seeds"].append(one_seed(sampler, seed, seconds, reasons))
        row["reasons"] = dict(reasons.most_common())
    except Ig2mjError as e:
        row["failed"] = f"{type(e).__name__}: {e}"
    return row


def one_seed(sampler: Any, seed: int, seconds: float, reasons: collections.Counter) -> Row:
    """A start and a goal state; reasons of failure are counted where there is none."""
    began = time.process_time()
    start, why = sampler.start(seed, 0)
    middle = time.process_time()
    if start is None:
        reasons.update({f"start: {reason}": count for reason, count in why.items()})
        return {"done": False, "start": round(middle - began, 2), "goal": 0.0, "attempts": 0}
    found = sampler.goal(start, seed, 0, seconds)
    if found.row is None:
        reasons.update(found.rejected)
    return {
        "done": found.row is not None,
        "start": round(middle - began, 2),
        "goal": round(time.process_time() - middle, 2),
        "attempts": found.attempts,
        "literals": len(found.reading),
    }


def write_page(page: pathlib.Path, folder: pathlib.Path) -> None:
    """Writes the page from the files of all activities."""
    rows = {f.stem: json.loads(f.read_text(encoding="utf-8")) for f in sorted(folder.glob("*.json"))}
    rows = {name: row for name, row in rows.items() if row["seeds"] or "failed" in row}
    tried = sum(len(row["seeds"]) for row in rows.values())
    good = {name: sum(seed["done"] for seed in row["seeds"]) for name, row in rows.items()}
    enough = sum(good[name] >= ENOUGH * max(len(row["seeds"]), 1) for name, row in rows.items())
    times = [seed["goal"] for row in rows.values() for seed in row["seeds"] if seed["done"]]
    seconds = max((row["made_by"]["seconds"] for row in rows.values()), default=SECONDS)
    lines = [
        "# Goal states of BEHAVIOR-100's activities",
        "",
        "Written by `python -m benchmarks.sampling.behavior_goals`; not by hand. A seed is a start state and a goal",
        "state that the sampler reaches from it: one ground reading of the goal is chosen, and its literals are made",
        f"true with the predicates' own thresholds. A goal state has {seconds:g} s of processor time.",
        "",
        f"**{enough} of {len(rows)} activities succeed with at least {100 * ENOUGH:.0f} % of their seeds**;",
        f"{sum(good.values())} of {tried} seeds succeed.",
    ]
    if times:
        lines.append(f"Processor time of a goal state that is found: median {statistics.median(times):.1f} s.")
    lines += [
        "",
        "*added*: objects from the library. *literals*: of the last reading. *seconds*, *attempts*: medians.",
        "",
        "| activity | home | added | literals | seeds | seconds | attempts | why others fail |",
        "|---|---|--:|--:|--:|--:|--:|---|",
    ]
    for name, row in rows.items():
        seeds = row["seeds"]
        why = row.get("failed", "")
        if not why and good[name] < len(seeds):
            why = "; ".join(f"{reason} ({n})" for reason, n in list(row["reasons"].items())[:REASONS])
        cells = (
            name,
            row["home"],
            len(row["added"]),
            max((seed.get("literals", 0) for seed in seeds), default="-"),
            f"{good[name]} of {len(seeds)}",
            f"{statistics.median(seed['goal'] for seed in seeds):.1f}" if seeds else "-",
            f"{statistics.median(seed['attempts'] for seed in seeds):g}" if seeds else "-",
            why,
        )
        lines.append("| " + " | ".join(map(str, cells)) + " |")
    page.write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
