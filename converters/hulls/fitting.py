"""Is this convex hull a box, a cylinder or a sphere? Fits that are good enough to replace it, and how good they are."""

from __future__ import annotations

import dataclasses
from typing import Literal

import numpy as np

from .convex import Hull, distance_outside, hull_of, principal_axes

BOX_VOLUME = 0.02
"""A box may be this much larger than the hull, relative."""
BOX_DISTANCE = 0.02
"""And stand out of it by this much of its diagonal."""
ROUND_VERTEX = 0.01
"""Vertices of a cylinder or sphere lie this near to its surface, relative to the radius."""
CYLINDER_SAGITTA = 0.06
"""How far the flats of a faceted cylinder may be inside the round one, relative to the radius: 10 sides or more."""
SPHERE_SAGITTA = 0.08
"""The same for a sphere: from an icosphere of 42 vertices on."""


@dataclasses.dataclass(frozen=True)
class Fit:
    """kind; pose 4x4 (a cylinder's axis is z); size as `description.Shape.size`; volume m3; distance: greatest, between
    the two surfaces, metres; volume_error: relative, signed."""

    kind: Literal["box", "cylinder", "sphere"]
    pose: np.ndarray
    size: tuple[float, ...]
    volume: float
    distance: float
    volume_error: float


def fit_primitive(hull: Hull) -> Fit | None:
    """The first of box, sphere and cylinder that stands for the hull within the tolerances above, or None."""
    return fit_box(hull) or fit_sphere(hull) or fit_cylinder(hull)


def fit_box(hull: Hull) -> Fit | None:
    best: tuple[float, np.ndarray] | None = None
    for axes in _box_axes(hull):
        volume = float(np.prod(np.ptp(hull.vertices @ axes.T, axis=0)))
        if best is None or volume < best[0] * (1 - 1e-9):
            best = (volume, axes)
    if best is None or best[0] > hull.volume * (1 + BOX_VOLUME):
        return None
    axes = _nearest_to_identity(best[1])
    inside = hull.vertices @ axes.T
    low, high = inside.min(axis=0), inside.max(axis=0)
    size, middle = high - low, 0.5 * (low + high)
    corners = np.stack(np.meshgrid(*zip(low, high, strict=True), indexing="ij"), axis=-1).reshape(8, 3) @ axes
    distance = distance_outside(corners, hull)
    if distance > BOX_DISTANCE * float(np.linalg.norm(size)):
        return None
    volume = float(np.prod(size))
    return Fit("box", _pose(axes, middle @ axes), _numbers(size), volume, distance, volume / hull.volume - 1)


def fit_sphere(hull: Hull) -> Fit | None:
    v = hull.vertices
    if len(v) < 20:
        return None
    around = v.mean(axis=0)
    p = v - around
    solution, *_ = np.linalg.lstsq(np.column_stack([2 * p, np.ones(len(p))]), (p**2).sum(axis=1), rcond=None)
    centre = solution[:3]
    square = float(solution[3] + centre @ centre)
    if square <= 0:
        return None
    radius = float(np.sqrt(square))
    off = float(np.abs(np.linalg.norm(p - centre, axis=1) - radius).max())
    centre = centre + around
    flats = float((radius + hull.planes[:, :3] @ centre + hull.planes[:, 3]).max())
    if off > ROUND_VERTEX * radius or flats > SPHERE_SAGITTA * radius:
        return None
    volume = 4 / 3 * np.pi * radius**3
    return Fit("sphere", _pose(np.eye(3), centre), (radius,), volume, max(off, flats), volume / hull.volume - 1)


def fit_cylinder(hull: Hull) -> Fit | None:
    if len(hull.vertices) < 20:
        return None
    best: Fit | None = None
    for axis in _cylinder_axes(hull):
        fit = _cylinder_about(hull, axis)
        if fit is not None and (best is None or fit.distance < best.distance):
            best = fit
    return best


def _cylinder_about(hull: Hull, axis: np.ndarray) -> Fit | None:
    axes = _frame(axis)
    local = hull.vertices @ axes.T
    low, high = local[:, 2].min(), local[:, 2].max()
    length = high - low
    centre, radius = _circle(local[:, :2])
    if radius <= 0 or length <= 0:
        return None
    radial = np.linalg.norm(local[:, :2] - centre, axis=1)
    slack = ROUND_VERTEX * max(radius, length)
    off = float(np.abs(radial - radius).max())
    ends = float(np.minimum(local[:, 2] - low, high - local[:, 2]).max())
    if off > ROUND_VERTEX * radius or ends > slack:
        return None
    turned = hull.planes[:, :3] @ axes.T
    sides = np.abs(turned[:, 2]) < 0.5
    middle = np.array([centre[0], centre[1], 0.5 * (low + high)]) @ axes
    clearance = -(hull.planes[:, :3] @ middle + hull.planes[:, 3])
    if not sides.any():
        return None
    flats = float((radius - clearance[sides]).max())
    caps = float(np.abs(0.5 * length - clearance[~sides]).max()) if (~sides).any() else np.inf
    if flats > CYLINDER_SAGITTA * radius or caps > slack:
        return None
    volume = float(np.pi * radius**2 * length)
    size = (float(radius), float(length))
    return Fit("cylinder", _pose(axes, middle), size, volume, max(off, flats, caps, ends), volume / hull.volume - 1)


def _circle(points: np.ndarray) -> tuple[np.ndarray, float]:
    """Least-squares circle of [n, 2]: centre and radius (0 if there is none)."""
    around = points.mean(axis=0)
    p = points - around
    solution, *_ = np.linalg.lstsq(np.column_stack([2 * p, np.ones(len(p))]), (p**2).sum(axis=1), rcond=None)
    square = float(solution[2] + solution[:2] @ solution[:2])
    return solution[:2] + around, float(np.sqrt(square)) if square > 0 else 0.0


def _face_normals(hull: Hull, most: int) -> list[np.ndarray]:
    """Unit normals of the largest flat sides, opposite ones once, largest first."""
    tri = hull.vertices[hull.faces]
    area = 0.5 * np.linalg.norm(np.cross(tri[:, 1] - tri[:, 0], tri[:, 2] - tri[:, 0]), axis=1)
    normals, sums = [], []
    for i in np.argsort(-area, kind="stable")[:200]:
        n = hull.planes[i, :3]
        for j, known in enumerate(normals):
            if abs(known @ n) > 1 - 1e-6:
                sums[j] += area[i]
                break
        else:
            normals.append(n)
            sums.append(area[i])
    order = np.argsort(-np.array(sums), kind="stable")[:most]
    return [normals[i] for i in order]


def _box_axes(hull: Hull) -> list[np.ndarray]:
    found = [np.eye(3)]
    normals = _face_normals(hull, 8)
    for first in normals[:3]:
        square = [n for n in normals if abs(n @ first) < 0.02]
        for second in square[:2]:
            second = second - (second @ first) * first
            second /= np.linalg.norm(second)
            found.append(np.stack([first, second, np.cross(first, second)]))
    return found


def _cylinder_axes(hull: Hull) -> list[np.ndarray]:
    return [*_face_normals(hull, 3), *principal_axes(hull.vertices)[[0, 2]], *np.eye(3)]


def _frame(axis: np.ndarray) -> np.ndarray:
    """Rows x, y, z of a right-handed frame whose z is the axis, pointing to the positive side."""
    z = axis / np.linalg.norm(axis)
    if z[np.abs(z).argmax()] < 0:
        z = -z
    x = np.eye(3)[0 if abs(z[0]) < 0.9 else 1]
    x = x - (x @ z) * z
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(z, x), z])


def _nearest_to_identity(axes: np.ndarray) -> np.ndarray:
    """The same three axes, ordered and signed to be as near to x, y, z as they can, right-handed."""
    import scipy.optimize

    rows, columns = scipy.optimize.linear_sum_assignment(-np.abs(axes.T))
    ordered = axes[columns[np.argsort(rows)]]
    ordered = ordered * np.where(np.diag(ordered) < 0, -1.0, 1.0)[:, None]
    if np.linalg.det(ordered) < 0:
        ordered[int(np.abs(np.diag(ordered)).argmin())] *= -1
    snapped = np.round(ordered)
    return snapped if np.abs(ordered - snapped).max() < 1e-7 else ordered


def _pose(axes: np.ndarray, position: np.ndarray) -> np.ndarray:
    pose = np.eye(4)
    pose[:3, :3] = axes.T
    pose[:3, 3] = position
    return pose


def _numbers(values: np.ndarray) -> tuple[float, ...]:
    return tuple(float(x) for x in values)


def primitive_hull(kind: str, size: tuple[float, ...], pose: np.ndarray) -> Hull | None:
    """A polyhedron for a box, cylinder, sphere or capsule of the source: exact for a box, else inscribed."""
    import trimesh

    if kind == "box":
        half = np.array(size) / 2
        points = np.stack(np.meshgrid(*[(-h, h) for h in half], indexing="ij"), axis=-1).reshape(-1, 3)
    elif kind == "cylinder":
        angle = np.linspace(0, 2 * np.pi, 32, endpoint=False)
        ring = np.column_stack([size[0] * np.cos(angle), size[0] * np.sin(angle), np.zeros(32)])
        up = np.array([0, 0, size[1] / 2])
        points = np.concatenate([ring - up, ring + up])
    else:
        points = np.asarray(trimesh.creation.icosphere(subdivisions=2, radius=size[0]).vertices)
        if kind == "capsule":
            up = np.array([0, 0, size[1] / 2])
            points = np.concatenate([points - up, points + up])
    return hull_of(points @ pose[:3, :3].T + pose[:3, 3])


def primitive_volume(kind: str, size: tuple[float, ...]) -> float:
    """m3, exact."""
    if kind == "box":
        return float(np.prod(size))
    if kind == "cylinder":
        return float(np.pi * size[0] ** 2 * size[1])
    ball = 4 / 3 * np.pi * size[0] ** 3
    return float(ball + np.pi * size[0] ** 2 * size[1]) if kind == "capsule" else float(ball)
