"""What primitives in physics have in common: driving to a stance, phases of a hand, and which hand it is.

A primitive is a generator: it yields motion programs (`list[Phase]`), is sent the reason why each failed ("" for
success), and returns its outcome.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Generator, Iterable, Sequence
from typing import TypeVar

import numpy as np
from jaxtyping import Float

from ig2mj.planning.bodies import Follower
from ig2mj.planning.clearance import Obstacles, hand_way, straight
from ig2mj.planning.hand_search import search_way
from ig2mj.planning.phases import Phase, Until
from ig2mj.planning.steps import Outcome
from ig2mj.planning.world import PlannedWorld, Vector

Candidate = TypeVar("Candidate")

Program = list[Phase]
Primitive = Generator[Program, str, Outcome]

ATTEMPTS = 4
"""Tries of a primitive."""

FEWEST = 2
"""Tries of a gripper at least, whatever has failed before."""

ABOVE, BELOW = 0.12, 0.03
"""m: above a grasp at which a hand comes to it, and below an object's top that it goes for, until it touches."""

CLOSING, GRIPPING = 0.006, 0.02
"""m in an agent step by which a closing hand goes on, and a gripper on an arm: a floating hand's targets behind a
surface add up, and small things that are pressed on their support are shot out."""

THIN, NEAR, COMING, TOUCHING = 0.04, 0.025, 0.03, 0.01
"""m: what is thinner, a floating hand comes slowly to, from how far before it, and m in an agent step until then, and
from there: else it would be behind the palm before the fingers close, or shot out below it."""

LET_GO = 0.015
"""m above its place at which an object is let go."""

OPENS = 3
"""Agent steps in which the fingers of a hand that has let go come off what it held."""

RETREAT = 0.12
"""m that a hand goes back after it has let go."""

UP, DOWN = np.array([0.0, 0.0, 1.0]), np.array([0.0, 0.0, -1.0])


@dataclasses.dataclass(eq=False)
class PrimitiveFailed(Exception):
    """A primitive cannot go on."""

    reason: str
    detail: str


def guarded(inner: Primitive) -> Primitive:
    """A primitive whose `PrimitiveFailed` is its outcome."""
    try:
        return (yield from inner)
    except PrimitiveFailed as e:
        return Outcome(e.reason, e.detail)


def tries_left(most: int, missed: int, opening: float | None) -> int:
    """Tries of a primitive that are left for something that has been tried in vain in this episode by a gripper, whose
    same ways fail again. Other hands have all of them.

    Args:
      most: tries of a first request. missed: tries in vain (`PlannedWorld.missed`). opening: m; None: no gripper.
    """
    return most if opening is None else max(min(FEWEST, most), most - missed)


# Hands.


OVER = 0.035
"""m above where an object is put down from which on it is lowered."""

ENTRIES = (0.2, 0.35, 0.5)
"""m before a goal to which a hand goes first where it finds no way to the goal itself."""


def hand_path(
    obstacles: Obstacles,
    spheres: np.ndarray,
    start: Vector,
    goal: Vector,
    entries: Sequence[Vector] = (),
    spare: float = 0.0,
    search: bool = False,
    follows: Follower | None = None,
    turns: bool = False,
    strays: bool = False,
) -> list[Vector] | None:
    """Points of a hand's way, without the first; None: no way was found. See `ig2mj.planning.clearance.hand_way`.

    Args:
      entries: unit vectors from the goal, along which a hand comes straight to it where nothing else is free.
      search: ways around obstacles are searched for (`ig2mj.planning.hand_search`), where via points find none.
      follows: of the arm that carries the hand; None: it floats. turns: the hand is turned at the start (`turn_at`).
      strays: room on straight lines is enough, wherever the arm brings the hand; with `search` also without this, at
        last.
    """
    if follows is not None:
        if spare == 0.0 and not obstacles.clear(spheres + np.array([*goal, 0.0])):
            return None
        if not follows.reaches(goal):
            return None

    def accepts(way: list[Vector]) -> bool:
        return follows is None or follows(way, spheres[: 0 if strays else None], start if turns else None)

    if spare > 0.0:  # what is put down comes to right above its place first
        over = goal + OVER * UP
        way = hand_path(obstacles, spheres, start, over, entries, search=search, follows=follows, turns=turns)
        if way is not None:
            return [*way, goal]
    way = hand_way(obstacles, spheres, start, goal, spare, accepts=accepts)
    if way is not None:
        return way
    ends = list[Vector]()
    for entry in entries:
        for apart in ENTRIES:
            if not straight(obstacles, spheres, goal + apart * entry, goal, spare):
                break  # farther ones lead through the same
            ends.append(goal + apart * entry)
    for end in ends:
        way = hand_way(obstacles, spheres, start, end, accepts=lambda way: accepts([*way, goal]))
        if way is not None:
            return [*way, goal]
    if not search:
        return None
    for end in [goal] if spare == 0.0 else ends[:1]:
        way = search_way(obstacles, spheres, start, end)
        if way is not None and accepts(way if end is goal else [*way, goal]):
            return way if end is goal else [*way, goal]
    if follows is None or strays:
        return None
    return hand_path(obstacles, spheres, start, goal, entries, spare, search, follows, turns, strays=True)


def goes_on(way: Sequence[Vector] | None, point: Vector, follows: Follower | None, strays: bool = False) -> bool:
    """Whether there is a way of a hand, and an arm takes it on to a point, whatever the hand meets, and has room there;
    `strays`: or has none."""
    if way is None or follows is None:
        return way is not None
    return follows.passes([*way, point]) if strays else follows.arrives([*way, point])


RAISED, DRAWN_BACK = (0.0, 0.08, 0.16, 0.28, 0.4), (0.0, 0.12)
"""m by which a hand is raised, and drawn back to the robot, where what it holds has no room to be turned."""


def turning_point(obstacles: Obstacles, spheres: np.ndarray, start: Vector, yaw: float) -> Vector:
    """Where a hand turns what it holds before it goes on: where it is, or the first point above or behind that has room
    for it; where it is, if there is none.

    Args:
      spheres: of the hand and what it holds, as they are turned to. yaw: rad, of the robot.
    """
    for raised in RAISED:
        for back in DRAWN_BACK:
            point = start + raised * UP - back * ahead(yaw)
            if obstacles.clear(np.column_stack([spheres[:, :3] + point, spheres[:, 3]])):
                return point
    return start


def ahead(yaw: float) -> Vector:
    """The horizontal direction of an angle, rad."""
    return np.array([np.cos(yaw), np.sin(yaw), 0.0])


def towards(xy: Sequence[float] | np.ndarray, point: Vector) -> Vector:
    """The horizontal direction from a place on the floor to a point."""
    offset = np.array([*(point[:2] - np.asarray(xy, float)), 0.0])
    return offset / max(float(np.linalg.norm(offset)), 1e-9)


def travel(hand: int, points: Sequence[Vector], quat, keeps: int = -1) -> Program:
    """Phases of a hand along points of a way."""
    last = len(points) - 1
    return [
        Phase(
            hand=hand, pos=vector3(p), quat=quat, keeps=keeps, tolerance=0.04 if k < last else 0.025, limit=60, after=""
        )
        for k, p in enumerate(points)
    ]


def turn_at(world: PlannedWorld, hand: int, point: Vector, quat, keeps: int = -1) -> Program:
    """Phases in which a hand goes to a point, and turns there."""
    there = Phase(hand=hand, pos=vector3(point), quat=quat, keeps=keeps, tolerance=0.05, limit=30, after="")
    if np.linalg.norm(point - world.grip(hand)) < 0.04:
        return [there]
    return [dataclasses.replace(there, quat=None), there]


def carry(
    world: PlannedWorld,
    hand: int,
    keeps: int = -1,
    name: str = "",
    grip: Vector | None = None,
    held: Sequence[str] | None = None,
) -> Phase:
    """The hand goes to where it carries an object (`PlannedWorld.carry`)."""
    return Phase(
        hand=hand,
        pos=vector3(world.carry(hand, name, grip, held)),
        in_body=True,
        keeps=keeps,
        tolerance=0.08,
        limit=40,
        after="",
    )


def rest(hand: int) -> Program:
    """The open hand goes back to where it rests."""
    return [Phase(hand=hand, reset=True, close=False, until=Until.WAITED, limit=4)]


STRAYED, RAISED_OFF = 0.15, 0.1
"""m from where a hand rests, or carries what it holds, beyond which it has strayed; by which it is raised first."""

SLACK = 0.001
"""m by which what is close to other things may come closer."""

TOUCHES = 0.3
"""Share of the spheres' radii that keeps clear of others where a hand with what it holds touches something."""

Found = TypeVar("Found")


def strayed(world: PlannedWorld, hand: int) -> bool:
    """Whether a hand is not where it rests or, if it holds something, carries that: ways are planned from there."""
    home = world.carried(hand, world.stance) if world.held[hand] else world.resting(hand, world.stance)
    return bool(np.linalg.norm(world.grip(hand) - home) > STRAYED)


def go_home(world: PlannedWorld, hand: int) -> Program:
    """A hand goes back to where it rests or, if it holds something, carries that: on a way that is free or, where none
    is found, raised first, off what it is at."""
    name = world.held[hand]
    home = [carry(world, hand)] if name else rest(hand)
    way = way_home(world, hand, name) if world.body.opening is None else None
    if way is not None:
        return [*travel(hand, way, None), *home]
    up = vector3(world.grip(hand) + RAISED_OFF * UP)
    return [Phase(hand=hand, pos=up, tolerance=0.04, limit=15, after=""), *home] if name else home


def go_home_past(world: PlannedWorld, hand: int, came: Sequence[Vector]) -> Generator[Program, str, None]:
    """As `go_home`; where no way home is free, the hand first goes back the way that it came to where it is: one on an
    arm up to where the straight way home is free."""
    name = world.held[hand]
    if came and world.body.opening is None and way_home(world, hand, name) is None:
        yield travel(hand, came[-2::-1], None)
    if came and world.body.opening is not None and name:
        yield [*travel(hand, way_back(world, hand, name, came), None, world.index(name)), carry(world, hand)]
        return
    yield go_home(world, hand)


def way_back(world: PlannedWorld, hand: int, name: str, came: Sequence[Vector]) -> list[Vector]:
    """Points of the way that a hand came (m, the last is where it is about), backwards, up to the first one from which
    the straight way to where it carries an object is free."""
    obstacles, home = world.obstacles([name], world.stance), world.carried(hand, world.stance)
    spheres = world.spheres(*world.hand_axes(hand), holding=name, hand=hand)
    found = list[Vector]()
    for point in [world.grip(hand), *came[-2::-1]]:
        found.append(point)
        if straight(obstacles, spheres, point, home):
            break
    return found[1:]


def way_home(world: PlannedWorld, hand: int, name: str, moved: Vector | None = None) -> list[Vector] | None:
    """Points between where a floating hand is, turned as it is, and where it rests or carries what it holds; None:
    there is no such way.

    Args:
      name: what it holds; "": nothing. moved: by which the base has gone with the hand, m, which then comes straight up
        or level, and may be as close to what is around as it is now; None: it has not.
    """
    off = np.zeros(3) if moved is None else moved
    x, y = world.stance.xy + off[:2]
    stance = dataclasses.replace(world.stance, xy=(float(x), float(y)))
    start = world.carried(hand, stance) if name else world.resting(hand, stance)
    obstacles, grip = world.obstacles([name] if name else [], stance), world.grip(hand) + off
    spheres = world.spheres(*world.hand_axes(hand), holding=name, hand=hand)
    back = [UP, -ahead(stance.yaw)] if moved is None else [UP]
    for share in (1.0, TOUCHES):
        there = spheres * (1.0, 1.0, 1.0, share)
        if moved is not None:
            there = as_close(obstacles, there, grip - off)
        way = hand_path(obstacles, there, start, grip, back, search=obstacles.clear(there + np.array([*grip, 0.0])))
        if way is not None:
            return way[-2::-1]
    return None


def as_close(obstacles: Obstacles, spheres: Float[np.ndarray, "S 4"], point: Vector) -> Float[np.ndarray, "n 4"]:
    """Spheres that may come as close to what is around as they are now, with a hand at a point (m), and no closer;
    without those whose middles are in something."""
    room = obstacles.distance(spheres[:, :3] + point)
    within = np.column_stack([spheres[:, :3], np.minimum(spheres[:, 3], room - SLACK)])
    return within[within[:, 3] > 0.0]


def from_home(
    world: PlannedWorld, hand: int, plan: Callable[[], Found | None]
) -> Generator[Program, str, Found | None]:
    """What `plan` finds for a hand. Where it finds nothing and the hand has strayed, because somebody else has moved it
    or it was stopped on its way, the hand goes back first."""
    found, held = plan(), world.held[hand]
    if found or not strayed(world, hand):
        return found
    yield go_home(world, hand)
    return plan() if world.held[hand] == held else None


SEARCHES = 4
"""Ways of a hand that are searched for at most, where via points find none for any pose."""


def first_way(
    candidates: Iterable[Candidate], find: Callable[[Candidate, bool], bool], most: int, search: bool = True
) -> Candidate | None:
    """The first of some candidates (stances with poses) with a way for the hand: via points are tried for `most`, then
    ways are searched for, for the first of them, if that is asked for."""
    tried = []
    for candidate in candidates:
        if find(candidate, False):
            return candidate
        tried.append(candidate)
        if len(tried) >= most:
            break
    if not search:
        return None
    return next((c for c in tried[:: max(1, len(tried) // SEARCHES)] if find(c, True)), None)


def free_hand(world: PlannedWorld, attempt: int = 0) -> int:
    free = [h for h, name in enumerate(world.held) if not name]
    if not free:
        raise PrimitiveFailed("no_grasp", f"the hands are full: {', '.join(world.held)}")
    return free[::-1][attempt % len(free)]


def hand_with(world: PlannedWorld, name: str) -> int:
    if name not in world.held:
        raise PrimitiveFailed("no_grasp", f"no hand holds {name}")
    return world.held.index(name)


def vector3(v) -> tuple[float, float, float]:
    x, y, z = (float(c) for c in v)
    return (x, y, z)


def quaternion(q) -> tuple[float, float, float, float]:
    w, x, y, z = (float(c) for c in q)
    return (w, x, y, z)
