"""The starts of BEHAVIOR-100's activities, sampled: how many seeds succeed in the home that fits best.

    python -m benchmarks.sampling.behavior_starts --seeds 10           every activity; writes docs/notes/behavior100.md
    python -m benchmarks.sampling.behavior_starts --seeds 10 --resume    only the seeds that no earlier run got to
    python -m benchmarks.sampling.behavior_starts --activities cleaning_toilet --part 0 2    every second one
    python -m benchmarks.sampling.behavior_starts --suite behavior1k --seeds 3 --resume    those of BEHAVIOR-1K that fit

A row has 60 s of wall time. Homes are tried in turn, those to which least is added first, until in one of them a start
can be sampled (at most three). The scene is loaded and its predicates are compiled before, once for all seeds
(`preparing`).
An activity is one file, benchmarks/results/behavior100/starts/<activity>.json (BEHAVIOR-1K: starts1k).
"""

from __future__ import annotations

import argparse
import collections
import json
import pathlib
import time
from typing import Any

import jax
import numpy as np

from benchmarks.harness.paths import ROOT
from benchmarks.sampling.behavior import expressible
from benchmarks.sampling.behavior_page import write_page
from ig2mj.errors import Ig2mjError
from ig2mj.sampling.budget import Budget
from ig2mj.sampling.many import make_sampler, sample_row
from ig2mj.scene.manifest import load_manifest
from ig2mj.scene.paths import scene_folder, shipped_homes
from ig2mj.tasks.bddl.binding import Binding
from ig2mj.tasks.bddl.definitions import load_activity
from ig2mj.tasks.bddl.start import HOMES, GoalCheck, fitting, load_bound, start_conditions

RESULTS = ROOT / "benchmarks" / "results" / "behavior100"
PAGE = ROOT / "docs" / "notes" / "behavior100.md"
SECONDS = 60.0
"""Wall time that a seed may take, if nothing else is said."""
HOPELESS = 3
"""An activity whose first seeds all fail, so many of them, is not tried with more."""


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--suite", choices=("behavior100", "behavior1k"), default="behavior100")
    parser.add_argument("--activities", nargs="*", help="just these")
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--seconds", type=float, default=SECONDS, help="wall time that a seed may take")
    parser.add_argument("--resume", action="store_true", help="keep the seeds of earlier runs, do the others")
    parser.add_argument("--part", nargs=2, type=int, metavar=("N", "OF"), default=(0, 1), help="every OF-th activity")
    parser.add_argument("--out", type=pathlib.Path, default=RESULTS)
    parser.add_argument("--page", type=pathlib.Path, default=PAGE)
    args = parser.parse_args()
    behavior_1k = args.suite == "behavior1k"
    folder = args.out / ("starts1k" if behavior_1k else "starts")
    folder.mkdir(parents=True, exist_ok=True)
    homes = [load_manifest(scene_folder(home)) for home in shipped_homes()]
    names = args.activities or [activity.name for activity in expressible(behavior_1k)]
    for name in names[args.part[0] :: args.part[1]]:
        bound, _ = fitting(load_activity(name, behavior_1k), homes)
        if behavior_1k and not bound:
            continue  # the page says what it lacks
        file = folder / f"{name}.json"
        known = json.loads(file.read_text(encoding="utf-8")) if args.resume and file.is_file() else {}
        tried = [seed["done"] for seed in known.get("seeds", ())]
        if len(tried) >= args.seeds or (len(tried) >= HOPELESS and not any(tried)):
            continue
        row = try_activity(bound, args.seeds, known, args.seconds)
        file.write_text(json.dumps(row) + "\n", encoding="utf-8")
        good = sum(seed["done"] for seed in row["seeds"])
        why = row.get("failed") or ", ".join(list(row["reasons"])[:2] if good < len(row["seeds"]) else [])
        print(f"{name} in {row['home']}: {good} of {len(row['seeds'])} {why}", flush=True)
        jax.clear_caches()
    write_page(args.page, args.out)


def try_activity(bound: list[Binding], seeds: int, known: dict[str, Any], seconds: float) -> dict[str, Any]:
    """What came of the seeds; those in `known` are kept if the home and the binding are still the same."""
    if not bound:
        return {"home": None, "failed": "fits no home", "seeds": [], "reasons": {}}
    if any(seed["done"] for seed in known.get("seeds", ())):
        bound = sorted(bound, key=lambda b: b.home != known["home"])
    found: dict[str, Any] = {}
    for best in bound[:HOMES]:
        found = try_home(best, seeds, known, seconds)
        if "failed" not in found and any(seed["done"] for seed in found["seeds"]):
            return found
        known = {}
    return found


def try_home(best: Binding, seeds: int, known: dict[str, Any], seconds: float) -> dict[str, Any]:
    """What came of the seeds in one home."""
    row: dict[str, Any] = {
        "home": best.home,
        "added": list(best.additions),
        "preparing": 0.0,
        "allowed": seconds,
        "seeds": [],
        "reasons": {},
    }
    if known.get("home") == best.home and known.get("added") == row["added"] and "failed" not in known:
        row |= {key: known[key] for key in ("seeds", "reasons")}
    try:
        return {**row, **sample_seeds(best, seeds, row, seconds)}
    except Ig2mjError as e:
        return {**row, "failed": f"{type(e).__name__}: {e}"}


def sample_seeds(binding: Binding, seeds: int, row: dict[str, Any], seconds: float) -> dict[str, Any]:
    """Samples the seeds that are not among those of `row` yet."""
    began = time.monotonic()
    scene = load_bound(binding)
    sampler = make_sampler(scene)
    expected = start_conditions(binding, scene)
    check = GoalCheck(binding, sampler.query, sampler.model)
    sampler.sample(expected, np.random.default_rng(0), Budget(1), collections.Counter())  # compiles
    preparing = time.monotonic() - began
    done, reasons = list(row["seeds"]), collections.Counter(row["reasons"])
    for seed in range(len(done), seeds):
        if len(done) >= HOPELESS and not any(one["done"] for one in done):
            break
        wall, processor = time.monotonic(), time.process_time()
        made, why = sample_row(sampler, expected, seed, 0, seconds)
        done.append(
            {
                "done": made is not None,
                "seconds": round(time.monotonic() - wall, 2),
                "processor": round(time.process_time() - processor, 2),
                "goal_holds": made is not None and check.holds(made.states),
            }
        )
        reasons.update(why)
    return {
        "preparing": round(preparing, 2),
        "conditions": len(expected),
        "seeds": done,
        "reasons": dict(reasons.most_common()),
    }


if __name__ == "__main__":
    main()
