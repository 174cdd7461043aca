"""Switching things on and off: a finger at the button."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable, Iterator

import numpy as np

from ig2mj.planning.clearance import Obstacles, straight
from ig2mj.planning.driving import go
from ig2mj.planning.grasping import FINGER, button_of
from ig2mj.planning.moves import (
    ATTEMPTS,
    DOWN,
    UP,
    Primitive,
    first_way,
    free_hand,
    from_home,
    hand_path,
    rest,
    towards,
    travel,
    vector3,
)
from ig2mj.planning.phases import Phase, Until
from ig2mj.planning.stances import ALL_AROUND, stances
from ig2mj.planning.steps import Outcome, Step
from ig2mj.planning.world import AWAY, PlannedWorld, Stance, Vector

NEAR_BUTTON = 0.13
"""m before a button at which a hand comes to it."""

PRESSING = 0.07
"""m from a button within which a finger holds it down for sure, whatever is in the way of coming nearer."""

LOWER = 0.035
"""m below a button that a hand stays which comes to it under what stands out above it, such as a lamp's shade."""

TIPS = 0.03
"""m from a gripper's grasp point to the tips of its fingers, which come to a button where it does not point down."""

SLOPES = (0.46, 0.79, 0.0)
"""rad below the horizontal that a gripper on an arm points where it has no way to a button pointing down: so an arm
reaches less far."""

STANCES = 12
"""That are tried, of `ALL_AROUND` that are looked at for those on the button's side of the object."""


@dataclasses.dataclass(frozen=True, eq=False)
class Pressing:
    """How a hand presses a button.

    Attributes:
      aim, at: the hand's grasp point before, and while it presses, m. fingers, palm: as `HandedBody.turned` takes them.
    """

    aim: Vector
    at: Vector
    fingers: Vector
    palm: Vector


def pressings(button: Vector, front: Vector, slope: float | None = None) -> list[tuple[Pressing, float]]:
    """Ways of pressing a button, each with m below it that the fingers are.

    Args:
      front: the horizontal direction from the robot to the button. slope: rad below the horizontal that a gripper
        points; None: a hand's palm points down, and one finger is at the button.
    """
    if slope is not None:
        palm = np.cos(slope) * front - np.sin(slope) * UP
        at, across = button - TIPS * palm, np.cross(UP, front)
        return [(Pressing(at + NEAR_BUTTON * back, at, across, palm), 0.0) for back in (-palm, UP)]
    at = button - FINGER * front
    low = at - LOWER * UP
    found = [(at - NEAR_BUTTON * front, at, 0.0), (at + NEAR_BUTTON * UP, at, 0.0)]
    found.append((low - NEAR_BUTTON * front, low, LOWER))
    return [(Pressing(aim, there, front, DOWN), lower) for aim, there, lower in found]


def toggle(value: bool) -> Callable[[PlannedWorld, Step], Primitive]:
    """The primitive that switches on, or off."""

    def toggle(world: PlannedWorld, step: Step) -> Primitive:
        name, reason, detail = step.object, "no_base", ""
        if button_of(world, name) is None:
            return Outcome("no_grasp", f"{name} has no button")
        for attempt in range(ATTEMPTS):
            if world.facts.holds("toggled_on", name) == value:
                return Outcome(attempts=max(attempt, 1))
            button = button_of(world, name)
            assert button is not None
            hand = free_hand(world, attempt)
            found = _plan(world, button, hand, attempt, world.stance if name in world.held else None)
            if found is None:
                reason, detail = "no_base", f"no free floor from which a hand reaches the button of {name}"
                continue
            stance, number, slope = found
            if reason := (yield from go(world, stance)):
                continue
            planned, _ = pressings(button, towards(stance.xy, button), slope)[number]
            pressing, _ = pressings(button, towards(world.base[0], button), slope)[number]
            pressing = dataclasses.replace(pressing, aim=planned.aim)  # which is known to have room
            quat = world.body.turned(hand, pressing.fingers, pressing.palm)
            way = yield from from_home(world, hand, functools.partial(_way, world, hand, pressing))
            if way is None:
                reason, detail = "no_path", f"the hand has no path to the button of {name}"
                continue
            reason = yield [
                *travel(hand, way, quat),
                Phase(hand=hand, pos=vector3(pressing.at), quat=quat, until=Until.WAITED, limit=5, speed=0.03),
                *travel(hand, way[::-1], None),
                *rest(hand),
            ]
            detail = f"the fingers were not at the button of {name} for long enough"
        if world.facts.holds("toggled_on", name) == value:
            return Outcome(attempts=ATTEMPTS)
        return Outcome(reason or "not_true_after", detail, attempts=ATTEMPTS)

    return toggle


def _way(
    world: PlannedWorld,
    hand: int,
    pressing: Pressing,
    obstacles: Obstacles | None = None,
    stance: Stance | None = None,
    search: bool = True,
) -> list[Vector] | None:
    """The way of a hand to before a button, from where the robot stands, or from a stance with its hand at rest; None:
    there is none."""
    obstacles, spheres = obstacles or world.obstacles(), world.spheres(pressing.fingers, pressing.palm)
    quat = world.body.turned(hand, pressing.fingers, pressing.palm)
    follows = world.follows(hand, quat, obstacles, stance)
    start = world.grip(hand) if stance is None else world.resting(hand, stance)
    front = pressing.fingers if pressing.palm is DOWN else pressing.palm
    return hand_path(obstacles, spheres, start, pressing.aim, [UP, -front], search=search, follows=follows)


def _plan(
    world: PlannedWorld, button: Vector, hand: int, attempt: int, at: Stance | None
) -> tuple[Stance, int, float | None] | None:
    """A stance, the number of one of `pressings`, and the slope of the gripper. Those come first in which nothing is in
    the fingers' way up to the button: it is on a side of the object.

    Args:
      at: where the robot stays, since a hand holds what is switched; None: it may go anywhere.
    """
    obstacles, floor, passed = world.obstacles(), world.floor(), 0

    def candidates(slope: float | None) -> Iterator[tuple[Stance, int]]:
        blocked, free = list[tuple[Stance, int]](), 0
        for stance in stances(world, hand, button, floor, AWAY, most=ALL_AROUND) if at is None else [at]:
            for number, pressing in enumerate(pressings(button, towards(stance.xy, button), slope)):
                if not is_blocked(*pressing):
                    free += 1
                    yield stance, number
                elif len(blocked) < 3 * STANCES:
                    blocked.append((stance, number))
            if free >= 3 * STANCES:
                return
        yield from blocked

    def is_blocked(pressing: Pressing, lower: float) -> bool:
        spheres = world.spheres(pressing.fingers, pressing.palm)
        return not straight(obstacles, spheres, pressing.aim, pressing.at, PRESSING - lower)

    def has_way(slope: float | None, candidate: tuple[Stance, int], search: bool) -> bool:
        nonlocal passed
        stance, number = candidate
        pressing, _ = pressings(button, towards(stance.xy, button), slope)[number]
        found = _way(world, hand, pressing, obstacles, stance, search) is not None
        passed += found
        return found and passed > attempt

    for slope in (None,) if world.body.opening is None else (None, *SLOPES):
        found = first_way(candidates(slope), functools.partial(has_way, slope), 3 * STANCES)
        if found is not None:
            return *found, slope
    return None
