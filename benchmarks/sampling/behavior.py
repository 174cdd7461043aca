"""In which homes BEHAVIOR's activities can be done: each is bound and compiled in all homes that ship.

    python -m benchmarks.sampling.behavior                       all 100, home by home; writes docs/notes/behavior100.md
    python -m benchmarks.sampling.behavior --suite behavior1k    those of BEHAVIOR-1K that need only our predicates
    python -m benchmarks.sampling.behavior --resume              only the homes that an earlier run did not get to
    python -m benchmarks.sampling.behavior --homes birch         just this home, in place of what is known of it

The starts of BEHAVIOR-100 are sampled by benchmarks/sampling/behavior_starts.py, whose results the page shows, too.

A home is one file, benchmarks/results/behavior100/<suite>/<home>.json, written when the home is done. It is loaded
once, with all that any of its activities adds: names of additions go on by category, so that every activity finds the
names it would have alone. Start and goal of each activity are then compiled against it.
"""

from __future__ import annotations

import argparse
import collections
import json
import pathlib
import time
import warnings
from typing import Any

import msgspec

from benchmarks.harness.paths import ROOT
from benchmarks.sampling.behavior_page import write_page
from ig2mj.errors import Ig2mjError
from ig2mj.predicates import AbilityWarning
from ig2mj.scene.manifest import load_manifest
from ig2mj.scene.paths import scene_folder, shipped_homes
from ig2mj.scene.scene import load_scene
from ig2mj.states.model import StateModel
from ig2mj.tasks.bddl.binding import Binding, BindingError, bind
from ig2mj.tasks.bddl.definitions import activity_names, load_activity
from ig2mj.tasks.bddl.goal import conditions
from ig2mj.tasks.bddl.vocabulary import Activity, VocabularyError

RESULTS = ROOT / "benchmarks" / "results" / "behavior100"
PAGE = ROOT / "docs" / "notes" / "behavior100.md"


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--suite", choices=("behavior100", "behavior1k"), default="behavior100")
    parser.add_argument("--homes", nargs="*", help="just these homes")
    parser.add_argument("--resume", action="store_true", help="keep what an earlier run found, do the other homes")
    parser.add_argument("--out", type=pathlib.Path, default=RESULTS)
    parser.add_argument("--page", type=pathlib.Path, default=PAGE)
    args = parser.parse_args()
    folder = args.out / args.suite
    folder.mkdir(parents=True, exist_ok=True)
    activities = list(expressible(args.suite == "behavior1k"))
    for home in args.homes or shipped_homes():
        file = folder / f"{home}.json"
        if args.resume and file.is_file():
            continue
        start = time.process_time()
        rows = try_home(home, activities)
        seconds = round(time.process_time() - start, 2)
        file.write_text(json.dumps({"home": home, "seconds": seconds, "activities": rows}) + "\n")
        fit = sum("missing" not in row for row in rows.values())
        print(f"{home}: {fit} of {len(rows)} activities, {seconds} s of processor time", flush=True)
    write_page(args.page, args.out)


def expressible(behavior_1k: bool) -> list[Activity]:
    """All activities that need only our predicates."""
    found = []
    for name in activity_names(behavior_1k):
        try:
            found.append(load_activity(name, behavior_1k))
        except VocabularyError:
            continue
    return found


def try_home(home: str, activities: list[Activity]) -> dict[str, dict[str, Any]]:
    """Activity -> what came of it: `missing` (reasons), or `failed` (an error), or how much was compiled."""
    manifest = load_manifest(scene_folder(home))
    rows: dict[str, dict[str, Any]] = {}
    bound: dict[str, Binding] = {}
    most: collections.Counter[str] = collections.Counter()
    for activity in activities:
        try:
            bound[activity.name] = bind(activity, manifest)
        except BindingError as e:
            rows[activity.name] = {"missing": list(e.reasons)}
        else:
            most |= collections.Counter(bound[activity.name].additions)
    scene = load_scene(home, objects=sorted(most.elements()))
    for name, binding in bound.items():
        manifest = msgspec.structs.replace(scene.manifest, substances=list(binding.activity.substances))
        rows[name] = compile_in(binding, StateModel.of_manifest(scene.tables, manifest))
    return {activity.name: rows[activity.name] for activity in activities}


def compile_in(binding: Binding, model: StateModel) -> dict[str, Any]:
    """Compiles start and goal; how much there is of each."""
    found = conditions(binding)
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always", AbilityWarning)
        try:
            goal, init = found.compile_goal(model), found.compile_init(model)
        except Ig2mjError as e:
            return {"failed": str(e)}
    return {
        "objects": len(binding.objects),
        "added": len(binding.additions),
        "goal_literals": len(goal.atoms),
        "start_literals": len(init.atoms),
        "without_ability": sorted({str(w.message) for w in said if issubclass(w.category, AbilityWarning)}),
        "stand_ins": dict(binding.stand_ins),
    }


if __name__ == "__main__":
    main()
