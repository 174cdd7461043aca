"""What the commands that plan share: arguments, and the robot's hands."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import tyro

from ig2mj.errors import Ig2mjError

if TYPE_CHECKING:
    from ig2mj.planning.domain import Domain
    from ig2mj.planning.problem import Problem

What = Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="ACTIVITY|SCENE")]
WhatIfAny = Annotated[str | None, tyro.conf.Positional, tyro.conf.arg(metavar="ACTIVITY|SCENE")]
Goal = Annotated[str | None, tyro.conf.Positional, tyro.conf.arg(metavar="GOAL")]


def check_row(row: int) -> None:
    """Raises Ig2mjError for a negative number of a start state."""
    if row < 0:
        raise Ig2mjError(f"--row {row}: start states are numbered from 0")


def domain_of(problem: Problem, robot: str) -> Domain:
    """The scene's constants with the hands of a robot. Raises UnknownNameError: no such robot."""
    from ig2mj.agents.registry import make_robot
    from ig2mj.planning.domain import Domain

    return Domain(problem.model, make_robot(robot).hand_count)
