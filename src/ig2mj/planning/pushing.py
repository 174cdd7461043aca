"""Pushing: an object is brought into contact with another. What a hand can take is put onto it; what it cannot lift is
pushed there over the floor or a table, by a palm on its far side."""

from __future__ import annotations

import functools
from collections.abc import Iterator

import numpy as np

from ig2mj.planning.arm_orientations import points_ahead
from ig2mj.planning.driving import go
from ig2mj.planning.grasping import grasp, is_graspable
from ig2mj.planning.moves import (
    ATTEMPTS,
    UP,
    Primitive,
    Program,
    ahead,
    first_way,
    free_hand,
    from_home,
    hand_path,
    rest,
    travel,
    vector3,
)
from ig2mj.planning.phases import Phase, Until
from ig2mj.planning.placing import place
from ig2mj.planning.stances import stances
from ig2mj.planning.steps import Outcome, Step
from ig2mj.planning.world import AWAY, PlannedWorld, Stance, Vector

ROUNDS, STROKE = 12, 0.4
"""Pushes of a primitive, and m of each, at most."""

BEHIND, PRESS = 0.12, 0.03
"""m behind a face at which a palm comes to it, and m beyond the gap that it goes for."""

STANCES = 10
"""That are tried from each side."""

SLOW = 0.02
"""m of the hand in an agent step."""

SIDES = (0.0, 0.5, -0.5)
"""rad by which a push may be off the straight line between both objects."""


def push(world: PlannedWorld, step: Step) -> Primitive:
    """Until the objects touch."""
    name, other = step.arguments
    if world.facts.holds("in_contact_with", name, other):
        return Outcome()
    if is_graspable(world, name):
        taken = Outcome() if name in world.held else (yield from grasp(world, Step("grasp", (name,))))
        if taken.done:
            onto = Step("place_on_top", (name, other))
            put = yield from place("on_top", until="in_contact_with")(world, onto)
            if put.done or name in world.held:
                return put
    reason, detail = "no_base", f"no free floor from which a hand can push {name} towards {other}"
    failed = 0
    for attempt in range(ROUNDS):
        if world.facts.holds("in_contact_with", name, other):
            return Outcome(attempts=attempt + 1)
        hand, before = free_hand(world, failed), world.com(name)
        found = _plan(world, name, other, hand, failed)
        if found is None or failed >= ATTEMPTS:
            break
        stance, point, direction = found
        if reason := (yield from go(world, stance)):
            failed += 1
            continue
        plan = functools.partial(_program, world, name, other, hand, point, direction, failed)
        program = yield from from_home(world, hand, plan)
        if not program:
            reason, detail, failed = "no_path", f"the hand has no path to {name}", failed + 1
            continue
        reason = yield program
        failed += float(np.linalg.norm(world.com(name) - before)) < PRESS
        detail = f"{name} does not reach {other}"
    if world.facts.holds("in_contact_with", name, other):
        return Outcome(attempts=ROUNDS)
    return Outcome(reason or "not_true_after", detail, attempts=ROUNDS)


def _gap(world: PlannedWorld, name: str, other: str) -> tuple[Vector, float]:
    """The horizontal direction from one object to another between their nearest corners, and how far these are
    apart, m."""
    one, two = world.vertices(name)[:, :2], world.vertices(other)[:, :2]
    low, high = two.min(0), two.max(0)
    nearest = np.clip(world.com(name)[:2], low, high)
    away = nearest - world.com(name)[:2]
    if np.linalg.norm(away) < 1e-6:
        away = two.mean(0) - one.mean(0)
    way = np.array([*away, 0.0]) / max(float(np.linalg.norm(away)), 1e-9)
    gap = float(np.linalg.norm(away)) - float(((one - world.com(name)[:2]) @ way[:2]).max())
    return way, max(gap, 0.0)


def _plan(world: PlannedWorld, name: str, other: str, hand: int, passed: int) -> tuple[Stance, Vector, Vector] | None:
    """A stance, the point of the far face that is pushed, and the direction."""
    straight, gap = _gap(world, name, other)
    obstacles, floor, index = world.obstacles(), world.floor(), world.index(name)
    centre, far = world.com(name), 2.0
    seen = 0

    def candidates() -> Iterator[tuple[Stance, Vector, Vector]]:
        for side in SIDES:
            c, s = np.cos(side), np.sin(side)
            way = np.array([c * straight[0] - s * straight[1], s * straight[0] + c * straight[1], 0.0])
            start = centre - far * way
            hit = float(obstacles.entries(start[None], way[None], index)[0])
            if not np.isfinite(hit):
                continue
            point = start + hit * way
            end = point + min(gap, STROKE) * way
            before = None if world.body.opening is None else (point, -way)  # a gripper points to where its robot looks
            for stance in stances(world, hand, point, floor, AWAY, STANCES, before=before):
                if world.reaches(hand, stance, end) and points_ahead(world, way, stance.yaw):
                    yield stance, point, way

    def has_way(candidate: tuple[Stance, Vector, Vector], search: bool) -> bool:
        nonlocal seen
        stance, point, way = candidate
        fingers = _fingers(world, way)
        spheres, goal = world.spheres(fingers, way), point - BEHIND * way
        entries = [-way, UP, -ahead(stance.yaw)]
        follows = world.follows(hand, world.body.turned(hand, fingers, way), obstacles, stance)
        rests = world.resting(hand, stance)
        found = hand_path(obstacles, spheres, rests, goal, entries, search=search, follows=follows) is not None
        seen += found
        return found and seen > passed

    return first_way(candidates(), has_way, len(SIDES) * STANCES)


def _fingers(world: PlannedWorld, way: Vector) -> Vector:
    """Where the fingers of a hand point that pushes along `way`: up; those of a gripper lie level."""
    return UP if world.body.opening is None else np.cross(UP, way)


def _program(world: PlannedWorld, name: str, other: str, hand: int, point: Vector, way: Vector, failed: int) -> Program:
    """Goes behind the face, pushes up to a stroke, and goes back. `failed`: pushes that moved nothing: boxes may touch
    where the objects do not, so the hand goes farther."""
    _, gap = _gap(world, name, other)
    fingers = _fingers(world, way)
    quat, start = world.body.turned(hand, fingers, way), point - BEHIND * way
    entries = [-way, UP, -ahead(world.base[1])]
    obstacles, spheres = world.obstacles(), world.spheres(fingers, way)
    follows = world.follows(hand, quat, obstacles)
    found = hand_path(obstacles, spheres, world.grip(hand), start, entries, search=True, follows=follows)
    if found is None:
        return []
    end = point + (min(gap, STROKE) + (1 + failed) * PRESS) * way
    return [
        *travel(hand, found, quat),
        Phase(hand=hand, pos=vector3(end), quat=quat, close=False, tolerance=0.02, limit=40, after="", speed=SLOW),
        Phase(hand=hand, pos=vector3(start), tolerance=0.04, limit=20, after=""),
        *travel(hand, found[-2::-1], None),
        *rest(hand),
        Phase(until=Until.WAITED, limit=4),
    ]
