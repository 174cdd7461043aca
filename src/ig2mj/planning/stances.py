"""Where a robot stands so that a hand reaches a point."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Sequence

import numpy as np
from jaxtyping import Bool, Float

from ig2mj.agents.humanoid.frames import BODY_HEIGHT
from ig2mj.agents.humanoid.robot import BODY_RADIUS
from ig2mj.geometry.host_rotations import about_vertical
from ig2mj.planning.clearance import Obstacles
from ig2mj.planning.free_floor import NEAR_START, FreeFloor
from ig2mj.planning.world import PlannedWorld, Stance, Vector

APART = 0.12
"""m between stances for the same point, at least."""

ALL_AROUND, SPREAD = 60, 0.25
"""Stances for a point that go all around what is there, looked at where the nearest ones do not do, and m between those
that are tried then."""

SIDEWAYS, AVERTED = 0.4, 1.0
"""Cost of standing with a hand's side to a point, and with its shoulder as near to the point as the body brings it. The
shoulder, the middle of the sphere that bounds a hand's reach (iGibson's behavior_robot.py), is behind the body's axis
and to the side, so that the hand reaches 0.3 m farther than ahead to its side, and 6 cm more obliquely behind."""

EFFORT = 1.0
"""m of way that a metre by which the body stoops, or stretches, counts as."""

TOGETHER = 48
"""Places of which walls are asked at once."""

WALL = 0.02
"""m before a point from which on a wall does not count: a switch is on it."""


def stances(
    world: PlannedWorld,
    hand: int,
    point: Vector,
    floor: FreeFloor,
    away: float,
    most: int = 10,
    held: Vector | None = None,
    before: tuple[Vector, Vector] | None = None,
) -> Iterator[Stance]:
    """Where the robot can stand so that a hand reaches a point, the nearest and most comfortable first.

    Args:
      away: m, horizontal, that the base would like to be from the point.
      held: what is brought to the point is a part of what the hand holds, and this leads from it to the hand's
        grasp point, m, in the body's frame.
      before: point and normal of a face that the robot stands in front of.
    """
    here, _ = world.base
    side = world.body.carry[hand][1]
    away = max(away, world.body.away)
    back, aside, _ = (float(v) for v in world.body.shoulders[hand])
    averts = back < 0.0  # else the shoulder is nearest to what it is ahead of
    cells = floor.within(point[:2], world.body.reach + (np.hypot(back, aside) if averts else abs(aside)))
    middles = floor.occupancy.middles(cells)
    offset = point[:2] - middles
    apart = np.linalg.norm(offset, axis=1)
    bearing = np.arctan2(offset[:, 1], offset[:, 0])
    yaws = [bearing - np.arctan2(0.6 * side, np.maximum(apart, 0.3)), bearing - np.sign(side) * np.pi / 2]
    yaws, costs = [*yaws, bearing - np.arctan2(aside, back)][: 2 + averts], (0.0, SIDEWAYS, AVERTED)[: 2 + averts]
    yaw = np.concatenate(yaws)
    way = floor.distances(here, NEAR_START)[tuple(cells.T)]
    cost = 0.6 * way + 2.0 * np.abs(apart - away) - 0.5 * np.minimum(floor.spare[tuple(cells.T)], 0.2)
    cost, middles = np.concatenate([cost + more for more in costs]), np.tile(middles, (len(costs), 1))
    target = point if held is None else point + _turned_vectors(yaw, held)
    rise = _rise_from(world, hand, middles, yaw, target)
    cost += np.where(np.isnan(rise), np.inf, EFFORT * np.abs(rise))
    if before is not None:
        cost[(middles - before[0][:2]) @ before[1][:2] <= 0.0] = np.inf
    count, obstacles, unknown = 0, world.obstacles(), np.ones(len(cost), bool)
    while len(cost) and np.isfinite(cost[best := int(np.argmin(cost))]):
        if unknown[best]:
            some = np.flatnonzero(unknown & np.isfinite(cost))
            some = some[np.argsort(cost[some])[:TOGETHER]]
            unknown[some] = False
            cost[some[behind_wall(world, obstacles, middles[some], point)]] = np.inf
            continue
        if not _stretches(world, obstacles, middles[best], rise[best]):
            cost[best] = np.inf
            continue
        cost[np.linalg.norm(middles - middles[best], axis=1) < APART] = np.inf
        yield Stance((float(middles[best][0]), float(middles[best][1])), float(yaw[best]), float(rise[best]))
        count += 1
        if count == most:
            return


def reaching_all(
    world: PlannedWorld, hand: int, stance: Stance, points: Float[np.ndarray, "n 3"], obstacles: Obstacles
) -> Stance | None:
    """The same place, with the body stretched or stooped as little as it takes that a hand reaches all of some points;
    None: there it does not, or has no room above it."""
    return reaching_with(world, stance, [(hand, point) for point in points], obstacles)


def reaching_with(
    world: PlannedWorld, stance: Stance, goals: Sequence[tuple[int, Vector]], obstacles: Obstacles
) -> Stance | None:
    """The same of several hands, each with a point, m."""
    shoulders = np.array([world.shoulder(hand, dataclasses.replace(stance, rise=0.0)) for hand, _ in goals])
    offset = np.array([point for _, point in goals]) - shoulders
    away, above = np.linalg.norm(offset[:, :2], axis=1), offset[:, 2]
    if away.max() >= world.body.reach:
        return None
    span = np.sqrt(world.body.reach**2 - away**2)
    low = max(float((above - span).max()), world.body.rises[0])
    high = min(float((above + span).min()), world.body.rises[1])
    rise = float(np.clip(0.0, low, high))
    if low > high or not _stretches(world, obstacles, np.array(stance.xy), rise):
        return None
    return dataclasses.replace(stance, rise=rise)


def behind_wall(
    world: PlannedWorld, obstacles: Obstacles, xy: Float[np.ndarray, "n 2"], point: Vector
) -> Bool[np.ndarray, "n"]:
    """Between which places of a robot and a point a wall stands."""
    starts = np.column_stack([xy, np.full(len(xy), point[2])])
    return obstacles.stand_between(starts, point, world.walls, WALL)


def clear_with_held(world: PlannedWorld, stances: Sequence[Stance], share: float = 1.0) -> bool:
    """Whether what the robot holds, carried as it is now, meets nothing where the robot stands.

    Args:
      share: of the radii of what keeps clear.
    """
    held = [(h, n) for h, n in enumerate(world.held) if n and not world.domain.fixed(n)]
    obstacles = world.obstacles([n for _, n in held])
    here, now = world.base
    for hand, name in held:
        spheres = world.spheres(*world.hand_axes(hand), holding=name, hand=hand)
        points = spheres[:, :3] + world.grip(hand) - np.array([*here, 0.0])
        for stance in stances:
            there = points @ about_vertical(stance.yaw - now).T + np.array([*stance.xy, 0.0])
            if not obstacles.clear(np.concatenate([there, share * spheres[:, 3:]], axis=1)):
                return False
    return True


def _stretches(world: PlannedWorld, obstacles: Obstacles, xy: Float[np.ndarray, "2"], rise: float) -> bool:
    """Whether there is room above a body that stretches."""
    if rise <= 0.0:
        return True
    top = world.body.stands + BODY_HEIGHT - BODY_RADIUS
    points = np.array([[*xy, top], [*xy, top + rise]])
    return bool((obstacles.distance(points) > BODY_RADIUS).all())


def _rise_from(
    world: PlannedWorld,
    hand: int,
    xy: Float[np.ndarray, "n 2"],
    yaw: Float[np.ndarray, "n"],
    point: Float[np.ndarray, "*n 3"],
) -> Float[np.ndarray, "n"]:
    """How far the body rises so that a hand reaches a point from each of some stances, m; NaN: it does not."""
    x, y, z = world.body.shoulders[hand]
    c, s = np.cos(yaw), np.sin(yaw)
    shoulder = np.stack([xy[:, 0] + c * x - s * y, xy[:, 1] + s * x + c * y], axis=1)
    away = np.linalg.norm(point[..., :2] - shoulder, axis=1)
    above = point[..., 2] - (world.body.stands + z)
    span = np.sqrt(np.maximum(world.body.reach**2 - away**2, 0.0))
    rise = np.sign(above) * np.maximum(np.abs(above) - span, 0.0)
    return np.where(
        (away <= world.body.reach) & (rise >= world.body.rises[0]) & (rise <= world.body.rises[1]), rise, np.nan
    )


def _turned_vectors(yaw: Float[np.ndarray, "n"], vector: Vector) -> Float[np.ndarray, "n 3"]:
    """A vector turned about the vertical by each of some angles, rad."""
    c, s = np.cos(yaw), np.sin(yaw)
    x, y, z = vector
    return np.stack([c * x - s * y, s * x + c * y, np.full(len(yaw), z)], axis=1)
