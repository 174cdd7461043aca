"""Hollow bricks: bowls, cups, boxes without a lid. Their collision is a floor and a ring of convex wall pieces."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from .bricks import Mesh, Solid, block, join
from .turned import ROUND_SIDES, turn

RING_GROWTH = 0.5  # a ring's corners lie this far between the circle and the polygon around it


def ring(bottom: float, top: float, low: float, high: float, wall: float, pieces: int = 7) -> Solid:
    """Collision only: a conical wall of `pieces` wedges. Outer radii at heights low and high; `wall`: thickness."""
    grow = 1 + RING_GROWTH * (1 / math.cos(math.pi / pieces) - 1)
    hulls = []
    for k in range(pieces):
        points = []
        for angle in (2 * math.pi * k / pieces, 2 * math.pi * (k + 1) / pieces):
            for r, z in ((bottom, low), (top, high)):
                for radius in (r * grow, max(r * grow - wall, 1e-4)):
                    points.append((radius * math.cos(angle), radius * math.sin(angle), z))
        hulls.append(np.array(points))
    return Solid((), tuple(hulls))


def turned_vessel(
    profile: Sequence[tuple[float, float]],
    wall: float,
    pieces: int = 7,
    sides: int = ROUND_SIDES,
    floor: float | None = None,
) -> Solid:
    """A hollow turned shape, open at the top. profile: (outer radius, z) from the foot's edge up to the rim.

    wall: thickness; floor: thickness of the bottom (default: wall). Felt as a floor disc and one straight conical wall
    from foot to rim, so keep the wall's belly slight, or give `ring` walls of your own.
    """
    floor = wall if floor is None else floor
    outer = [(float(r), float(z)) for r, z in profile]
    inner = [(max(r - wall, 1e-4), max(z, outer[0][1] + floor)) for r, z in reversed(outer)]
    visual = turn([(0.0, outer[0][1]), *outer, *inner, (0.0, outer[0][1] + floor)], sides)
    (r0, z0), (r1, z1) = outer[0], outer[-1]
    return Solid((visual,)) + disc(r0, z0, floor) + ring(r0, r1, z0, z1, wall, pieces)


def disc(radius: float, z: float, thickness: float, sides: int = 8) -> Solid:
    """Collision only: a flat round plate with its underside at height z."""
    angles = np.arange(sides) * 2 * math.pi / sides
    flat = np.c_[radius * np.cos(angles), radius * np.sin(angles)]
    return Solid((), (np.concatenate([np.c_[flat, np.full(sides, z)], np.c_[flat, np.full(sides, z + thickness)]]),))


def tray(x: float, y: float, z: float, wall: float, floor: float | None = None, spread: float = 0.0) -> Solid:
    """An open box standing on the origin, walls of thickness `wall`; its rim is wider than its foot by 2 * spread."""
    floor = wall if floor is None else floor
    if spread == 0.0:
        return join(
            [
                block((x, y, floor), (0, 0, floor / 2)),
                block((wall, y, z - floor), ((x - wall) / 2, 0, (z + floor) / 2)),
                block((wall, y, z - floor), ((wall - x) / 2, 0, (z + floor) / 2)),
                block((x - 2 * wall, wall, z - floor), (0, (y - wall) / 2, (z + floor) / 2)),
                block((x - 2 * wall, wall, z - floor), (0, (wall - y) / 2, (z + floor) / 2)),
            ]
        )
    foot_x, foot_y = x - 2 * spread, y - 2 * spread
    walls = []
    for size, foot, axis in ((x, foot_x, 0), (y, foot_y, 1)):
        other, other_foot = (y, foot_y) if axis == 0 else (x, foot_x)
        for sign in (1, -1):
            points = []
            for half, half_other, h in ((foot / 2, other_foot / 2, 0.0), (size / 2, other / 2, z)):
                for inset in (wall, 0.0):
                    for s in (-1, 1):
                        p = [0.0, 0.0, h]
                        p[axis], p[1 - axis] = sign * (half - inset), s * half_other
                        points.append(p)
            walls.append(np.array(points))
    outside = np.array(
        [[sx * a / 2, sy * b / 2, h] for a, b, h in ((foot_x, foot_y, 0), (x, y, z)) for sx, sy in _AROUND]
    )
    inside = outside - np.array([[sx * wall, sy * wall, 0] for _ in (0, 1) for sx, sy in _AROUND])
    inside[:4, 2] = floor
    visual = Mesh(np.concatenate([outside, inside]), np.array(_shell_faces()))
    return Solid((visual,), tuple(walls)) + block((foot_x, foot_y, floor), (0, 0, floor / 2)).collision_only()


_AROUND = ((-1, -1), (1, -1), (1, 1), (-1, 1))


def _shell_faces() -> list[tuple[int, int, int]]:
    faces = [(0, 2, 1), (0, 3, 2), (8, 9, 10), (8, 10, 11)]
    for k in range(4):
        n = (k + 1) % 4
        faces += [(k, n, n + 4), (k, n + 4, k + 4)]  # outside
        faces += [(n + 8, k + 8, k + 12), (n + 8, k + 12, n + 12)]  # inside
        faces += [(k + 4, n + 4, n + 12), (k + 4, n + 12, k + 12)]  # rim
    return faces
