"""Pushing: an object is brought into contact with another, or out of the way. What a hand can take is put onto the
other; what it cannot lift is pushed over the floor or a table, by a palm on its far side."""

from __future__ import annotations

import functools
from collections.abc import Callable, Generator, Iterator, Sequence

import numpy as np

from ig2mj.planning.arm_orientations import points_ahead
from ig2mj.planning.clearance import straight
from ig2mj.planning.driving import go
from ig2mj.planning.free_floor import FreeFloor
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
    tries_left,
    vector3,
)
from ig2mj.planning.phases import Phase, Until
from ig2mj.planning.placing import place
from ig2mj.planning.stances import stances
from ig2mj.planning.steps import Outcome, Step
from ig2mj.planning.world import AWAY, HELD_MARGIN, PlannedWorld, Stance, Vector

ROUNDS, STROKE = 12, 0.4
"""Pushes of a primitive, and m of each, at most."""

BEHIND, PRESS = 0.12, 0.03
"""m behind a face at which a palm comes to it, and m beyond the gap that it goes for."""

HALF = 0.5
"""Share of a stroke that an object has to move by: else the next stroke is another try."""

STANCES = 10
"""That are tried from each side."""

SLOW = 0.02
"""m of the hand in an agent step."""

SIDES = (0.0, 0.5, -0.5)
"""rad by which a push may be off the straight line between both objects."""

COMPASS, ASIDE, OFF_FLOOR = 16, (0.2, 0.4, 0.6, 0.9, 1.2), 0.03
"""Directions in which something is pushed aside, m by which it is, and m above the floor from which on it has to have
room there: it stands on carpets."""


def push(world: PlannedWorld, step: Step) -> Primitive:
    """Until the objects touch."""
    name, other = step.arguments
    if world.facts.holds("in_contact_with", name, other):
        return Outcome()
    tries = 1
    if is_graspable(world, name):
        taken = Outcome() if name in world.held else (yield from grasp(world, Step("grasp", (name,))))
        if taken.done:
            onto = Step("place_on_top", (name, other))
            put = yield from place("on_top", until="in_contact_with")(world, onto)
            if not put.done and name in world.held:  # it is put down where little is left to push
                yield from place("next_to")(world, Step("place_next_to", (name, other)))
            if put.done or name in world.held:
                return put
        tries += 1
    reason, detail = "no_base", f"no free floor from which a hand can push {name} towards {other}"
    failed, missed, most = 0, False, tries_left(ATTEMPTS, world.missed[f"push {name}"], world.body.opening)
    for _ in range(ROUNDS):
        if world.facts.holds("in_contact_with", name, other):
            return Outcome(attempts=tries)
        tries += missed  # else the next stroke goes on where the last was to end
        ways = _towards(world, name, other)
        pushed = yield from _push_once(world, name, ways, failed)
        if pushed is None or failed >= most:
            break
        reason, moved = pushed
        missed = bool(reason) or moved < HALF * min(ways[0][1], STROKE)
        detail = f"the hand has no path to {name}" if reason == "no_path" else f"{name} does not reach {other}"
        failed += moved < PRESS
        world.missed[f"push {name}"] = 0 if moved >= PRESS else world.missed[f"push {name}"] + 1
    if world.facts.holds("in_contact_with", name, other):
        return Outcome(attempts=tries)
    return Outcome(reason or "not_true_after", detail, attempts=tries)


def push_aside(
    world: PlannedWorld, name: str, opens: Callable[[FreeFloor], bool], without: Sequence[str] = ()
) -> Generator[Program, str, bool]:
    """Pushes an object over the floor to where it bars no way, by as little as that takes; returns whether it bars none
    then.

    Args:
      opens: whether a floor has the way. without: objects that do not count there.
    """
    failed, ignored = 0, [world.index(n) for n in without]
    most = tries_left(ATTEMPTS, world.missed[f"push {name}"], world.body.opening)
    for _ in range(ROUNDS):
        if opens(world.floor(without=ignored)):
            return True
        if failed == most or not (ways := _ways_aside(world, name, opens, ignored)):
            return False
        pushed = yield from _push_once(world, name, ways, failed)
        if pushed is None:
            return False
        failed += pushed[1] < PRESS
        world.missed[f"push {name}"] = 0 if pushed[1] >= PRESS else world.missed[f"push {name}"] + 1
    return opens(world.floor(without=ignored))


def _ways_aside(
    world: PlannedWorld, name: str, opens: Callable[[FreeFloor], bool], ignored: Sequence[int]
) -> list[tuple[Vector, float]]:
    """Directions, with how far, m, in which an object has room to be pushed to where it bars no way, the nearest
    first."""
    world.query.load(world.stage.snapshot(world.world))
    borne = borne_by(world, name)
    index, (pos, quat), obstacles = world.index(name), world.pose(name), world.obstacles([name, *borne])
    ignored = [*ignored, *(world.index(n) for n in borne)]
    points = world.points(name) - pos
    points = points[points[:, 2] > points[:, 2].min() + OFF_FLOOR]
    spheres = np.column_stack([points, np.full(len(points), HELD_MARGIN)])
    found = list[tuple[Vector, float]]()
    for angle in np.arange(COMPASS) * (2 * np.pi / COMPASS):
        way = np.array([np.cos(angle), np.sin(angle), 0.0])
        for far in ASIDE:
            if not straight(obstacles, spheres, pos, pos + far * way):
                break
            world.query.place(index, pos + far * way, quat)
            if opens(world.floor(without=ignored, view=world.query.view)):
                found.append((way, far))
                break
    return sorted(found, key=lambda pair: pair[1])


def borne_by(world: PlannedWorld, name: str) -> list[str]:
    """Loose things that are on or in an object, and move with it."""
    corners = world.vertices(name)
    low, high, found = corners.min(0), corners.max(0), list[str]()
    for other in world.domain.loose:
        bottom = float(world.vertices(other)[:, 2].min())
        over = (low[:2] <= world.com(other)[:2]).all() and (world.com(other)[:2] <= high[:2]).all()
        if other != name and other not in world.held and over and low[2] + OFF_FLOOR < bottom < high[2] + OFF_FLOOR:
            found.append(other)
    return found


def _push_once(
    world: PlannedWorld, name: str, ways: Sequence[tuple[Vector, float]], failed: int
) -> Generator[Program, str, tuple[str, float] | None]:
    """One push: the reason why it failed, and m by which the object has moved; None: there is no floor to push it from.

    Args:
      ways: directions with how far it is to go. failed: pushes that moved nothing; others are tried.
    """
    hand, before = free_hand(world, failed), world.com(name)
    found = _plan(world, name, ways, hand, failed)
    if found is None:
        return None
    stance, point, way, gap = found
    if reason := (yield from go(world, stance)):
        return reason, 0.0
    program = yield from from_home(world, hand, functools.partial(_program, world, name, gap, hand, point, way, failed))
    if not program:
        return "no_path", 0.0
    reason = yield program
    return reason, float(np.linalg.norm(world.com(name) - before))


def _towards(world: PlannedWorld, name: str, other: str) -> list[tuple[Vector, float]]:
    """Directions in which an object is pushed to reach another, with the gap between them, m."""
    straight_way, gap = _gap(world, name, other)
    found = list[tuple[Vector, float]]()
    for side in SIDES:
        c, s = np.cos(side), np.sin(side)
        x, y, _ = straight_way
        found.append((np.array([c * x - s * y, s * x + c * y, 0.0]), gap))
    return found


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


def _plan(
    world: PlannedWorld, name: str, ways: Sequence[tuple[Vector, float]], hand: int, passed: int
) -> tuple[Stance, Vector, Vector, float] | None:
    """A stance, the point of the far face that is pushed, the direction, and how far it is to go."""
    obstacles, floor, index = world.obstacles(), world.floor(), world.index(name)
    centre, far = world.com(name), 2.0
    seen = 0

    def candidates() -> Iterator[tuple[Stance, Vector, Vector, float]]:
        for way, gap in ways:
            start = centre - far * way
            hit = float(obstacles.entries(start[None], way[None], index)[0])
            if not np.isfinite(hit):
                continue
            point = start + hit * way
            end = point + min(gap, STROKE) * way
            before = None if world.body.opening is None else (point, -way)  # a gripper points to where its robot looks
            for stance in stances(world, hand, point, floor, AWAY, STANCES, before=before):
                if world.reaches(hand, stance, end) and points_ahead(world, way, stance.yaw):
                    yield stance, point, way, gap

    def has_way(candidate: tuple[Stance, Vector, Vector, float], search: bool) -> bool:
        nonlocal seen
        stance, point, way, _ = candidate
        fingers = _fingers(world, way)
        spheres, goal = world.spheres(fingers, way), point - BEHIND * way
        entries = [-way, UP, -ahead(stance.yaw)]
        follows = world.follows(hand, world.body.turned(hand, fingers, way), obstacles, stance)
        rests = world.resting(hand, stance)
        found = hand_path(obstacles, spheres, rests, goal, entries, search=search, follows=follows) is not None
        seen += found
        return found and seen > passed

    return first_way(candidates(), has_way, max(len(SIDES), len(ways)) * STANCES)


def _fingers(world: PlannedWorld, way: Vector) -> Vector:
    """Where the fingers of a hand point that pushes along `way`: up; those of a gripper lie level."""
    return UP if world.body.opening is None else np.cross(UP, way)


def _program(world: PlannedWorld, name: str, gap: float, hand: int, point: Vector, way: Vector, failed: int) -> Program:
    """Goes behind the face, pushes up to a stroke, and goes back. `gap`: m that the object is to go. `failed`: pushes
    that moved nothing: boxes may touch where the objects do not, so the hand goes farther."""
    fingers = _fingers(world, way)
    quat, start = world.body.turned(hand, fingers, way), point - BEHIND * way
    entries = [-way, UP, -ahead(world.base[1])]
    obstacles, spheres = world.obstacles(), world.spheres(fingers, way)
    follows = world.follows(hand, quat, obstacles)
    found = hand_path(obstacles, spheres, world.grip(hand), start, entries, search=True, follows=follows)
    if found is None:
        return []
    end, pushed = point + (min(gap, STROKE) + (1 + failed) * PRESS) * way, world.index(name)
    return [
        *travel(hand, found, quat),
        Phase(
            hand=hand,
            pos=vector3(end),
            quat=quat,
            close=False,
            object=pushed,
            tolerance=0.02,
            limit=40,
            after="",
            speed=SLOW,
        ),
        Phase(hand=hand, pos=vector3(start), tolerance=0.04, limit=20, after=""),
        *travel(hand, found[-2::-1], None),
        *rest(hand),
        Phase(until=Until.WAITED, limit=4),
    ]
