"""How well kinematic predicates are sampled: success, time, penetration, and whether states stay true.

    python -m benchmarks.sampling.placement                 60 pairs per predicate, 20 seeds each, in birch and spruce
    python -m benchmarks.sampling.placement --resume        only the pairs that no earlier run got to
    python -m benchmarks.sampling.placement --jobs 32 --requests 140    in 32 processes, a processor each

For each predicate, pairs of a loose object and something to place it at are drawn at random among those of fitting
size, and each is requested with several seeds. What succeeded is woken, stepped for five seconds, and asked again; the
deepest penetration is that of the state as it was sampled. Impossible pairs stay in: a share of success below one is
partly theirs, and how long they take to be given up is reported. A pair whose first seeds all fail, so many as
`HOPELESS`, is not tried with more; it counts as if all had failed. Times are processor time of one core.

A pair is one line of benchmarks/results/placement/<predicate>_<home>.jsonl, written when its seeds are done, so that a
run can be stopped at any time. The table is made of all lines that there are.
"""

from __future__ import annotations

import collections
import concurrent.futures
import dataclasses
import functools
import json
import multiprocessing
import os
import pathlib
import time
from typing import Any

import numpy as np
import tyro

import ig2mj
from benchmarks.harness.results import RESULTS, save, table
from ig2mj.sampling.budget import Budget
from ig2mj.sampling.conditions import read_conditions
from ig2mj.sampling.many import make_sampler
from ig2mj.sampling.row import RowSampler

PREDICATES = ("on_top", "inside", "under", "on_floor", "next_to", "in_contact_with")
SECONDS = 5.0
HOPELESS = 4
BUDGET = 250
"""Units of work of a request: those of `Simulation.set_predicate`."""


@dataclasses.dataclass
class Args:
    """See the module's text.

    Attributes:
      homes: where requests are drawn, in turn. requests: pairs per predicate. seeds: times that each is requested.
      predicates: which ones. resume: keep the pairs of earlier runs. jobs: processes. out: folder for results.
    """

    homes: tuple[str, ...] = ("birch", "spruce")
    requests: int = 60
    seeds: int = 20
    predicates: tuple[str, ...] = PREDICATES
    resume: bool = False
    jobs: int = 1
    out: pathlib.Path = RESULTS


def requests(sampler: RowSampler, predicate: str, count: int, rng: np.random.Generator) -> list[tuple[str, str]]:
    """Pairs (object, second argument): anything loose, and what is larger than it in every respect that matters."""
    tables, query = sampler.model.tables, sampler.query
    size = tables.object_bbox
    loose = np.flatnonzero(~tables.object_fixed & ~tables.object_parked & (tables.object_part_of < 0))
    building = np.isin(tables.object_categories, ("walls", "ceilings", "floors", "door", "window", "carpet"))
    hangs = np.array([query.box(o)[0][2] > 1.6 if (tables.piece_object == o).any() else True for o in range(len(size))])
    others = np.flatnonzero(~building & ~hangs & ~tables.object_parked & (tables.object_part_of < 0))
    found: dict[tuple[str, str], None] = {}
    for _ in range(count * 400):
        if len(found) == count:
            break
        a = int(rng.choice(loose))
        if predicate == "on_floor":
            found[(tables.object_names[a], str(rng.choice(tables.room_names)))] = None
            continue
        b = int(rng.choice(others))
        if a == b or tables.object_fixed[a]:
            continue
        small, large = np.sort(size[a]), np.sort(size[b])
        fits = (small[1:] <= 1.2 * large[1:]).all() if predicate == "on_top" else (small <= 0.8 * large).all()
        if predicate == "under":
            fits = large[2] > 0.5 and tables.object_fixed[b] and small[2] < large[2]
        if predicate in ("next_to", "in_contact_with"):
            fits = True
        if fits:
            found[(tables.object_names[a], tables.object_names[b])] = None
    return list(found)


def request(sampler: RowSampler, predicate: str, first: str, second: str, seeds: int) -> dict[str, Any]:
    """Requests a pair with every seed; what came of it."""
    tables, query = sampler.model.tables, sampler.query
    conditions = read_conditions([f"({predicate} {first} {second})"])
    index = tables.object_names.index(first)
    # the first seed also without the clock: what is compiled is no part of a sample's time
    sampler.sample(conditions, np.random.default_rng([1, 0]), Budget(BUDGET), collections.Counter())
    made, failed, stayed, deepest = [], [], 0, 0.0
    reasons: collections.Counter[str] = collections.Counter()
    for seed in range(seeds):
        if seed == HOPELESS and not made:
            break
        why: collections.Counter[str] = collections.Counter()
        began = time.process_time()
        row = sampler.sample(conditions, np.random.default_rng([1, seed]), Budget(BUDGET), why)
        spent = round(time.process_time() - began, 4)
        reasons.update({r.partition(": ")[2] or r: n for r, n in why.items()})
        if row is None:
            failed.append(spent)
            continue
        made.append(spent)
        deepest = max(deepest, float(query.penetrations()[index]))
        view = query.view
        query.place(index, np.array(view.object_pos[0, index], float), np.array(view.object_quat[0, index], float))
        for _ in range(round(SECONDS / (query.engine.substeps * query.engine.timestep))):
            query.physics, _ = query.engine.step(query.physics)
        stayed += sampler.holds(conditions, row.states)
    return {
        "pair": [first, second],
        "seeds": seeds,
        "made_s": made,
        "failed_s": failed,
        "stayed": stayed,
        "deepest_mm": round(1000 * deepest, 3),
        "reasons": dict(reasons.most_common()),
    }


def measure(args: Args, folder: pathlib.Path) -> None:
    """Requests all pairs that are not on file yet."""
    todo: list[tuple[pathlib.Path, str, str, str, str]] = []
    for k, home in enumerate(args.homes):
        sampler = sampler_of(home)
        count = args.requests // len(args.homes) + (k < args.requests % len(args.homes))
        for predicate in args.predicates:
            file = folder / f"{predicate}_{home}.jsonl"
            if not args.resume:
                file.unlink(missing_ok=True)
            known = {tuple(line["pair"]) for line in _lines(file)}
            pairs = requests(sampler, predicate, count, np.random.default_rng([7, k]))
            todo += [(file, home, predicate, *pair) for pair in pairs if pair not in known]
    # one at a time from each predicate and home, so that a run that is stopped has some of all
    turn: collections.Counter[pathlib.Path] = collections.Counter()
    turns = {}
    for one in todo:
        turns[one] = turn[one[0]]
        turn[one[0]] += 1
    todo.sort(key=turns.__getitem__)
    if args.jobs == 1:
        for file, home, predicate, first, second in todo:
            _keep(file, _request(home, predicate, first, second, args.seeds))
        return
    spawn = multiprocessing.get_context("spawn")
    cores = spawn.Queue()
    for core in sorted(os.sched_getaffinity(0))[: args.jobs]:
        cores.put(core)
    with concurrent.futures.ProcessPoolExecutor(args.jobs, spawn, _take_core, (cores,)) as pool:
        running = {pool.submit(_request, *one[1:], args.seeds): one[0] for one in todo}
        for k, done in enumerate(concurrent.futures.as_completed(running)):
            _keep(running[done], done.result())
            print(f"{k + 1} of {len(todo)} pairs", flush=True)


@functools.cache
def sampler_of(home: str) -> RowSampler:
    """A home's sampler, made once in a process."""
    return make_sampler(ig2mj.load_scene(home))


def _request(home: str, predicate: str, first: str, second: str, seeds: int) -> dict[str, Any]:
    return request(sampler_of(home), predicate, first, second, seeds)


def _take_core(cores: multiprocessing.Queue) -> None:
    os.sched_setaffinity(0, {cores.get()})


def _keep(file: pathlib.Path, found: dict[str, Any]) -> None:
    with file.open("a", encoding="utf-8") as out:
        out.write(json.dumps(found) + "\n")


def _lines(file: pathlib.Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in file.read_text(encoding="utf-8").splitlines()] if file.is_file() else []


def summary(predicate: str, lines: list[dict[str, Any]]) -> dict[str, Any]:
    """A predicate's row of the table."""
    made = [s for line in lines for s in line["made_s"]]
    failed = [s for line in lines for s in line["failed_s"]]
    reasons: collections.Counter[str] = collections.Counter()
    for line in lines:
        reasons.update(line["reasons"])
    return {
        "predicate": predicate,
        "pairs": len(lines),
        "pairs_that_succeeded": sum(bool(line["made_s"]) for line in lines),
        "requests": sum(line["seeds"] for line in lines),
        "samples": len(made),
        "success": len(made) / max(sum(line["seeds"] for line in lines), 1),
        "true_after_5_s": sum(line["stayed"] for line in lines) / max(len(made), 1),
        "deepest_mm": max((line["deepest_mm"] for line in lines), default=0.0),
        "ms_per_sample": 1000 * float(np.mean(made or [np.nan])),
        "median_ms": 1000 * float(np.median(made or [np.nan])),
        "seconds_to_give_up": float(np.mean(failed or [0.0])),
        "longest_to_give_up": max(failed, default=0.0),
        "reasons": dict(reasons.most_common()),
    }


def main(args: Args) -> None:
    folder = args.out / "placement"
    folder.mkdir(parents=True, exist_ok=True)
    measure(args, folder)
    rows = []
    for predicate in PREDICATES:
        lines = [line for file in sorted(folder.glob(f"{predicate}_*.jsonl")) for line in _lines(file)]
        if lines:
            rows.append(summary(predicate, lines))
    columns = (
        "predicate",
        "requests",
        "success",
        "pairs possible",
        "success of these",
        "true after 5 s",
        "deepest mm",
        "ms a sample (median)",
        "s to give up (most)",
    )
    cells = [
        (
            r["predicate"],
            f"{r['requests']:,}",
            f"{r['success']:.3f}",
            f"{r['pairs_that_succeeded']} of {r['pairs']}",
            f"{r['success'] * r['pairs'] / max(r['pairs_that_succeeded'], 1):.3f}",
            f"{r['true_after_5_s']:.4f}",
            f"{r['deepest_mm']:.2f}",
            f"{r['ms_per_sample']:.0f} ({r['median_ms']:.0f})",
            f"{r['seconds_to_give_up']:.1f} ({r['longest_to_give_up']:.1f})",
        )
        for r in rows
    ]
    tables = [table(f"Sampled placements in {', '.join(args.homes)}", columns, cells)]
    save("placement", 0, {**dataclasses.asdict(args), "out": args.out.name}, rows, tables, args.out)


if __name__ == "__main__":
    main(tyro.cli(Args, description=__doc__))
