"""Filling a container: its opening is held upright below a tap that runs, until it is filled with water."""

from __future__ import annotations

import functools

import numpy as np

from ig2mj.geometry.host_rotations import turn_onto
from ig2mj.knowledge.substances import WATER
from ig2mj.planning.holding import Hold
from ig2mj.planning.moves import UP, Primitive
from ig2mj.planning.openings import opening_of
from ig2mj.planning.steps import Outcome, Step
from ig2mj.planning.taps import hold_below_tap
from ig2mj.planning.world import PlannedWorld, Vector
from ig2mj.sampling.conditions import Condition
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
    seconds = FILLED * world.domain.litres(name) / TAP_RATE + SPARE
    ways = functools.partial(_upright, world, name)
    return (yield from hold_below_tap(world, name, tap, ways, ("filled", name, WATER), seconds))


def _upright(world: PlannedWorld, name: str, hand: int, source: Vector) -> list[Hold]:
    """A held container below a source of water with its opening up: first the middle of that, then places off it."""
    grip, opening = world.grip(hand), opening_of(world, name)
    tilt = turn_onto(opening.normal, UP)
    corners, centre = np.unique(opening.rim, axis=0), opening.centre
    places = [centre, *(centre + OFF_CENTRE * (corners - centre))]
    return [
        Hold(source - below * UP, tilt @ (grip - place), tilt, number)
        for number, place in enumerate(places)
        for below in BELOW_SOURCE
    ]
