"""Bricks turned on a lathe: cylinders, bottles, balls, sleeves; round for the eye, few facets for contact."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence

import numpy as np

from .shape import Mesh, Solid

ROUND_SIDES = 20  # facets of a round visual
HULL_SIDES = 12  # facets of a round hull of two levels; a multiple of 4: its box is then that of the circle


def lathe(profile: Sequence[tuple[float, float]], sides: int = ROUND_SIDES, split: Sequence[float] = ()) -> Solid:
    """A turned shape. profile: (radius, z) from the bottom up; it is closed to the axis at both ends.

    split: heights at which the collision is cut into separate hulls (a bottle: at the shoulder).
    """
    visual = turn(_close(profile), sides)
    cuts = [-math.inf, *split, math.inf]
    hulls = []
    for low, high in itertools.pairwise(cuts):
        hulls.append(_turned_hull(_band(list(profile), low, high)))
    return Solid((visual,), tuple(hulls))


def sleeve(profile: Sequence[tuple[float, float]], sides: int = ROUND_SIDES) -> Solid:
    """A turned skin without end caps, visual only: a label around a bottle, a stripe. profile: (radius, z), upwards."""
    return Solid((turn([(float(r), float(z)) for r, z in profile], sides),))


def _close(profile: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    points = [(float(r), float(z)) for r, z in profile]
    if points[0][0] > 0:
        points.insert(0, (0.0, points[0][1]))
    if points[-1][0] > 0:
        points.append((0.0, points[-1][1]))
    return points


def turn(points: list[tuple[float, float]], sides: int) -> Mesh:
    """Revolves a polyline about z; points on the axis become one vertex."""
    angles = np.arange(sides) * 2 * math.pi / sides
    vertices: list[Sequence[float]] = []
    rings = []
    for r, z in points:
        start = len(vertices)
        if r <= 1e-9:
            vertices.append((0.0, 0.0, z))
            rings.append([start] * sides)
        else:
            vertices += [(r * math.cos(a), r * math.sin(a), z) for a in angles]
            rings.append(list(range(start, start + sides)))
    faces = []
    for low, high in itertools.pairwise(rings):
        for k in range(sides):
            n = (k + 1) % sides
            if low[k] != low[n]:
                faces.append((low[k], low[n], high[n]))
            if high[k] != high[n]:
                faces.append((low[k], high[n], high[k]))
    return Mesh(np.array(vertices), np.array(faces))


def _band(profile: list[tuple[float, float]], low: float, high: float) -> list[tuple[float, float]]:
    """The part of a profile between two heights, with the cut points put in."""
    points = []
    for (r0, z0), (r1, z1) in itertools.pairwise(profile):
        a, b = min(z0, z1), max(z0, z1)
        if low <= z0 <= high:
            points.append((r0, z0))
        points += [(r0 + (r1 - r0) * (cut - z0) / (z1 - z0), cut) for cut in (low, high) if a < cut < b]
    if low <= profile[-1][1] <= high:
        points.append(profile[-1])
    return points


def _turned_hull(profile: list[tuple[float, float]]) -> np.ndarray:
    """Points of a round hull: the lowest, the widest and the highest level of a profile, 32 vertices at most."""
    levels = {min(profile, key=lambda p: (p[1], -p[0])), max(profile, key=lambda p: (p[1], p[0])), max(profile)}
    widest = max(levels)[0]
    lowest_wide = min((p for p in profile if p[0] >= 0.97 * widest), key=lambda p: p[1])
    highest_wide = max((p for p in profile if p[0] >= 0.97 * widest), key=lambda p: p[1])
    levels |= {lowest_wide, highest_wide}
    sides = HULL_SIDES if sum(r > 1e-6 for r, _ in levels) <= 2 else 8
    angles = np.arange(sides) * 2 * math.pi / sides
    points = []
    for r, z in sorted(levels, key=lambda p: p[1]):
        if r <= 1e-6:
            points.append((0.0, 0.0, z))
        else:
            points += [(r * math.cos(a), r * math.sin(a), z) for a in angles]
    return np.array(points)


def cylinder(radius: float, height: float, sides: int = ROUND_SIDES) -> Solid:
    """A cylinder along z standing on the origin."""
    return lathe([(radius, 0), (radius, height)], sides)


def ball(x: float, y: float, z: float, sides: int = 16) -> Solid:
    """An ellipsoid with full axes x, y, z standing on the origin."""
    levels = 9 if sides > 8 else 6
    angles = np.linspace(-math.pi / 2, math.pi / 2, levels)
    points = [(max(0.0, 0.5 * math.cos(a)), 0.5 + 0.5 * math.sin(a)) for a in angles]
    visual = turn([(r if 0 < k < levels - 1 else 0.0, h) for k, (r, h) in enumerate(points)], sides)
    ring = np.arange(8) * math.pi / 4
    hull = [(0, 0, 0.0), (0, 0, 1.0)]
    for a in (-math.pi / 4, 0.0, math.pi / 4):
        hull += [
            (0.5 * math.cos(a) * math.cos(t), 0.5 * math.cos(a) * math.sin(t), 0.5 + 0.5 * math.sin(a)) for t in ring
        ]
    return Solid((visual,), (np.array(hull),)).scaled(x, y, z)
