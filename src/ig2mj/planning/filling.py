"""Filling a container: its opening is held upright below a tap that runs, until it is filled with water."""

from __future__ import annotations

import functools

import numpy as np
from jaxtyping import Float

from ig2mj.geometry.host_rotations import turn_onto
from ig2mj.geometry.poses import matrices_on_host
from ig2mj.knowledge.substances import WATER
from ig2mj.planning.holding import Hold
from ig2mj.planning.moves import UP, Primitive
from ig2mj.planning.steps import Outcome, Step
from ig2mj.planning.taps import hold_below_tap
from ig2mj.planning.world import PlannedWorld, Vector
from ig2mj.sampling.conditions import Condition
from ig2mj.states.substances.model import of
from ig2mj.states.substances.volume import FILLED, TAP_RATE

BELOW_SOURCE = (0.03, 0.06, 0.1, 0.15)
"""m below a source of water at which the middle of an opening is held."""

OFF_CENTRE = 0.5
"""Share of the way from the middle of an opening to its rim at which water may fall in, too."""

SPARE = 2.0
"""s for which water runs longer than filling takes."""


def fill(world: PlannedWorld, step: Step) -> Primitive:
    """Holds the container upright below the tap."""
    name, tap = step.arguments
    if reason := world.domain.impossible(Condition("filled", (name, WATER))):
        return Outcome("not_true_after", reason)
    seconds = FILLED * _litres(world, name) / TAP_RATE + SPARE
    ways = functools.partial(_upright, world, name)
    return (yield from hold_below_tap(world, name, tap, ways, ("filled", name, WATER), seconds))


def _row(world: PlannedWorld, name: str) -> int:
    row = of(world.domain.model).containers.row_of(world.index(name))
    assert row is not None, name
    return row


def _litres(world: PlannedWorld, name: str) -> float:
    return float(of(world.domain.model).containers.litres[_row(world, name)])


def _opening(world: PlannedWorld, name: str) -> tuple[Vector, Vector, Float[np.ndarray, "R 3"]]:
    """Middle (m), unit normal that points out, and corners (m) of a container's opening, world frame."""
    containers, row = of(world.domain.model).containers, _row(world, name)
    body = int(containers.body[row])
    turn = matrices_on_host(np.asarray(world.view.body_quat)[world.world, body][None])[0]
    pos = np.asarray(world.view.body_pos)[world.world, body].astype(float)
    return turn @ containers.centre[row] + pos, turn @ containers.normal[row], containers.rim[row] @ turn.T + pos


def _upright(world: PlannedWorld, name: str, hand: int, source: Vector) -> list[Hold]:
    """A held container below a source of water with its opening up: first the middle of that, then places off it."""
    grip, (centre, normal, rim) = world.grip(hand), _opening(world, name)
    tilt = turn_onto(normal, UP)
    corners = np.unique(rim, axis=0)
    places = [centre, *(centre + OFF_CENTRE * (corners - centre))]
    return [
        Hold(source - below * UP, tilt @ (grip - place), tilt, number)
        for number, place in enumerate(places)
        for below in BELOW_SOURCE
    ]
