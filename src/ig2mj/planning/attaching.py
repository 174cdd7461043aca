"""Attaching: what a hand holds is brought to where it touches another object and is attached, and is let go there."""

from __future__ import annotations

from collections.abc import Generator, Iterator, Sequence

import numpy as np
from jaxtyping import Float

from ig2mj.geometry.host_rotations import about_vertical
from ig2mj.geometry.poses import matrices_on_host
from ig2mj.planning.grasping import held_again
from ig2mj.planning.holding import Hold, hold_at
from ig2mj.planning.moves import (
    OPENS,
    RETREAT,
    UP,
    Primitive,
    Program,
    ahead,
    carry,
    go_home_past,
    hand_with,
    travel,
    vector3,
)
from ig2mj.planning.phases import Phase, Until
from ig2mj.planning.steps import Outcome, Step
from ig2mj.planning.world import PlannedWorld, Vector
from ig2mj.states.definitions import attached

GAPS = (0.04, 0.08)
"""m before contact from which a held object comes straight to the other one."""

TURNS = (0.0, np.pi / 2, -np.pi / 2, np.pi)
"""rad about the vertical by which it is turned."""

ADVANCE, BEYOND = 0.01, 0.08
"""m of each step towards the other object, and m beyond the expected contact up to which it goes on."""

TRIES = 4
"""Ways of bringing it there that are tried."""


def attach(world: PlannedWorld, step: Step) -> Primitive:
    """Brings the object to the other one until it is attached, and lets go of it."""
    name, other = step.arguments
    if reason := world.domain.impossible(step.adds[0]):
        return Outcome("not_true_after", reason)
    reason, detail, failed = "no_path", f"the hand has no way with {name} to {other}", set[int]()
    for attempt in range(TRIES):
        if world.facts.holds("attached", name, other) and name not in world.held:
            return Outcome(attempts=max(attempt, 1))
        if not (yield from held_again(world, name)):
            return Outcome("slipped", f"the hand lost {name}", attempts=max(attempt, 1))
        hand = hand_with(world, name)
        left = lambda hand=hand: [h for h in _ways(world, name, other, hand) if h.number not in failed]  # noqa: E731
        reason, way, number = yield from hold_at(world, name, hand, left)
        if name not in world.held:
            continue
        if number < 0:
            break
        failed.add(number)
        reason = yield from _bring(world, step, hand, number)
        detail = f"{name} did not come to where it is attached to {other}"
        if world.facts.holds("attached", name, other):
            yield from _let_go(world, hand, way)
        elif name in world.held:
            yield [*travel(hand, way[::-1], None), carry(world, hand)]
    done = world.facts.holds("attached", name, other)
    return Outcome("" if done else reason or "not_true_after", "" if done else detail, attempts=TRIES)


def _aims(world: PlannedWorld, name: str, other: str) -> Iterator[Vector]:
    """Where on the other object it is attached, m, world frame: its place, or points of the top and the sides."""
    model = world.domain.model
    number = attached.of(model).number_of(world.index(name), world.index(other))
    assert number is not None
    place = attached.of(model).place[number]
    if np.isfinite(place).all():
        pos, quat = world.pose(other)
        yield pos + matrices_on_host(quat[None])[0] @ place
        return
    corners = world.vertices(other)
    middle = (corners.min(0) + corners.max(0)) / 2
    yield np.array([*middle[:2], corners[:, 2].max()])
    yield from world.rim(other)


def _directions(world: PlannedWorld) -> list[Vector]:
    """From which the object comes: from above, from the robot, and from between."""
    back = -ahead(world.base[1])
    return [UP, back, (UP + back) / np.sqrt(2.0)]


def _ways(world: PlannedWorld, name: str, other: str, hand: int) -> list[Hold]:
    """The object's near side right before a place of the other one; numbered by direction and by place."""
    points, found = world.points(name) - world.grip(hand), list[Hold]()
    directions = _directions(world)
    for k, aim in enumerate(_aims(world, name, other)):
        for d, out in enumerate(directions):
            for turn in map(about_vertical, TURNS):
                near = _near(points @ turn.T, out)
                found += [Hold(aim, gap * out - near, turn, len(directions) * k + d) for gap in GAPS]
    return found


def _near(points: Float[np.ndarray, "n 3"], out: Vector) -> Vector:
    """The middle of the side of points that looks away from a direction."""
    middle = (points.min(0) + points.max(0)) / 2
    return middle + (float((points @ out).min()) - float(middle @ out)) * out


def _bring(world: PlannedWorld, step: Step, hand: int, number: int) -> Generator[Program, str, str]:
    """The hand goes on, little by little, until the object is attached; the reason why that failed."""
    name, other = step.arguments
    out = _directions(world)[number % len(_directions(world))]
    start = world.grip(hand)
    for far in np.arange(ADVANCE, GAPS[-1] + BEYOND, ADVANCE):
        pos = vector3(start - far * out)
        reason = yield [
            Phase(hand=hand, pos=pos, keeps=world.index(name), tolerance=0.005, limit=3, after="", speed=ADVANCE)
        ]
        if reason or world.facts.holds("attached", name, other):
            return reason
    return "not_true_after"


def _let_go(world: PlannedWorld, hand: int, way: Sequence[Vector]) -> Generator[Program, str, None]:
    """Opens the hand, and takes it back the way that it came."""
    off = world.grip(hand) - RETREAT * world.hand_axes(hand)[1]
    yield [
        Phase(hand=hand, close=False, until=Until.EMPTY, limit=15),
        Phase(hand=hand, close=False, until=Until.WAITED, limit=OPENS),
        Phase(hand=hand, pos=vector3(off), tolerance=0.04, limit=15, after=""),
    ]
    yield from go_home_past(world, hand, way)
