"""How well placements are sampled in disturbed homes, at rest and while loose objects still move.

    python -m benchmarks.sampling.placement_disturbed         500 requests per predicate and kind of start, all homes
    python -m benchmarks.sampling.placement_disturbed --homes birch --requests 50 --predicates on_top

A start is a row of the pool of `ig2mj sample HOME --disturb --count ROWS --seed 0`: *at rest* as it is, or *moving*:
its loose objects are disturbed again, as that command does it, and let go for a fifth of a second. A request is a pair
of a loose object and something to place it at, of fitting size, drawn at random (as in placement.py); the k-th request
of a predicate has the same start, pair and seed in every run.

A request is *possible* if it succeeds from any kind of start, or if, in the same start at rest, one of `--searches`
further seeds finds a place with `SEARCH_WORK` units of work. It *has candidates* if any of these got as far as letting
the object go. The first depends on the sampler, and the second on geometry alone: the share of requests with candidates
that succeed is a lower bound of the share of possible ones.

What succeeded is woken, stepped for three seconds, and asked again. Times are processor time of one core. A request is
one line of benchmarks/results/placement_disturbed/<home>.jsonl, written when the home is done; `--resume` keeps the
homes of earlier runs, so that `--only` can spread them over several. The table is made of all lines that there are.
"""

from __future__ import annotations

import collections
import dataclasses
import json
import pathlib
import time
from typing import Any

import jax
import numpy as np
import tyro

import ig2mj
from benchmarks.harness.results import RESULTS, save, table
from benchmarks.sampling.placement import BUDGET, requests
from ig2mj.engine.snapshot import Snapshot
from ig2mj.sampling.budget import Budget
from ig2mj.sampling.conditions import Condition, read_conditions
from ig2mj.sampling.many import make_sampler
from ig2mj.sampling.perturbation import loose_objects, perturb
from ig2mj.sampling.placement import NOWHERE, Rejections
from ig2mj.sampling.settled import make_pool
from ig2mj.scene.paths import shipped_homes
from ig2mj.worlds.random_streams import episode_keys

STARTS = ("at rest", "moving")
SHARE = 0.3
"""Probability that an object is disturbed: the default of `ig2mj sample --disturb`."""

MOVING_STEPS = 6
"""Control steps between the second disturbance and the request."""

SECONDS = 3.0
SEARCH_WORK = 500


@dataclasses.dataclass
class Args:
    """See the module's text.

    Attributes:
      homes: where requests are drawn, in turn; none: all that ship. rows: disturbed states of each. requests: per
        predicate and start. predicates, starts: which ones. searches: further seeds of requests that fail. only: homes
        to do now, out of all; none: all. resume: keep what is on file. out: folder for results.
    """

    homes: tuple[str, ...] = ()
    rows: int = 4
    requests: int = 500
    predicates: tuple[str, ...] = ("on_top", "inside")
    starts: tuple[str, ...] = STARTS
    searches: int = 1
    only: tuple[str, ...] = ()
    resume: bool = False
    out: pathlib.Path = RESULTS


class Home:
    """A home's sampler and its disturbed states."""

    def __init__(self, name: str, rows: int):
        scene = ig2mj.load_scene(name)
        self.sampler = make_sampler(scene)
        self.states = self.sampler._initial
        pool = make_pool(scene, self.sampler.model, rows, seed=0, share=SHARE, threads=1)
        self.at_rest = [jax.tree.map(lambda a, n=n: np.asarray(a[n]), pool.physics) for n in range(pool.size)]
        self.moving = [self._disturbed(n) for n in range(pool.size)]

    def start(self, kind: str, number: int) -> Snapshot:
        """A start by its number, over and over again."""
        return (self.at_rest if kind == "at rest" else self.moving)[number % len(self.at_rest)]

    def _disturbed(self, number: int) -> Snapshot:
        query, tables = self.sampler.query, self.sampler.model.tables
        query.load(self.at_rest[number])
        key = episode_keys(1, np.array([number]), np.array([0]))
        query.write(jax.device_get(perturb(tables, loose_objects(tables), query.view, key, SHARE)))
        for _ in range(MOVING_STEPS):
            query.physics, _ = query.engine.step(query.physics)
        return query.save()


def ask(home: Home, conditions: list[Condition], start: Snapshot, seed: list[int], work: int) -> dict[str, Any]:
    """One request; what came of it, and how long it took."""
    sampler, why = home.sampler, Rejections()
    sampler.start_from(start, home.states)
    began = time.process_time()
    row = sampler.sample(conditions, np.random.default_rng(seed), Budget(work), why)
    reasons = {r.partition(": ")[2] or r: n for r, n in why.items()}
    found = {"made": row is not None, "s": round(time.process_time() - began, 4), "reasons": reasons}
    if row is None:
        return found
    query, index = sampler.query, sampler.model.tables.object_names.index(conditions[0].arguments[0])
    deepest = float(query.penetrations()[index])
    view = query.view
    query.place(index, np.array(view.object_pos[0, index], float), np.array(view.object_quat[0, index], float))
    for _ in range(round(SECONDS / (query.engine.substeps * query.engine.timestep))):
        query.physics, _ = query.engine.step(query.physics)
    return {**found, "stayed": sampler.holds(conditions, row.states), "deepest_mm": round(1000 * deepest, 3)}


def has_candidates(found: dict[str, Any]) -> bool:
    """Whether an object was let go anywhere."""
    return found["made"] or not NOWHERE.union(("budget spent",)).issuperset(found["reasons"])


def measure(home: Home, name: str, predicate: str, args: Args, count: int) -> list[dict[str, Any]]:
    """Asks a home's requests of one predicate, from every kind of start."""
    home.sampler.query.load(home.at_rest[0])
    pairs = requests(home.sampler, predicate, count, np.random.default_rng(0))
    lines = []
    for number in range(count):
        pair = pairs[number % len(pairs)]
        conditions = read_conditions([f"({predicate} {pair[0]} {pair[1]})"])
        ask(home, conditions, home.start("at rest", number), [0, number], 1)  # compiles the question
        found = {kind: ask(home, conditions, home.start(kind, number), [0, number], BUDGET) for kind in args.starts}
        possible = any(f["made"] for f in found.values())
        candidates = any(has_candidates(f) for f in found.values())
        for search in range(0 if possible else args.searches):
            more = ask(home, conditions, home.start("at rest", number), [1, number, search], SEARCH_WORK)
            possible, candidates = more["made"], candidates or has_candidates(more)
            if possible or not candidates:
                break
        for kind, one in found.items():
            lines.append({"predicate": predicate, "start": kind, "home": name, "number": number, "pair": list(pair),
                          "possible": possible, "candidates": candidates, **one})  # fmt: skip
    return lines


def summary(predicate: str, start: str, lines: list[dict[str, Any]]) -> dict[str, Any]:
    """A row of the table."""
    made = [line for line in lines if line["made"]]
    possible, candidates = (sum(line[name] for line in lines) for name in ("possible", "candidates"))
    refused: collections.Counter[str] = collections.Counter()
    for line in lines:
        if line["possible"] and not line["made"]:
            refused.update({max(line["reasons"], key=line["reasons"].get): 1} if line["reasons"] else {"none": 1})
    rejected: collections.Counter[str] = collections.Counter()
    for line in lines:
        rejected.update(line["reasons"])
    return {
        "predicate": predicate,
        "start": start,
        "requests": len(lines),
        "made": len(made),
        "possible": possible,
        "with_candidates": candidates,
        "success": len(made) / max(len(lines), 1),
        "success_of_possible": len(made) / max(possible, 1),
        "success_of_candidates": len(made) / max(candidates, 1),
        "true_after_3_s": sum(line["stayed"] for line in made),
        "deepest_mm": max((line["deepest_mm"] for line in made), default=0.0),
        "ms_per_request": 1000 * float(np.mean([line["s"] for line in lines] or [np.nan])),
        "ms_per_possible_request": 1000 * float(np.mean([line["s"] for line in lines if line["possible"]] or [np.nan])),
        "ms_median": 1000 * float(np.median([line["s"] for line in lines] or [np.nan])),
        "possible_refused_for": dict(refused.most_common()),
        "rejections": dict(rejected.most_common()),
    }


def main(args: Args) -> None:
    folder = args.out / "placement_disturbed"
    folder.mkdir(parents=True, exist_ok=True)
    homes = args.homes or tuple(shipped_homes())
    for k, name in enumerate(homes):
        file = folder / f"{name}.jsonl"
        if (args.only and name not in args.only) or (args.resume and file.is_file()):
            continue
        home, found = Home(name, args.rows), []
        for predicate in args.predicates:
            count = args.requests // len(homes) + (k < args.requests % len(homes))
            found += measure(home, name, predicate, args, count)
        file.write_text("".join(json.dumps(line) + "\n" for line in found))
        print(f"{name}: {k + 1} of {len(homes)} homes", flush=True)
    files = [folder / f"{name}.jsonl" for name in homes]
    lines = [json.loads(line) for f in files if f.is_file() for line in f.read_text().splitlines()]
    rows = []
    for predicate in args.predicates:
        for start in args.starts:
            rows.append(
                summary(predicate, start, [x for x in lines if (x["predicate"], x["start"]) == (predicate, start)])
            )
    cells = [
        (
            f"{r['predicate']}, {r['start']}",
            f"{r['requests']:,}",
            f"{r['success']:.3f}",
            f"{r['possible']}",
            f"{r['success_of_possible']:.3f}",
            f"{r['with_candidates']}",
            f"{r['success_of_candidates']:.3f}",
            f"{r['true_after_3_s']} of {r['made']}",
            f"{r['ms_per_possible_request']:.0f}",
            f"{r['ms_per_request']:.0f} ({r['ms_median']:.0f})",
        )
        for r in rows
    ]
    columns = ("request", "number", "success", "possible", "success of these", "with candidates", "success of these",
               "true after 3 s", "ms a possible request", "ms a request (median)")  # fmt: skip
    settings = {**dataclasses.asdict(args), "homes": list(homes), "out": args.out.name}
    save("placement_disturbed", 0, settings, rows, [table("Placements in disturbed homes", columns, cells)], args.out)
    for r in rows:
        print(r["predicate"], r["start"], "refused, though possible:", r["possible_refused_for"])


if __name__ == "__main__":
    main(tyro.cli(Args, description=__doc__))
