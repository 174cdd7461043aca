"""Named cases of sampling: placements that iGibson never finds, a book on a table per second, hopeless requests.

    python -m benchmarks.sampling.placement_cases [--seeds 20] [--speed 200]

Times are processor time of one core: on a machine with other work they say more than a clock.
"""

from __future__ import annotations

import collections
import dataclasses
import pathlib
import time

import numpy as np
import tyro

import ig2mj
from benchmarks.harness.results import RESULTS, save, table
from benchmarks.sampling.placement import BUDGET, request
from ig2mj.sampling.budget import Budget
from ig2mj.sampling.conditions import Condition, read_conditions
from ig2mj.sampling.many import make_sampler
from ig2mj.sampling.row import RowSampler
from ig2mj.scene.manifest import load_manifest
from ig2mj.scene.paths import scene_folder
from ig2mj.tasks.bddl.binding import bind
from ig2mj.tasks.bddl.definitions import load_activity
from ig2mj.tasks.bddl.start import load_bound, start_conditions

NEVER_IN_IGIBSON = (
    ("linden", "inside", "apple_0", "bowl_0"),
    ("sequoia", "inside", "casserole_0", "oven_0"),
    ("linden", "inside", "ball_0", "basket_0"),
    ("linden", "under", "pillow_0", "bed_0"),
    ("linden", "on_top", "laptop_0", "stool_0"),
)
"""Possible placements that iGibson's sampler did not find in any of 20 seeds."""

HOPELESS = (
    ("birch", "inside", "pillow_0", "bowl_0"),
    ("birch", "on_top", "laptop_0", "watch_0"),
    ("birch", "inside", "cheese_0", "console_table_0"),
    ("linden", "inside", "basket_0", "ball_0"),
)
ADDED = {"linden": ("apple",)}

BOOK = ("birch", "(on_top hardback_0 coffee_table_0)")
ACTIVITIES = (("brushing_lint_off_clothing", "birch"), ("cleaning_oven", "sequoia"), ("cleaning_closet", "sequoia"))
"""With ten conditions each."""


@dataclasses.dataclass
class Args:
    """See the module's text.

    Attributes:
      seeds: of each placement. speed: samples that are timed. out: folder for results.
    """

    seeds: int = 20
    speed: int = 200
    out: pathlib.Path = RESULTS


def per_second(sampler: RowSampler, conditions: list[Condition], count: int) -> tuple[int, float]:
    """Rows made of `count`, and how many of them in a second of processor time, after the first two."""
    made = 0
    began = time.process_time()
    for seed in range(-2, count):
        if seed == 0:
            made, began = 0, time.process_time()
        row = sampler.sample(conditions, np.random.default_rng([3, seed + 2]), Budget(BUDGET), collections.Counter())
        made += row is not None
    return made, made / (time.process_time() - began)


def main(args: Args) -> None:
    samplers: dict[str, RowSampler] = {}

    def of(home: str) -> RowSampler:
        if home not in samplers:
            samplers[home] = make_sampler(ig2mj.load_scene(home, objects=ADDED.get(home, ())))
        return samplers[home]

    rows, cells = [], []
    for home, predicate, first, second in (*NEVER_IN_IGIBSON, *HOPELESS):
        found = request(of(home), predicate, first, second, args.seeds)
        rows.append({"home": home, "predicate": predicate, **found})
        made, failed = found["made_s"], found["failed_s"]
        text = f"({predicate} {first} {second})"
        cells.append(
            (
                f"{text} in {home}",
                f"{len(made)} of {len(made) + len(failed)}",
                f"{1000 * float(np.median(made)):.0f}" if made else "-",
                f"{found['stayed']}",
                f"{found['deepest_mm']:.2f}",
                f"{max(failed):.1f}" if failed else "-",
            )
        )
        print(*cells[-1], flush=True)
    columns = ("request", "made", "ms each (median)", "true after 5 s", "deepest mm", "s to give up (most)")
    tables = [table("Named placements", columns, cells)]

    speeds = []
    home, text = BOOK
    made, rate = per_second(of(home), read_conditions([text]), args.speed)
    speeds.append({"what": f"{text} in {home}", "rows": made, "of": args.speed, "per_second": rate})
    for name, home in ACTIVITIES:
        binding = bind(load_activity(name), load_manifest(scene_folder(home)))
        scene = load_bound(binding)
        expected, sampler = start_conditions(binding, scene), make_sampler(scene)
        count = max(args.speed // 10, 2)
        made, rate = per_second(sampler, expected, count)
        what = f"{name} in {home}, {len(expected)} conditions"
        speeds.append({"what": what, "rows": made, "of": count, "per_second": rate})
    lines = [(s["what"], f"{s['rows']} of {s['of']}", f"{s['per_second']:.1f}") for s in speeds]
    tables.append(table("Settled states per second, one core", ("what", "made", "per second"), lines))
    settings = {**dataclasses.asdict(args), "out": args.out.name}
    save("placement_cases", 0, settings, [*rows, *speeds], tables, args.out)


if __name__ == "__main__":
    main(tyro.cli(Args, description=__doc__))
