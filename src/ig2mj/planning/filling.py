"""Filling a container: its opening is held upright below a tap that runs, until it is filled with water."""

from __future__ import annotations

import functools

import numpy as np

from ig2mj.geometry.host_rotations import turn_onto
from ig2mj.knowledge.substances import WATER
from ig2mj.planning.grasping import grasp
from ig2mj.planning.holding import Hold
from ig2mj.planning.moves import UP, Primitive, hand_with
from ig2mj.planning.openings import opening_of
from ig2mj.planning.placing import bring_out
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
    """Holds the container upright below the tap; loose things in it are taken out first."""
    name, tap = step.arguments
    if reason := world.domain.impossible(Condition("filled", (name, WATER))):
        return Outcome("not_true_after", reason)
    hand_with(world, name)
    emptied = yield from _emptied(world, name)
    if not emptied.done:
        return emptied
    seconds = FILLED * world.domain.litres(name) / TAP_RATE + SPARE
    ways = functools.partial(_upright, world, name)
    return (yield from hold_below_tap(world, name, tap, ways, ("filled", name, WATER), seconds))


def _emptied(world: PlannedWorld, name: str) -> Primitive:
    """Puts a container down where there is something in it, takes that out, and takes it again."""
    things = world.facts.things_in(name)
    if not things:
        return Outcome()
    for thing in (name, *things):  # what is in it may have fallen out on the way
        if thing != name and thing not in world.facts.things_in(name):
            continue
        out = yield from bring_out(world, thing)
        if not out.done:
            return Outcome(out.reason, f"{', '.join(things)} cannot be taken out of {name}: {out.detail}")
    return (yield from grasp(world, Step("grasp", (name,))))


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
