"""Filling a container: its opening is held upright below a tap that runs, until it is filled with water."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from ig2mj.geometry.host_rotations import turn_onto
from ig2mj.geometry.poses import matrices_on_host
from ig2mj.knowledge.substances import WATER
from ig2mj.planning.holding import Hold, hold_at, wait_until
from ig2mj.planning.moves import UP, Primitive, carry, hand_with, travel
from ig2mj.planning.placing import regrasp
from ig2mj.planning.steps import Outcome, Step
from ig2mj.planning.taps import MOST_MOVED, clear_basin, source_of
from ig2mj.planning.world import PlannedWorld, Vector
from ig2mj.sampling.conditions import Condition
from ig2mj.states.substances.model import of
from ig2mj.states.substances.volume import FILLED, TAP_RATE

BELOW_SOURCE = (0.03, 0.06, 0.1, 0.15)
"""m below a source of water at which the middle of an opening is held."""

OFF_CENTRE = 0.5
"""Share of the way from the middle of an opening to its rim at which water may fall in, too."""

FILLS, SPARE = 3, 2.0
"""Ways of holding a container that are tried; s for which water runs longer than filling it takes."""


def fill(world: PlannedWorld, step: Step) -> Primitive:
    """Holds the container upright below the tap."""
    name, tap = step.arguments
    if reason := world.domain.impossible(Condition("filled", (name, WATER))):
        return Outcome("not_true_after", reason)
    hand, source = hand_with(world, name), source_of(world, tap)
    seconds = FILLED * _litres(world, name) / TAP_RATE + SPARE
    reason, failed, again, moved = "", set[int](), False, set[str]()
    for _ in range(FILLS + MOST_MOVED):
        left = lambda hand=hand: [h for h in _upright(world, name, hand, source) if h.number not in failed]  # noqa: E731
        reason, way, number = yield from hold_at(world, name, hand, left)
        if number < 0 and (yield from clear_basin(world, source, moved)) and name in world.held:
            continue
        if number < 0 and not again and (yield from regrasp(world, name, hand)):  # by another side
            again, hand = True, hand_with(world, name)
            continue
        if number < 0:
            return Outcome(reason, f"the hand has no way with {name} below {tap}")
        reason = reason or (yield from wait_until(world, ("filled", name, WATER), seconds, world.index(name)))
        yield [*travel(hand, way[-2::-1], None), carry(world, hand)]
        if world.facts.holds("filled", name, WATER):
            return Outcome()
        failed.add(number)
        if name not in world.held:
            return Outcome("slipped", f"the hand lost {name}")
    return Outcome(reason or "not_true_after", f"{name} did not take enough water")


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
