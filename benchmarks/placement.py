"""How well kinematic predicates are sampled: success, time, penetration, and whether states stay true.

    python benchmarks/placement.py [--homes birch spruce] [--requests 50] [--seeds 20]

For each predicate, pairs of a loose object and something to place it at are drawn at random among those of fitting
size, and each is requested with several seeds. What succeeded is woken, stepped for five seconds, and asked again; the
deepest penetration is that of the state as it was sampled. Impossible pairs stay in: a share of success below one is
partly theirs, and how long they take to be given up is told.
"""

from __future__ import annotations

import collections
import dataclasses
import pathlib
import time
from collections.abc import Sequence

import numpy as np
import tyro
from results import RESULTS, save, table
from rich.progress import track

import ig2mj
from ig2mj.sampling.conditions import read_conditions
from ig2mj.sampling.many import make_sampler
from ig2mj.sampling.placement import Budget
from ig2mj.sampling.row import RowSampler

PREDICATES = ("on_top", "inside", "under", "on_floor", "next_to", "in_contact_with")
SECONDS = 5.0
BUDGET = 250


@dataclasses.dataclass
class Args:
    """See the module's text.

    Attributes:
      homes: where requests are drawn, in turn. requests: pairs per predicate. seeds: times that each is requested.
      predicates: which ones. out: folder for results.
    """

    homes: tuple[str, ...] = ("birch", "spruce")
    requests: int = 50
    seeds: int = 20
    predicates: tuple[str, ...] = PREDICATES
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


@dataclasses.dataclass
class Tally:
    """Counts of one predicate."""

    requests: int = 0
    tried: int = 0
    possible: int = 0
    succeeded: int = 0
    stayed: int = 0
    deepest: float = 0.0
    seconds: float = 0.0
    seconds_of_failures: float = 0.0
    longest_failure: float = 0.0
    reasons: collections.Counter = dataclasses.field(default_factory=collections.Counter)


def measure(sampler: RowSampler, predicate: str, pairs: Sequence[tuple[str, str]], seeds: int, tally: Tally) -> None:
    """Requests every pair with every seed."""
    tables, query = sampler.model.tables, sampler.query
    for first, second in track(pairs, f"{predicate} in {query.scene.name}"):
        conditions = read_conditions([f"({predicate} {first} {second})"])
        index = tables.object_names.index(first)
        sampler.sample(conditions, np.random.default_rng(0), Budget(1), collections.Counter())  # compiles
        successes = 0
        for seed in range(seeds):
            reasons: collections.Counter = collections.Counter()
            began = time.process_time()
            row = sampler.sample(conditions, np.random.default_rng([1, seed]), Budget(BUDGET), reasons)
            spent = time.process_time() - began
            tally.tried += 1
            tally.reasons.update({r.partition(": ")[2] or r: n for r, n in reasons.items()})
            if row is None:
                tally.seconds_of_failures += spent
                tally.longest_failure = max(tally.longest_failure, spent)
                continue
            successes += 1
            tally.seconds += spent
            tally.deepest = max(tally.deepest, float(query.penetrations()[index]))
            view = query.view
            query.place(index, np.array(view.object_pos[0, index], float), np.array(view.object_quat[0, index], float))
            for _ in range(round(SECONDS / (query.engine.substeps * query.engine.timestep))):
                query.physics, _ = query.engine.step(query.physics)
            tally.stayed += sampler.holds(conditions, row.states)
        tally.requests += 1
        tally.possible += successes > 0
        tally.succeeded += successes


def main(args: Args) -> None:
    samplers = [make_sampler(ig2mj.load_scene(home)) for home in args.homes]
    rows = []
    for predicate in args.predicates:
        tally = Tally()
        for k, sampler in enumerate(samplers):
            count = args.requests // len(samplers) + (k < args.requests % len(samplers))
            pairs = requests(sampler, predicate, count, np.random.default_rng([7, k]))
            measure(sampler, predicate, pairs, args.seeds, tally)
        failures = tally.tried - tally.succeeded
        rows.append(
            {
                "predicate": predicate,
                "requests": tally.requests,
                "tried": tally.tried,
                "pairs that succeeded at least once": tally.possible,
                "success": tally.succeeded / max(tally.tried, 1),
                "true after 5 s": tally.stayed / max(tally.succeeded, 1),
                "deepest_mm": tally.deepest * 1000,
                "ms_per_sample": 1000 * tally.seconds / max(tally.succeeded, 1),
                "seconds_to_give_up": tally.seconds_of_failures / max(failures, 1),
                "longest_to_give_up": tally.longest_failure,
                "reasons": dict(tally.reasons.most_common()),
            }
        )
    columns = (
        "predicate",
        "tried",
        "success",
        "pairs possible",
        "true after 5 s",
        "deepest mm",
        "ms a sample",
        "s to give up",
    )
    cells = [
        (
            r["predicate"],
            f"{r['tried']:,}",
            f"{r['success']:.3f}",
            f"{r['pairs that succeeded at least once']} of {r['requests']}",
            f"{r['true after 5 s']:.4f}",
            f"{r['deepest_mm']:.2f}",
            f"{r['ms_per_sample']:.1f}",
            f"{r['seconds_to_give_up']:.1f} (at most {r['longest_to_give_up']:.1f})",
        )
        for r in rows
    ]
    tables = [table(f"Sampled placements in {', '.join(args.homes)}, one core", columns, cells)]
    save("placement", 0, {**dataclasses.asdict(args), "out": args.out.name}, rows, tables, args.out)


if __name__ == "__main__":
    main(tyro.cli(Args, description=__doc__))
