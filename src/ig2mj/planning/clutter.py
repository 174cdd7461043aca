"""Things that lie in a robot's way to what a step is about: found by the search for a way, and put elsewhere."""

from __future__ import annotations

import itertools
from collections.abc import Generator

import numpy as np
from jaxtyping import Float

from ig2mj.planning.bodies import HandedBody
from ig2mj.planning.footprint import LOWEST
from ig2mj.planning.free_floor import NEAR_START, FreeFloor, Point
from ig2mj.planning.moves import PrimitiveFailed, Program
from ig2mj.planning.placing import bring_out
from ig2mj.planning.stances import behind_wall
from ig2mj.planning.steps import Step
from ig2mj.planning.world import PlannedWorld

LOOKED_AT = 60
"""Places near what a step is about from which it is looked whether a wall is in between, about."""

NEAR_WAY, HIGH = 0.3, 1.05
"""m from a way within which a thing is in it, and height from which on it is above it."""


def moved_out_of_the_way(world: PlannedWorld, step: Step) -> Generator[Program, str, bool]:
    """Puts the first thing that is in the way elsewhere on the floor; returns whether there was one, and it was."""
    if all(world.held) or not isinstance(world.body, HandedBody):
        return False
    name = clutter_in_the_way(world, step)
    if name is None:
        return False
    try:
        return (yield from bring_out(world, name)).done
    except PrimitiveFailed:
        return False


def clutter_in_the_way(world: PlannedWorld, step: Step) -> str | None:
    """The first thing that hands can take on the way to what a step is about, without loose things; None: the robot
    comes there, or does not without them."""
    point, reach = target_of(world, step), world.body.reach
    if point is None or nearest_floor(world, world.floor(), point, reach) is not None:
        return None
    loose = [n for n in world.domain.loose if n not in step.arguments and n not in world.held]
    freed = world.floor(without=[world.index(n) for n in loose])
    goal, (here, _) = nearest_floor(world, freed, point, reach), world.base
    way = None if goal is None else freed.way(here, goal)
    if way is None:
        return None
    lines = [(a, b, max(2, int(np.linalg.norm(b - a) / 0.05))) for a, b in itertools.pairwise(way)]
    points = np.concatenate([np.linspace(a, b, count) for a, b, count in lines])
    met = list[tuple[int, str]]()
    for name in loose:
        low, high = world.facts.box(name)
        if not world.domain.graspable(name) or low[2] > HIGH or high[2] < LOWEST:
            continue
        near = np.linalg.norm(points - np.clip(points, low[:2], high[:2]), axis=1) < NEAR_WAY
        if near.any():
            met.append((int(np.argmax(near)), name))
    return min(met)[1] if met else None


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
        if not behind_wall(world, obstacles, middles[k], point):
            return middles[k]
    return None


def target_of(world: PlannedWorld, step: Step) -> Float[np.ndarray, "3"] | None:
    """What a step is about: what it acts on, or where what is held goes; None: where the robot is, or anywhere."""
    names = world.domain.model.tables.object_names
    tables = world.domain.model.tables
    for name in step.arguments:
        if name in names and name not in world.held and not tables.object_is_floor[world.index(name)]:
            return world.com(name)
    return None
