"""`goal_task`: a goal in a home as a task, by the name "goal/HOME GOAL".

    env = ig2mj.make("goal/small_home (inside apple_0 fridge_0)", robot="humanoid")

The household starts as its scene says, with what is added to it (`objects=`). The robot starts on free floor near what
the goal names, and an action has every number of its controller.
"""

from __future__ import annotations

import os
import re

from ig2mj.predicates import logic
from ig2mj.predicates.literals import names_of_objects
from ig2mj.predicates.parse import parse
from ig2mj.scene.paths import scene_folder
from ig2mj.tasks.task import Acts, Task, Weights

PREFIX = "goal/"

HORIZON = 1000
"""Agent steps: 100 s, as of BEHAVIOR's activities."""

_NAME = re.compile(rf"{PREFIX}(?P<home>[^()]*[^()\s])\s+(?P<goal>\(.*\))", re.DOTALL)


def split_goal_name(name: str) -> tuple[str, str] | None:
    """Home and goal of "goal/small_home (open fridge_0)"; None of other names."""
    match = _NAME.fullmatch(name)
    return None if match is None else (match["home"], match["goal"])


def goal_task(home: str | os.PathLike, goal: str) -> Task:
    """The task of a goal.

    Args:
      home: a home that ships, or a folder of a scene. goal: expression.

    Raises:
      InputError: there is no such home. ExpressionError: the goal is not an expression.
    """
    scene_folder(home)
    goal = " ".join(goal.split())
    acts = Acts(None, hands=(0, 1), weights=Weights(share=True))
    return Task(
        name=f"{PREFIX}{os.fspath(home)} {goal}",
        summary=f"Reach {goal}.",
        home=os.fspath(home),
        objects=(),
        start=(),
        near=(),
        goal=goal,
        objects_of_interest=tuple(names_of_objects(logic.atoms(parse(goal)))),
        distances=(),
        robots={"humanoid": acts},
        horizon=HORIZON,
        grasping="assisted",
        whole_actions=True,
    )
