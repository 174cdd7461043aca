"""Solves some starts of an activity and reports each; `benchmarks.planning.activities` runs many of these.

    python -m benchmarks.planning.worker making_tea --rung symbolic --starts 0 1 2

Without `--starts` it samples the activity's start states, which are kept (`Problem.pool`).
"""

from __future__ import annotations

import argparse
import pathlib
import time
import traceback
import warnings
from collections.abc import Iterator, Sequence

from benchmarks.planning.baselines import AGENTS, planner_of, settings_of
from benchmarks.planning.moving import SomebodyElse
from ig2mj.agents.registry import make_robot
from ig2mj.cluster.reporting import end_with_parent, report
from ig2mj.demos.solving import Episodes
from ig2mj.errors import Ig2mjError
from ig2mj.planning.domain import Domain
from ig2mj.planning.kinematic import kinematic_episodes
from ig2mj.planning.physics import PhysicsRung
from ig2mj.planning.problem import Problem, problem_of
from ig2mj.planning.results import row_of
from ig2mj.planning.solver import EpisodeResult, StepRecord, solve
from ig2mj.planning.symbolic import symbolic_episodes
from ig2mj.planning.task_planner import TaskPlan, TaskPlanner
from ig2mj.scene.manifest import load_manifest
from ig2mj.scene.paths import scene_folder, shipped_homes
from ig2mj.tasks.bddl.definitions import load_activity
from ig2mj.tasks.bddl.start import fitting
from ig2mj.tasks.bddl.task import bddl_task

DEFAULTS = {"agent": "planner", "home": "", "grasping": "assisted", "moved": "none"}
"""Conditions that a row holds only where they differ from these."""

MOVED = "once: in the middle of the plan somebody else moves an object that is still needed"

SAMPLED_TOGETHER = 10
"""Start states that are kept on disk together while they are sampled."""


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("activity")
    parser.add_argument("--rung", default="physics")
    parser.add_argument("--starts", type=int, nargs="*", default=(), help="numbers of start states")
    parser.add_argument("--count", type=int, default=1, help="start states that the pool should have")
    parser.add_argument("--split", default="held_out")
    parser.add_argument("--robot", default="humanoid")
    parser.add_argument("--doors", choices=("open", "shut"), default="open")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--seconds", type=float, default=float("inf"), help="wall time of an episode")
    add_conditions(parser)
    parser.add_argument("--record", type=pathlib.Path, metavar="FOLDER", help="of recordings of episodes in physics")
    parser.add_argument("--child", action="store_true", help="end with the process that started this one")
    args = parser.parse_args()
    if args.child:
        end_with_parent()
    warnings.simplefilter("ignore")
    problem = problem_of(args.activity, home=home_of(args.activity, args.home))
    if not args.starts:
        sample(problem, args.split, args.count)
        return
    solve_starts(problem, args)


def add_conditions(parser: argparse.ArgumentParser) -> None:
    """Conditions in which rows may differ from the main ones (`DEFAULTS`)."""
    parser.add_argument("--agent", choices=AGENTS, default=DEFAULTS["agent"], help="what chooses and plans primitives")
    parser.add_argument("--home", default=DEFAULTS["home"], help="a home, or other: another that it fits")
    parser.add_argument("--grasping", choices=("assisted", "physical", "sticky"), default=DEFAULTS["grasping"])
    parser.add_argument("--moved", choices=("none", "once"), default=DEFAULTS["moved"], help=MOVED)


def home_of(activity: str, home: str) -> str | None:
    """The home of a row; None: the activity's own. Raises Ig2mjError: the activity fits in no other."""
    if home != "other":
        return home or None
    own = bddl_task(activity).home
    bound, _ = fitting(load_activity(activity), [load_manifest(scene_folder(name)) for name in shipped_homes()])
    others = [b.home for b in bound if b.home != own]
    if not others:
        raise Ig2mjError(f"{activity} fits in no other home")
    return others[0]


def sample(problem: Problem, split: str, count: int) -> None:
    """Samples start states, and reports how many there are each time that some more are kept."""
    for expected in [*range(SAMPLED_TOGETHER, count, SAMPLED_TOGETHER), count]:
        pool = problem.pool(split, expected)
        size = count if pool is None else pool.size
        report(event="pool", size=min(size, count), home=problem.scene.name)
        if size < expected:
            return


def solve_starts(problem: Problem, args: argparse.Namespace) -> None:
    """Solves the starts one after another. An error of one is its result."""
    planner = TaskPlanner(Domain.of_robot(problem.model, make_robot(args.robot)), problem.goal)
    planner = planner_of(args.agent, planner, problem, args.seed)
    left, args.moved_objects = list(args.starts), {}
    while left:
        began = time.process_time()
        try:
            with settings_of(args.agent):
                for number, result in episodes(problem, planner, tuple(left), args):
                    left.remove(number)
                    spent = round(time.process_time() - began, 2)
                    row = row_of(result) | (
                        {"moved": args.moved_objects.get(number, "")} if args.moved == "once" else {}
                    )
                    report(event="row", start=number, home=problem.scene.name, processor=spent, result=row)
                    began = time.process_time()
            return  # starts that are left have no row of the pool
        except (Exception, MemoryError) as e:
            why = " ".join(str(e).split()) if isinstance(e, Ig2mjError) else f"{type(e).__name__}: {e}"
            traceback.print_exc()
            report(event="failed", start=left.pop(0), home=problem.scene.name, why=why)


def episodes(
    problem: Problem, planner: TaskPlanner, numbers: Sequence[int], args: argparse.Namespace
) -> Iterator[tuple[int, EpisodeResult]]:
    """Solves starts; their numbers and results."""
    at = numbers[0]

    somebody: SomebodyElse | None = None

    def watch(world: int, plan: TaskPlan, records: Sequence[StepRecord]) -> None:
        report(event="step", start=at, step=str(plan.steps[0]) if plan.steps else "")
        if somebody is not None and (moved := somebody.see(plan, records)):
            report(event="step", start=at, step=moved)
            args.moved_objects[at] = somebody.moved

    if args.rung == "symbolic":
        pool = problem.pool(args.split, max(args.count, max(numbers) + 1))
        for at, rung in symbolic_episodes(planner.domain, problem.scene, pool, numbers, args.seed):
            report(event="begin", start=at)
            yield at, solve(planner, rung, seconds=args.seconds, watch=watch)[0]
        return
    if args.rung == "kinematic":
        pool = problem.pool(args.split, max(args.count, max(numbers) + 1))
        start = (planner.domain, problem, pool, numbers, args.robot, args.seed, args.doors == "open")
        for at, rung in kinematic_episodes(*start):
            report(event="begin", start=at)
            yield at, solve(planner, rung, seconds=args.seconds, watch=watch)[0]
        return

    def begun(numbers: Sequence[int], rung: PhysicsRung) -> None:
        nonlocal at, somebody
        at = numbers[0]
        somebody = SomebodyElse(found.stage, rung, args.seed) if args.moved == "once" else None
        report(event="begin", start=at)

    options = {"robot": args.robot, "split": args.split, "seed": args.seed, "doors_open": args.doors == "open"}
    options |= {"grasping": args.grasping, "record": recording_of(args, numbers)}
    with Episodes(problem, planner, numbers, **options) as found:
        yield from found.solve(seconds=args.seconds, watch=watch, begun=begun)


def recording_of(args: argparse.Namespace, numbers: Sequence[int]) -> pathlib.Path | None:
    """File of a recording of starts, named by the activity, and by the first of them where that is not 0; None: they
    are not recorded."""
    first = f"_{numbers[0]}" if numbers[0] else ""
    return args.record and args.record / f"{args.activity}{first}.h5"


if __name__ == "__main__":
    main()
