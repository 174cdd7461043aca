"""What the commands that plan share: arguments, and the robot's hands."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated

import tyro

from ig2mj.errors import Ig2mjError

if TYPE_CHECKING:
    from ig2mj.planning.domain import Domain
    from ig2mj.planning.problem import Problem

What = Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="ACTIVITY|SCENE")]
WhatIfAny = Annotated[str | None, tyro.conf.Positional, tyro.conf.arg(metavar="ACTIVITY|SCENE")]
Goal = Annotated[str | None, tyro.conf.Positional, tyro.conf.arg(metavar="GOAL")]


def expression_of(what: str, goal: str | None, objects: Sequence[str], robot: str) -> str | None:
    """A goal as an expression: plain words are translated, and free choices among objects said on stderr.

    Raises:
      NotUnderstoodError: words have no meaning. PlanningError: what they ask for has no lasting effect.
    """
    from ig2mj.knowledge.substances import WATER
    from ig2mj.planning.problem import problem_of
    from ig2mj.planning.steps import PlanningError
    from ig2mj.planning.symbolic import start_facts
    from ig2mj.planning.words import understand

    if goal is None or goal.lstrip().startswith("("):
        return goal
    problem = problem_of(what, EMPTY, objects, in_use=[WATER])  # words may ask for water before a goal names it
    instruction = understand(goal, start_facts(domain_of(problem, robot), problem.scene, problem.pool(), 0))
    for note in instruction.notes:
        print(note, file=sys.stderr)
    if instruction.goal is None:
        steps = ", ".join(map(str, instruction.steps))
        raise PlanningError(
            f"'{goal}' asks for {steps}, of which something has no effect that lasts: no goal to plan for"
        )
    return instruction.goal


EMPTY = "(and)"
"""An expression that is always true."""


def check_row(row: int) -> None:
    """Raises Ig2mjError for a negative number of a start state."""
    if row < 0:
        raise Ig2mjError(f"--row {row}: start states are numbered from 0")


def domain_of(problem: Problem, robot: str) -> Domain:
    """The scene's constants with the hands of a robot. Raises UnknownNameError: no such robot."""
    from ig2mj.agents.registry import make_robot
    from ig2mj.planning.domain import Domain

    return Domain.of_robot(problem.model, make_robot(robot))
