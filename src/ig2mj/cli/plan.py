"""`ig2mj plan ACTIVITY|SCENE [GOAL]`: the steps with which a robot reaches a goal, without carrying them out.

`ig2mj plan --benchmark`: how often each primitive succeeds.
"""

from __future__ import annotations

import pathlib
from typing import Annotated, Literal

import tyro

from ig2mj.cli.common.objects import AddedObjects
from ig2mj.cli.common.planning import Goal, WhatIfAny


def run(
    what: WhatIfAny = None,
    goal: Goal = None,
    robot: str = "humanoid",
    split: str = "held_out",
    row: int = 0,
    object: AddedObjects = (),
    pddl: Annotated[pathlib.Path | None, tyro.conf.arg(metavar="FOLDER")] = None,
    json: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False,
    benchmark: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False,
    rung: Literal["symbolic", "kinematic", "physics"] = "physics",
    requests: int = 200,
    primitives: tuple[str, ...] = (),
    numbers: tuple[int, ...] = (),
    seed: int = 0,
    jobs: int = 1,
    seconds: float = 600.0,
    out: Annotated[pathlib.Path | None, tyro.conf.arg(metavar="FILE")] = None,
) -> int:
    """Print the steps that reach a goal from a start state; or measure how often each primitive succeeds.

    The exit status is 0 if there is a plan, or nothing is left to do; with --benchmark, if all requests were measured.

    Args:
      what: an activity (`ig2mj activity list`), or the name or folder of a home.
      goal: an expression, such as "(inside apple_0 fridge_0)", or plain words, such as "put the apple into the
        fridge and close it"; an activity has its own.
      robot: which robot is to act: it has as many free hands.
      split: start states of the activity: train or held_out.
      row: number of the start state.
      object: with a home: {object}.
      pddl: also write domain.pddl and problem.pddl to this folder, for planners that read PDDL.
      json: print JSON instead of a table.
      benchmark: draw requests to each primitive in all homes that ship, and carry them out. Requests that have no
        solution are not left out; their share is reported. The options below are for it.
      rung: what carries them out (docs/guide/planning.md).
      requests: number for each primitive.
      primitives: only these.
      numbers: only these requests to each primitive, from 0, in place of the first --requests.
      seed: of the requests.
      jobs: processes; 0: one per processor.
      seconds: wall time of a request, after which it counts as failed.
      out: file of results, one line of JSON for each request; requests that it holds already are not repeated.
    """
    if benchmark:
        from ig2mj.cli.common.plan_benchmark import benchmark as measured
        from ig2mj.errors import Ig2mjError

        if what is not None or goal is not None or object or pddl is not None:
            raise Ig2mjError("--benchmark draws its own requests: leave out activity, home, goal, --object and --pddl")
        return measured(rung, robot, numbers or range(requests), primitives, seed, jobs, seconds, out, json)
    if what is None:
        from ig2mj.errors import Ig2mjError

        raise Ig2mjError("name an activity (ig2mj activity list), or a home and a goal; or measure with --benchmark")
    from ig2mj.cli.common.objects import note_changes
    from ig2mj.cli.common.planning import check_row, domain_of, expression_of
    from ig2mj.cli.common.printing import make_table, print_json, stdout_console
    from ig2mj.planning.pddl import write_pddl
    from ig2mj.planning.problem import problem_of
    from ig2mj.planning.symbolic import start_facts
    from ig2mj.planning.task_planner import TaskPlanner

    check_row(row)
    goal = expression_of(what, goal, object, robot)
    problem = problem_of(what, goal, object)
    note_changes(problem.scene, object)
    domain = domain_of(problem, robot)
    planner = TaskPlanner(domain, problem.goal)
    facts = start_facts(domain, problem.scene, problem.pool(split, row + 1), row)
    plan = planner.plan(facts)
    if pddl is not None:
        write_pddl(pddl, problem.name, facts, plan)
    if json:
        print_json(
            {
                "problem": problem.name,
                "home": problem.scene.name,
                "steps": [
                    {"primitive": s.primitive, "arguments": s.arguments, "for": str(s.serves)} for s in plan.steps
                ],
                "missing": [*map(str, plan.missing)],
                "holds": plan.done,
            }
        )
        return 0
    if plan.done:
        print("the goal holds already")
        return 0
    rows = [(k + 1, s.primitive, " ".join(s.arguments), str(s.serves)) for k, s in enumerate(plan.steps)]
    title = f"{problem.name} in {problem.scene.name}: steps for {len(plan.missing)} of the goal's conditions"
    console = stdout_console()
    console.print(make_table(title, (">", "primitive", "arguments", "?for"), rows, console.width))
    return 0
