"""Switching things on and off: a finger at the button."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator

from ig2mj.planning.clearance import straight
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

STANCES = 12
"""That are tried, of `ALL_AROUND` that are looked at for those on the button's side of the object."""


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
            stance, aim, lower = found
            if reason := (yield from go(world, stance)):
                continue
            fingers = towards(world.base[0], button)
            quat = world.body.turned(hand, fingers, DOWN)
            way = yield from from_home(world, hand, functools.partial(_way, world, hand, aim, fingers))
            if way is None:
                reason, detail = "no_path", f"the hand has no path to the button of {name}"
                continue
            at = _pressing(button, fingers, lower)
            reason = yield [
                *travel(hand, way, quat),
                Phase(hand=hand, pos=vector3(at), quat=quat, until=Until.WAITED, limit=5, speed=0.03),
                *travel(hand, way[::-1], None),
                *rest(hand),
            ]
            detail = f"the fingers were not at the button of {name} for long enough"
        if world.facts.holds("toggled_on", name) == value:
            return Outcome(attempts=ATTEMPTS)
        return Outcome(reason or "not_true_after", detail, attempts=ATTEMPTS)

    return toggle


def _way(world: PlannedWorld, hand: int, aim: Vector, fingers: Vector) -> list[Vector] | None:
    """The way of a hand with its palm down to a point, from where the robot stands; None: there is none."""
    obstacles, spheres = world.obstacles(), world.spheres(fingers)
    follows = world.follows(hand, world.body.turned(hand, fingers, DOWN), obstacles)
    return hand_path(obstacles, spheres, world.grip(hand), aim, [UP, -fingers], search=True, follows=follows)


def _pressing(button: Vector, fingers: Vector, lower: float) -> Vector:
    """Grasp point of a hand whose fingers are at a button, or so many m below it."""
    return button - fingers * FINGER - lower * UP


def _plan(
    world: PlannedWorld, point: Vector, hand: int, attempt: int, at: Stance | None
) -> tuple[Stance, Vector, float] | None:
    """A stance, and a point near a button that a hand has a way to; from there the fingers go to so many m below the
    button. Those come first from which nothing is in the fingers' way up to the button: it is on a side of the object.

    Args:
      at: where the robot stays, since a hand holds what is switched; None: it may go anywhere.
    """
    obstacles, floor = world.obstacles(), world.floor()
    passed = 0

    def aims(stance: Stance) -> list[tuple[Stance, Vector, float]]:
        fingers = towards(stance.xy, point)
        near = point - fingers * (NEAR_BUTTON + FINGER)
        over = point + NEAR_BUTTON * UP - fingers * FINGER
        return [(stance, near, 0.0), (stance, over, 0.0), (stance, near - LOWER * UP, LOWER)]

    def candidates() -> Iterator[tuple[Stance, Vector, float]]:
        blocked, free = list[tuple[Stance, Vector, float]](), 0
        for stance in stances(world, hand, point, floor, AWAY, most=ALL_AROUND) if at is None else [at]:
            for candidate in aims(stance):
                if not is_blocked(candidate):
                    free += 1
                    yield candidate
                elif len(blocked) < 3 * STANCES:
                    blocked.append(candidate)
            if free >= 3 * STANCES:
                return
        yield from blocked

    def is_blocked(candidate: tuple[Stance, Vector, float]) -> bool:
        stance, aim, lower = candidate
        fingers = towards(stance.xy, point)
        return not straight(obstacles, world.spheres(fingers), aim, _pressing(point, fingers, lower), PRESSING - lower)

    def has_way(candidate: tuple[Stance, Vector, float], search: bool) -> bool:
        nonlocal passed
        stance, aim, _ = candidate
        fingers, rests = towards(stance.xy, point), world.resting(hand, stance)
        follows = world.follows(hand, world.body.turned(hand, fingers, DOWN), obstacles, stance)
        spheres, back = world.spheres(fingers), [UP, -fingers]
        found = hand_path(obstacles, spheres, rests, aim, back, search=search, follows=follows) is not None
        passed += found
        return found and passed > attempt

    return first_way(candidates(), has_way, 3 * STANCES)
