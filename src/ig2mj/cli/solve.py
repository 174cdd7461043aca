"""`ig2mj solve ACTIVITY|SCENE [GOAL]`: plans and carries out plans, and reports how often the goal is reached."""

from __future__ import annotations

import pathlib
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Annotated, Any, Literal

import tyro

from ig2mj.cli.common.objects import AddedObjects
from ig2mj.cli.common.planning import Goal, What

if TYPE_CHECKING:
    from ig2mj.cli.common.solving import StepTable
    from ig2mj.planning.physics import PhysicsRung
    from ig2mj.planning.problem import Problem
    from ig2mj.planning.solver import EpisodeResult
    from ig2mj.planning.task_planner import TaskPlanner


def run(
    what: What,
    goal: Goal = None,
    robot: str = "humanoid",
    episodes: int = 1,
    worlds: int = 1,
    rung: Literal["symbolic", "kinematic", "physics"] = "physics",
    doors: Literal["open", "shut"] = "open",
    split: str = "held_out",
    seed: int = 0,
    seconds: float = float("inf"),
    object: AddedObjects = (),
    script: Annotated[pathlib.Path | None, tyro.conf.arg(metavar="FILE")] = None,
    out: Annotated[pathlib.Path | None, tyro.conf.arg(metavar="FILE")] = None,
    record: Annotated[pathlib.Path | None, tyro.conf.arg(metavar="FILE")] = None,
    video: Annotated[pathlib.Path | None, tyro.conf.arg(metavar="FILE")] = None,
    json: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False,
) -> int:
    """Reach a goal: plan, carry out the first step, plan again, until the goal holds.

    The exit status is 0 if the goal holds at the end of every episode.

    Args:
      what: an activity (`ig2mj activity list`), or the name or folder of a home.
      goal: an expression, such as "(inside apple_0 fridge_0)", or plain words, such as "put the apple into the
        fridge and close it"; an activity has its own.
      robot: which robot acts.
      episodes: number of start states, each solved once.
      worlds: number of episodes that are solved side by side, in physics.
      rung: physics: the robot acts; kinematic: its motion is planned and checked, and states are set; symbolic: states
        are set without motion.
      doors: whether doors between rooms that the goal does not name stand open at the start, but for the symbolic rung.
      split: start states of the activity: train or held_out.
      seed: of what is sampled; the same seed gives the same result.
      seconds: wall time of an episode after which it ends.
      object: with a home: {object}.
      script: with a home, in place of a goal: a JSON array of requests, such as
        [{"name": "grasp", "arguments": {"object": "apple_0"}}], which the robot carries out in order, in physics, until
        one fails.
      out: file of results, one line of JSON for each episode; episodes that it holds already are not repeated.
      record: HDF5 file to record the episodes to, in physics; successful ones are demonstrations (`ig2mj demos`).
      video: video of the episodes (.mp4, .gif, .webp), or five of its images (.png, .jpg), in physics; of the first
        world. Needs OpenGL.
      json: print one line of JSON at the end instead of a table.
    """
    import json as json_module
    import sys
    import time

    from ig2mj.cli.common.files import check_output, check_video
    from ig2mj.cli.common.objects import note_changes
    from ig2mj.cli.common.planning import domain_of, expression_of
    from ig2mj.cli.common.solving import StepTable, print_figures, print_result
    from ig2mj.errors import Ig2mjError, UnknownNameError
    from ig2mj.install_hint import require_module
    from ig2mj.planning.problem import problem_of
    from ig2mj.planning.results import ResultFile
    from ig2mj.planning.solver import summary
    from ig2mj.planning.task_planner import TaskPlanner
    from ig2mj.tasks.pools import SEEDS

    if script is not None:
        if goal is not None or record or video or out or rung != "physics" or max(episodes, worlds) > 1:
            raise Ig2mjError("--script takes a home, --robot, --seed, --object and --json alone")
        from ig2mj.cli.common.scripts import run_script

        return run_script(what, script, robot, seed, object, json)
    if episodes < 1:
        raise Ig2mjError(f"--episodes {episodes}: at least one is needed")
    if not seconds > 0:
        raise Ig2mjError(f"--seconds {seconds:g}: must be above 0")
    if worlds < 1:
        raise Ig2mjError(f"--worlds {worlds}: at least one is needed")
    if split not in SEEDS:
        raise UnknownNameError("split", split, SEEDS)
    if (record or video) and rung != "physics":
        raise Ig2mjError("--record and --video are of a robot that acts: use --rung physics")
    for file in (out, record):
        if file is not None:
            check_output(file)
    if video is not None:
        check_video(video, STRIPS)
    if record is not None:
        require_module("h5py")
    began = time.monotonic()
    goal = expression_of(what, goal, object, robot)
    problem = problem_of(what, goal, object)
    note_changes(problem.scene, object)
    domain = domain_of(problem, robot)
    planner = TaskPlanner(domain, problem.goal)
    conditions = {"problem": problem.name, "goal": goal, "robot": robot, "rung": rung, "split": split, "seed": seed}
    conditions |= {"doors": doors} if rung != "symbolic" else {}
    results = ResultFile(out, conditions)
    missing = [n for n in range(episodes) if n not in results.kept]
    if record is not None and len(missing) < episodes:
        print(f"{out} holds {episodes - len(missing)} of the episodes: {record} gets the others", file=sys.stderr)
    options = {"robot": robot, "worlds": worlds, "split": split, "seed": seed, "doors_open": doors == "open"}
    try:
        with StepTable(problem.name) as table:
            common = (problem, planner, missing, options, table, seconds)
            solved = _physical(*common, record, video) if rung == "physics" else _set(*common, rung == "kinematic")
            for number, result in solved:
                results.add(number, result)
    except KeyboardInterrupt:
        kept = [f"{file} holds what was done" for file in (out, record) if file is not None and file.exists()]
        print("; ".join([f"{len(results.kept)} of {episodes} episodes are done", *kept]), file=sys.stderr)
        raise
    numbers = [n for n in sorted(results.kept) if n < episodes]
    found = [results.kept[n] for n in numbers]
    if not found:
        raise Ig2mjError(f"{problem.name}: no start state could be sampled")
    if len(found) < episodes:
        print(f"{len(found)} of {episodes} {split} start states could be sampled", file=sys.stderr)
    figures = summary(found, time.monotonic() - began)
    if json:
        print(json_module.dumps(figures))
        return 0 if figures["success_rate"] == 1.0 else 1
    print_result(f"{problem.name} in {problem.scene.name}, episode {numbers[-1]}", found[-1])
    print_figures(figures, found)
    return 0 if figures["success_rate"] == 1.0 else 1


STRIPS = (".png", ".jpg")
"""Endings of files that get a few images of a video side by side."""


def _set(
    problem: Problem,
    planner: TaskPlanner,
    numbers: Sequence[int],
    options: dict[str, Any],
    table: StepTable,
    seconds: float,
    kinematic: bool,
) -> Iterator[tuple[int, EpisodeResult]]:
    """Episodes in which states are set. `options`: of `ig2mj.demos.solving.Episodes`. kinematic: motion is planned."""
    from ig2mj.planning.kinematic import kinematic_episodes
    from ig2mj.planning.solver import solve
    from ig2mj.planning.symbolic import symbolic_episodes

    pool = problem.pool(options["split"], max([0, *numbers]) + 1)
    if kinematic:
        robot = {name: options[name] for name in ("robot", "seed", "doors_open")}
        episodes = kinematic_episodes(planner.domain, problem, pool, numbers, **robot)
    else:
        episodes = symbolic_episodes(planner.domain, problem.scene, pool, numbers, options["seed"])
    for number, rung in episodes:
        table.begin([number])
        yield number, solve(planner, rung, seconds=seconds, watch=table.watch)[0]


def _physical(
    problem: Problem,
    planner: TaskPlanner,
    numbers: Sequence[int],
    options: dict[str, Any],
    table: StepTable,
    seconds: float,
    record: pathlib.Path | None,
    video: pathlib.Path | None,
) -> Iterator[tuple[int, EpisodeResult]]:
    """Episodes in which a robot acts."""
    import contextlib

    from ig2mj.demos.solving import Episodes

    with contextlib.ExitStack() as files:
        episodes = files.enter_context(Episodes(problem, planner, numbers, record=record, **options))
        if not episodes.numbers:
            return
        film = None
        if video is not None:
            from ig2mj.showcase.plan_video import PlanVideo

            film = PlanVideo(video, episodes.env)
            files.callback(film.close)

        def begun(numbers: Sequence[int], rung: PhysicsRung) -> None:
            table.begin(numbers, rung)

            def after_step() -> None:
                table.tick()
                if film is not None:
                    step = rung.running(0)
                    names = () if step is None else step.arguments
                    objects = [problem.scene.object_index(n) for n in names if n in problem.scene.object_names]
                    film.see(episodes.stage.state, "" if step is None else str(step), objects)

            rung.watch = after_step

        yield from episodes.solve(seconds=seconds, watch=table.watch, begun=begun)
