"""Holding an object at a point: where the robot stands, the way of its hand there, and waiting there."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence

import numpy as np

from ig2mj.geometry.host_rotations import about_vertical
from ig2mj.planning.driving import go, nearer
from ig2mj.planning.moves import (
    ATTEMPTS,
    UP,
    Program,
    ahead,
    first_way,
    from_home,
    hand_path,
    travel,
    turn_at,
    turning_point,
)
from ig2mj.planning.phases import Phase, Until
from ig2mj.planning.stances import ALL_AROUND, SPREAD, stances
from ig2mj.planning.world import AWAY, PlannedWorld, Rotation, Stance, Vector


def wait_until(
    world: PlannedWorld, condition: tuple[str, ...], seconds: float, keeps: int = -1
) -> Generator[Program, str, str]:
    """Stands still until a predicate holds; returns the reason why it does not.

    Args:
      condition: its name and its arguments. seconds: after which it is given up. keeps: number of an object that must
        stay in the hand, -1: none.
    """
    for _ in range(int(np.ceil(seconds / WAIT))):
        if world.facts.holds(*condition):
            return ""
        if reason := (yield [Phase(until=Until.WAITED, keeps=keeps, limit=int(10 * WAIT))]):
            return reason
    return "" if world.facts.holds(*condition) else "not_true_after"


WAIT = 1.0
"""s between looks at a predicate."""


@dataclasses.dataclass(frozen=True, eq=False)
class Hold:
    """A part of a held object at a point: the point, the way from there to the hand's grasp point, and the rotation by
    which the hand is turned; both of these as the robot faces now. number: of those that are alike."""

    point: Vector
    offset: Vector
    tilt: Rotation
    number: int = 0


def hold_at(
    world: PlannedWorld,
    name: str,
    hand: int,
    holds: Callable[[], Sequence[Hold]],
    suits: Callable[[Stance, Hold], bool] = lambda stance, hold: True,
) -> Generator[Program, str, tuple[str, list[Vector], int]]:
    """Holds an object in the first of some ways that the hand has a way to, with the robot standing anywhere; returns
    the reason why it did not, the way, and the number of the hold.

    Args:
      holds: as the object is held now. suits: whether a hold is right where the robot stands.
    """
    missed = set[tuple[tuple[float, float], int]]()
    for _ in range(ATTEMPTS):
        obstacles, floor, now = world.obstacles([name], stays=False), world.floor(), world.base[1]

        def candidates(around: bool = False, floor=floor, now=now) -> Iterator[_Holding]:
            for hold in holds():
                held = about_vertical(-now) @ hold.offset
                here = world.stance  # a base on wheels that stands near enough stays there
                near = not world.body.sideways and world.reaches(hand, here, hold.point + hold.offset)
                if near and not around and (here.xy, hold.number) not in missed and suits(here, hold):
                    yield here, hold
                found = stances(world, hand, hold.point, floor, AWAY, ALL_AROUND if around else STANCES, held)
                for stance in farther_ones(found) if around else found:
                    if (stance.xy, hold.number) not in missed and suits(stance, hold):
                        yield stance, hold

        def aim(stance: Stance, hold: Hold, now=now) -> tuple[Vector, Rotation]:
            turn = about_vertical(stance.yaw - now)
            return hold.point + turn @ hold.offset, turn @ hold.tilt

        def has_room(candidate: _Holding, obstacles=obstacles, aim=aim) -> bool:
            stance, hold = candidate
            target, turned = aim(stance, hold)
            spheres = _spheres(world, name, hand, turned)
            standing = world.standing(obstacles, stance, hand)
            return standing.clear(np.column_stack([spheres[:, :3] + target, spheres[:, 3]]))

        def has_way(candidate: _Holding, search: bool, obstacles=obstacles, aim=aim) -> bool:
            stance, hold = candidate
            target, turned = aim(stance, hold)
            spheres = _spheres(world, name, hand, turned)
            standing = world.standing(obstacles, stance, hand)
            start = turning_point(standing, spheres, world.carried(hand, stance), stance.yaw)
            back = [UP, -ahead(stance.yaw)]
            follows = world.follows(hand, world.turned_hand(hand, turned), standing, stance)
            way = hand_path(standing, spheres, start, target, back, search=search, follows=follows, turns=True)
            return way is not None

        most = WAYS if world.body.opening is None else ARM_WAYS
        found: _Holding | None = first_way(filter(has_room, candidates()), has_way, most)
        if found is None and world.body.opening is None:
            found = first_way(filter(has_room, candidates(around=True)), has_way, most)
        if found is None:
            return "no_path", [], -1
        stance, hold = found
        target, turned = aim(stance, hold)
        turned = turned @ about_vertical(now - stance.yaw)
        stuck = yield from go(world, stance)
        if name not in world.held:
            return "slipped", [], -1
        if stuck:
            continue
        find = functools.partial(_way, world, name, hand, target, turned)
        planned = yield from from_home(world, hand, find)
        if planned is None and name in world.held:
            quat = world.turned_hand(hand, turned)
            went = yield from nearer(world, hand, quat, target)
            planned = find() if went and name in world.held else None
        if planned is not None:
            start, way = planned
            quat, keeps = world.turned_hand(hand, turned), world.index(name)
            reason = yield [*turn_at(world, hand, start, quat, keeps), *travel(hand, way, quat, keeps=keeps)]
            return reason, way, hold.number
        missed.add((stance.xy, hold.number))
    return "no_path", [], -1


def _way(
    world: PlannedWorld, name: str, hand: int, target: Vector, turned: Rotation
) -> tuple[Vector, list[Vector]] | None:
    """Where a hand turns what it holds, and its way from there, from where the robot stands; None: there is none."""
    back, obstacles = [UP, -ahead(world.base[1])], world.obstacles([name], world.stance)
    spheres = _spheres(world, name, hand, turned)
    follows = world.follows(hand, world.turned_hand(hand, turned), obstacles)
    start = turning_point(obstacles, spheres, world.grip(hand), world.base[1])
    way = hand_path(obstacles, spheres, start, target, back, search=True, follows=follows, turns=True)
    return None if way is None else (start, way)


def _spheres(world: PlannedWorld, name: str, hand: int, rotation: Rotation) -> np.ndarray:
    return world.spheres(*world.hand_axes(hand, rotation), holding=name, hand=hand, rotation=rotation)


def farther_ones(found: Iterable[Stance]) -> Iterator[Stance]:
    """Those of some stances that are `SPREAD` from each other and from the first `STANCES`, which are left out."""
    seen = list[Stance]()
    for number, stance in enumerate(found):
        if number >= STANCES:
            if any(np.linalg.norm(np.subtract(stance.xy, s.xy)) < SPREAD for s in seen):
                continue
            yield stance
        seen.append(stance)


_Holding = tuple[Stance, Hold]
"""Where the robot stands, and how it holds what it holds."""

STANCES, WAYS, ARM_WAYS = 4, 60, 240
"""Stances for each point, and ways of a hand that are looked for, at most: of one that floats, and of one on an arm."""
