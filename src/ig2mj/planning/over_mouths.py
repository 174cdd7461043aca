"""Letting what a gripper holds fall into a container that is open above, from over its rim: an arm that reaches down to
a place inside of it meets its sides and its flaps.

Axes: N cells, V corners, K sides.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from jaxtyping import Bool, Float

from ig2mj.geometry.host_rotations import about_vertical, matrix_to_quat, quat_multiply, turn_about, turn_onto
from ig2mj.planning.clearance import HELD, Obstacles
from ig2mj.planning.free_floor import FreeFloor
from ig2mj.planning.moves import LET_GO, UP, ahead
from ig2mj.planning.spots import Spot, fixed_part
from ig2mj.planning.stances import stances
from ig2mj.planning.world import HELD_MARGIN, PlannedWorld, Rotation, Stance, Vector

ELEVATIONS, ASIDE, ROLLS = (0.0, -0.44, -0.75, -1.0), (0.0, 0.4, -0.4), (0.0, np.pi / 2)
"""Sines of the angles above the horizontal at which a gripper may point over a mouth, rad from where the robot looks,
and rad about where it points by which it may be turned."""

CELL, FALLING = 0.04, 0.04
"""m between places above a mouth that are looked at, and between heights of what falls."""

ABOVE, WITHIN, LEAST = 0.03, 0.02, 0.06
"""m above a container's rim at which what falls begins; below it that its middle has to come; and that it falls below
the rim at least."""

DEEP = 0.2
"""m of height from which on a container is deep."""

STANCES, TURNS = 16, 8
"""Stances from which a container is filled so, and turns of what is held that fit its mouth for each, at most."""


def is_deep(world: PlannedWorld, where: str) -> bool:
    """Whether a container is so high that what is to be in it is let fall first, and else brought down between its
    sides: an arm is off its way by more than these are thick."""
    return float(np.ptp(fixed_part(world, where)[:, 2])) > DEEP


def over_mouth(
    world: PlannedWorld, name: str, hand: int, where: str, obstacles: Obstacles, floor: FreeFloor
) -> Iterator[tuple[Stance, Spot]]:
    """Stances, and poses below which what a gripper holds falls freely into a container, those nearest to how it is
    carried first; none: the container is covered, or narrower than that.

    Args:
      obstacles: all but what the hand holds.
    """
    corners = fixed_part(world, where)
    cells = _cells(corners, obstacles)
    if not len(cells):
        return
    middle, palm, yaw = cells.mean(0), world.hand_axes(hand)[1], world.base[1]
    above = np.array([*middle, float(corners[:, 2].max()) + ABOVE])
    far = float(np.linalg.norm(world.points(name) - world.grip(hand), axis=1).max())
    for stance in stances(world, hand, above + far / 2 * UP, floor, world.body.away, most=STANCES):
        about = about_vertical(stance.yaw - yaw)
        found = 0
        for rotation in _rotations(about, palm, stance.yaw):
            spot = _falling(world, name, hand, rotation, cells, corners, obstacles)
            if spot is not None:
                yield stance, spot
                found += 1
            if found == TURNS:
                break


def _rim(corners: Float[np.ndarray, "V 3"]) -> Float[np.ndarray, "K 3"]:
    """Outline of a container from above: normals of its sides, and offsets, m, which are negative within.

    Args:
      corners: of the container without what opens.
    """
    from scipy.spatial import ConvexHull  # takes long to import

    return np.asarray(ConvexHull(corners[:, :2]).equations)


def _within(rim: Float[np.ndarray, "K 3"], points: Float[np.ndarray, "*n 2"], by: float) -> Bool[np.ndarray, "*n"]:
    """Which places are within an outline, by some m at least."""
    return np.asarray((points @ rim[:, :2].T + rim[:, 2] < -by).all(-1))


def _cells(corners: Float[np.ndarray, "V 3"], obstacles: Obstacles) -> Float[np.ndarray, "N 2"]:
    """Places above a container from which there is nothing down to `LEAST` below its rim. `corners`: as of `_rim`."""
    low, high = corners.min(0), corners.max(0)
    axes = [np.arange(a + CELL / 2, b, CELL) for a, b in zip(low[:2], high[:2], strict=True)]
    cells = np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 2)
    cells = cells[_within(_rim(corners), cells, CELL / 2)]
    heights = np.arange(high[2] - LEAST, high[2] + 2 * ABOVE, CELL / 2)
    columns = np.zeros((len(cells), len(heights), 3))
    columns[..., :2], columns[..., 2] = cells[:, None], heights
    return cells[(obstacles.distance(columns) > HELD_MARGIN).all(1)]


def _rotations(about: Rotation, palm: Vector, yaw: float) -> list[Rotation]:
    """Of what is held, from how it is now, for a robot that looks along `yaw`: those nearest to how it is carried there
    first, `about`."""
    found = list[tuple[float, Rotation]]()
    for rise in ELEVATIONS:
        for aside in ASIDE if rise > -1.0 else ASIDE[:1]:
            to = np.sqrt(1.0 - rise**2) * ahead(yaw + aside) + rise * UP
            first = turn_onto(about @ palm, to) @ about
            for roll in ROLLS:
                rotation = turn_about(to, roll) @ first
                turned = float(np.arccos(np.clip((np.trace(about.T @ rotation) - 1.0) / 2.0, -1.0, 1.0)))
                found.append((turned, rotation))
    return [rotation for _, rotation in sorted(found, key=lambda pair: pair[0])]


def _falling(
    world: PlannedWorld,
    name: str,
    hand: int,
    rotation: Rotation,
    cells: Float[np.ndarray, "N 2"],
    corners: Float[np.ndarray, "V 3"],
    obstacles: Obstacles,
) -> Spot | None:
    """Where what a hand holds, turned so, comes to be after a free fall through a mouth, in the middle of the places
    where it does; None: there are none.

    Args:
      corners: as of `_rim`.
    """
    low, high = corners.min(0), corners.max(0)
    own, quat = world.pose(name)
    grip = world.grip(hand)
    points = (world.points(name) - grip) @ rotation.T
    bottom, top = points.min(0), points.max(0)
    fall = min(ABOVE + max(LEAST, (top[2] - bottom[2]) / 2 + WITHIN), ABOVE + float(high[2] - low[2]) - HELD)
    spheres = np.column_stack([points, np.full(len(points), HELD_MARGIN)])
    start = high[2] + ABOVE - bottom[2]
    at = np.column_stack([cells - (bottom + top)[:2] / 2, np.full(len(cells), start)])
    free = np.asarray(_within(_rim(corners), at[:, None, :2] + points[None, :, :2], HELD_MARGIN).all(1))
    for down in (*np.arange(0.0, fall, FALLING), fall):
        some = np.flatnonzero(free)
        if not len(some):
            return None
        free[some] = obstacles.clear_at(spheres, at[some] - down * UP)
    places = cells[free]
    if not len(places):
        return None
    best = at[free][int(np.argmin(np.linalg.norm(places - places.mean(0), axis=1)))] - fall * UP
    turned = np.asarray(quat_multiply(np.asarray(matrix_to_quat(rotation), float), quat), float)
    return Spot(best - rotation @ (grip - own), turned, drop=fall - LET_GO)
