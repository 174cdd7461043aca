"""`ig2mj solve ACTIVITY|SCENE [GOAL]`: plans and carries out plans, and reports how often the goal is reached."""

from __future__ import annotations

import pathlib
from typing import Annotated, Literal

import tyro

from ig2mj.cli.common.objects import AddedObjects
from ig2mj.cli.common.planning import Goal, What


def run(
    what: What,
    goal: Goal = None,
    robot: str = "humanoid",
    episodes: int = 1,
    worlds: int = 1,
    rung: Literal["symbolic", "physics"] = "physics",
    doors: Literal["open", "shut"] = "open",
    split: str = "held_out",
    seed: int = 0,
    seconds: float = float("inf"),
    object: AddedObjects = (),
    out: Annotated[pathlib.Path | None, tyro.conf.arg(metavar="FILE")] = None,
    record: Annotated[pathlib.Path | None, tyro.conf.arg(metavar="FILE")] = None,
    video: Annotated[pathlib.Path | None, tyro.conf.arg(metavar="FILE")] = None,
    json: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False,
) -> int:
    """Reach a goal: plan, carry out the first step, plan again, until the goal holds.

    The exit status is 0 if the goal holds at the end of every episode.

    Args:
      what: an activity (`ig2mj activity list`), or the name or folder of a home.
      goal: an expression, such as "(inside apple_0 fridge_0)"; an activity has its own.
      robot: which robot acts.
      episodes: number of start states, each solved once.
      worlds: episodes that are solved side by side, in physics.
      rung: physics: the robot acts; symbolic: states are set instead.
      doors: whether doors between rooms that the goal does not name stand open at the start, in physics.
      split: start states of the activity: train or held_out.
      seed: of what is sampled; the same seed gives the same result.
      seconds: wall time of an episode after which it ends.
      object: with a home: {object}.
      out: file of results, one line of JSON for each episode; episodes that it holds already are not repeated.
      record: write the episodes as a recording, which replays; with one world.
      video: write a video (.mp4 or .gif) of the episodes; with one world.
      json: print one line of JSON at the end instead of a table.
    """
    import json as json_module
    import time

    from ig2mj.cli.common.files import check_output, check_video
    from ig2mj.cli.common.objects import note_changes
    from ig2mj.cli.common.planning import domain_of
    from ig2mj.cli.common.solving import Options, StepTable, print_figures, print_result, solved
    from ig2mj.errors import Ig2mjError
    from ig2mj.planning.problem import problem_of
    from ig2mj.planning.results import ResultFile
    from ig2mj.planning.solver import summary
    from ig2mj.planning.task_planner import TaskPlanner

    if episodes < 1:
        raise Ig2mjError(f"--episodes {episodes}: at least one is needed")
    if not seconds > 0:
        raise Ig2mjError(f"--seconds {seconds:g}: must be above 0")
    if worlds < 1:
        raise Ig2mjError(f"--worlds {worlds}: at least one is needed")
    if (record or video) and (worlds > 1 or rung == "symbolic"):
        raise Ig2mjError("--record and --video need --rung physics and --worlds 1")
    for file in (out, record):
        if file is not None:
            check_output(file)
    if video is not None:
        check_video(video)
    began = time.monotonic()
    problem = problem_of(what, goal, object)
    note_changes(problem.scene, object)
    domain = domain_of(problem, robot)
    planner = TaskPlanner(domain, problem.goal)
    conditions = {"problem": problem.name, "goal": goal, "robot": robot, "rung": rung, "split": split, "seed": seed}
    conditions |= {"doors": doors} if rung == "physics" else {}
    results = ResultFile(out, conditions)
    wanted = [n for n in range(episodes) if n not in results.kept]
    if wanted:
        pool = problem.pool(split, episodes)
        options = Options(robot, worlds, rung == "symbolic", doors == "open", seed, seconds, record, video)
        with StepTable(problem.name, silent=json) as table:
            for number, result in solved(problem, planner, pool, wanted, options, table):
                results.add(number, result)
    found = [results.kept[n] for n in sorted(results.kept) if n < episodes]
    figures = summary(found, time.monotonic() - began)
    if json:
        print(json_module.dumps(figures))
        return 0 if figures["success_rate"] == 1.0 else 1
    print_result(f"{problem.name} in {problem.scene.name}, episode {len(found)} of {episodes}", found[-1])
    print_figures(figures)
    return 0 if figures["success_rate"] == 1.0 else 1
