"""Things that are in a robot's way to what a step is about: found by the search for a way, and put elsewhere, or pushed
aside where hands do not take hold of them."""

from __future__ import annotations

import itertools
from collections.abc import Generator

import numpy as np
from jaxtyping import Float

from ig2mj.planning.bodies import HandedBody
from ig2mj.planning.driving import drive
from ig2mj.planning.footprint import LOWEST
from ig2mj.planning.free_floor import NEAR_START, FreeFloor, Point
from ig2mj.planning.grasping import with_free_hand
from ig2mj.planning.moves import PrimitiveFailed, Program
from ig2mj.planning.placing import bring_out
from ig2mj.planning.pushing import push_aside
from ig2mj.planning.spots import is_tipped
from ig2mj.planning.stances import behind_wall
from ig2mj.planning.steps import Step
from ig2mj.planning.world import PlannedWorld

LOOKED_AT = 60
"""Places near what a step is about from which it is looked whether a wall is in between, about."""

GAIN = 0.25
"""m by which floor has to be nearer to what a step is about than floor in reach, for things to be moved out of the way
there."""

WITH_EASE = 0.2
"""m beyond where the base of an arm likes to be up to which its hand reaches what lies on a table with ease: farther
away it can only point level."""

PUSHING = 0.03
"""m in an agent step of a base that pushes things in its way."""

PUSHED = 0.1
"""m that a thing has moved by which has been pushed."""

UPON = 0.03
"""m above an object's top up to which the bottom of what lies upon it is."""

NEAR_WAY, HIGH = 0.3, 1.05
"""m from a way within which a thing is in it, and height from which on it is above it."""


def moved_out_of_the_way(world: PlannedWorld, step: Step) -> Generator[Program, str, bool]:
    """Puts the first thing that is in the way elsewhere on the floor, or pushes it aside, else what lies upon the
    object; or sets up a container that has fallen over with what is to be taken. Where that fails a base on wheels
    pushes through. Returns whether there was one, and it was moved."""
    if not isinstance(world.body, HandedBody):
        return False
    found = clutter_in_the_way(world, step), lying_upon(world, step), fallen_around(world, step)
    names = list(dict.fromkeys(name for name in found if name is not None))
    for name in names:
        if (yield from with_free_hand(world, _moved(world, step, name))):
            return True
    return bool(names) and world.body.opening is not None and (yield from _pushed_through(world, step))


def _pushed_through(world: PlannedWorld, step: Step) -> Generator[Program, str, bool]:
    """Drives towards what a step is about as if loose things were not there, slowly, so that the base pushes them;
    returns whether it came nearer and something has moved. A robot that is shut in by them has no other way out."""
    point = target_of(world, step)
    if point is None or (reach := _nearer(world, step, point)) <= 0.0:
        return False
    loose = _loose(world, step)
    without, before = [world.index(n) for n in loose], [world.com(n) for n in loose]
    freed = world.floor(without=without)
    goal = nearest_floor(world, freed, point, reach)
    way = None if goal is None else freed.way(world.base[0], goal)
    if goal is None or way is None:
        return False
    yield drive(way, None, PUSHING)
    if all(np.linalg.norm(world.com(n) - b) < PUSHED for n, b in zip(loose, before, strict=True)):
        return False  # what the base came up to stays there
    left = world.floor(without=without).way(world.base[0], goal)
    return left is not None and _length(way) - _length(left) > GAIN


def _length(way: Float[np.ndarray, "N 2"]) -> float:
    """m."""
    return float(np.linalg.norm(np.diff(way, axis=0), axis=1).sum())


def _moved(world: PlannedWorld, step: Step, name: str) -> Generator[Program, str, bool]:
    """Puts a thing elsewhere, or pushes it aside where hands do not take it; returns whether it did."""
    try:
        if world.domain.graspable(name) and (yield from bring_out(world, name)).done:
            return True
        point = target_of(world, step)
        barring = _barring(world, step)
        if point is None or name in world.held or barring is None or barring[0] != name:
            return False  # what lies upon something is not pushed
        others, reach = barring[1], _nearer(world, step, point)
        opens = lambda floor: nearest_floor(world, floor, point, reach) is not None  # noqa: E731
        return (yield from push_aside(world, name, opens, others))
    except PrimitiveFailed:
        return False


def _loose(world: PlannedWorld, step: Step) -> list[str]:
    """Things that may be moved out of the way for a step."""
    return [n for n in world.domain.loose if n not in step.things and n not in world.held]


def clutter_in_the_way(world: PlannedWorld, step: Step) -> str | None:
    """The first thing that bars the way to what a step is about; None: the robot comes as near to that with all loose
    things as without."""
    found = _barring(world, step)
    return None if found is None else found[0]


def _barring(world: PlannedWorld, step: Step) -> tuple[str, list[str]] | None:
    """The first thing on the way to what a step is about, without loose things, that bars all ways together with those
    before it, and those behind it; None: as `clutter_in_the_way`. What just stands next to the way stays."""
    point = target_of(world, step)
    if point is None or (reach := _nearer(world, step, point)) <= 0.0:
        return None
    loose = _loose(world, step)
    freed = world.floor(without=[world.index(n) for n in loose])
    goal, (here, _) = nearest_floor(world, freed, point, reach), world.base
    way = None if goal is None else freed.way(here, goal)
    if way is None:
        return None
    lines = [(a, b, max(2, int(np.linalg.norm(b - a) / 0.05))) for a, b in itertools.pairwise(way)]
    points = np.concatenate([np.linspace(a, b, count) for a, b, count in lines])
    met = list[tuple[float, str]]()
    for name in loose:
        low, high = world.facts.box(name)
        if low[2] > HIGH or high[2] < LOWEST:
            continue
        apart = np.linalg.norm(points - np.clip(points, low[:2], high[:2]), axis=1)
        near = apart < NEAR_WAY
        met.append((float(np.argmax(near)) if near.any() else len(points) + float(apart.min()), name))
    behind = [name for _, name in sorted(met)]
    high = [name for name in loose if name not in behind]
    while behind:
        name = behind.pop(0)
        left = world.floor(without=[world.index(n) for n in (*behind, *high)])
        if nearest_floor(world, left, point, reach) is None:
            return name, [*behind, *high]
    return None


def lying_upon(world: PlannedWorld, step: Step) -> str | None:
    """What lies upon an object that is to be taken, so that a hand has no room there, the highest; None: nothing."""
    if step.primitive != "grasp":
        return None
    low, high = world.facts.box(step.object)
    middle, found = (low[2] + high[2]) / 2, list[tuple[float, str]]()
    for name in _loose(world, step):
        bottom, top = world.facts.box(name)
        over = (bottom[:2] < high[:2]).all() and (top[:2] > low[:2]).all()
        if over and middle < bottom[2] < high[2] + UPON and world.domain.graspable(name):
            found.append((float(top[2]), name))
    return max(found)[1] if found else None


def fallen_around(world: PlannedWorld, step: Step) -> str | None:
    """The container that has fallen over with an object in it that is to be taken; None: there is none."""
    if step.primitive != "grasp":
        return None
    around = [n for n in world.facts.containers(step.object) if n in _loose(world, step) and is_tipped(world, n)]
    return next((n for n in around if world.domain.graspable(n)), None)


def _nearer(world: PlannedWorld, step: Step, point: Float[np.ndarray, "3"]) -> float:
    """m from a point within which there is floor that is better than all to which the robot can drive: from where its
    hands reach the point with ease, where there is such floor without loose things."""
    floor, (here, _) = world.floor(), world.base
    easy = world.body.reach if world.body.opening is None else world.body.away + WITH_EASE
    far = world.body.reach + float(np.linalg.norm(world.body.shoulders[:, :2], axis=1).max())
    cells = floor.within(point[:2], far)
    cells = cells[np.isfinite(floor.distances(here, NEAR_START)[tuple(cells.T)])]
    middles, obstacles = floor.occupancy.middles(cells), world.obstacles()
    apart = np.linalg.norm(middles - point[:2], axis=1)
    for k in np.argsort(apart)[:: max(1, len(apart) // LOOKED_AT)]:
        if not behind_wall(world, obstacles, middles[k][None], point)[0]:
            far = float(apart[k]) - GAIN
            break
    freed = world.floor(without=[world.index(n) for n in _loose(world, step)])
    return easy if easy < far and nearest_floor(world, freed, point, easy) is not None else far


def nearest_floor(world: PlannedWorld, floor: FreeFloor, point: Float[np.ndarray, "3"], reach: float) -> Point | None:
    """Floor to which the robot can drive, within reach of a point and on the same side of all walls, the nearest along
    the floor."""
    here, _ = world.base
    cells = floor.within(point[:2], reach)
    away = floor.distances(here, NEAR_START)[tuple(cells.T)]
    middles, obstacles = floor.occupancy.middles(cells), world.obstacles()
    for k in np.argsort(away)[:: max(1, len(away) // LOOKED_AT)]:
        if not np.isfinite(away[k]):
            return None
        if not behind_wall(world, obstacles, middles[k][None], point)[0]:
            return middles[k]
    return None


def target_of(world: PlannedWorld, step: Step) -> Float[np.ndarray, "3"] | None:
    """What a step is about: what it acts on, or where what is held goes; None: where the robot is, or anywhere."""
    names = world.domain.model.tables.object_names
    tables = world.domain.model.tables
    for name in step.things:
        if name in names and name not in world.held and not tables.object_is_floor[world.index(name)]:
            return world.com(name)
    return None
