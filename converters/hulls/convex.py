"""Convex hulls of points: building, thickening, reducing, the volume of a union. Metres, one frame throughout."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np
import scipy.spatial

FLAT = 1e-5
"""A point set thinner than this, metres (or relative to its largest extent), is flat."""


@dataclasses.dataclass(frozen=True)
class Hull:
    """vertices [n, 3] float64, all extreme; faces [m, 3] int32, wound outward; planes [m, 4] (unit normal, offset <= 0
    inside); volume m3."""

    vertices: np.ndarray
    faces: np.ndarray
    planes: np.ndarray
    volume: float

    @property
    def diagonal(self) -> float:
        return float(np.linalg.norm(np.ptp(self.vertices, axis=0)))

    def contains(self, points: np.ndarray, slack: float = 0.0) -> np.ndarray:
        """Which of the points [p, 3] are inside, up to `slack` metres outside. bool [p]."""
        return np.all(points @ self.planes[:, :3].T + self.planes[:, 3] <= slack, axis=1)


def distinct(points: np.ndarray) -> np.ndarray:
    """The points without copies (closer than 1e-7 of the largest extent)."""
    points = np.asarray(points, np.float64).reshape(-1, 3)
    if not len(points):
        return points
    step = max(float(np.ptp(points, axis=0).max()) * 1e-7, 1e-12)
    _, first = np.unique(np.round((points - points[0]) / step), axis=0, return_index=True)
    return points[np.sort(first)]


def hull_of(points: np.ndarray) -> Hull | None:
    """The convex hull, or None where the points are flat, a line or fewer than four."""
    points = distinct(points)
    if len(points) < 4 or thickness(points) <= max(FLAT * float(np.ptp(points, axis=0).max()), 1e-9):
        return None
    return _qhull(points)


def _qhull(points: np.ndarray) -> Hull | None:
    middle = points.mean(axis=0)
    try:
        found = scipy.spatial.ConvexHull(points - middle)
    except scipy.spatial.QhullError:
        return None
    if found.volume <= 0:
        return None
    number = np.full(len(points), -1)
    number[found.vertices] = np.arange(len(found.vertices))
    vertices = points[found.vertices]
    faces = number[found.simplices]
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    inward = np.einsum("ij,ij->i", np.cross(b - a, c - a), found.equations[:, :3]) < 0
    faces[inward] = faces[inward][:, ::-1]
    planes = found.equations.copy()
    planes[:, 3] -= planes[:, :3] @ middle
    return Hull(vertices, faces.astype(np.int32), planes, float(found.volume))


def principal_axes(points: np.ndarray) -> np.ndarray:
    """Rows: unit axes of the point set, from the longest to the shortest spread. [3, 3]."""
    off = points - points.mean(axis=0)
    return np.linalg.eigh(off.T @ off)[1].T[::-1]


def thickness(points: np.ndarray) -> float:
    """Extent along the axis of least spread, metres."""
    return float(np.ptp(points @ principal_axes(points)[2]))


def solid_hull(points: np.ndarray, min_thickness: float) -> tuple[Hull | None, str]:
    """The convex hull, where flat point sets are thickened to `min_thickness`, half to either side.

    Returns:
      The hull and ''; the hull of the thickened points and "thickened"; or None and why there is none.
    """
    points = distinct(points)
    if len(points) < 4:
        return None, f"has {len(points)} distinct points"
    if not np.all(np.isfinite(points)):
        return None, "has a vertex that is not finite"
    hull = hull_of(points)
    if hull is not None:
        return hull, ""
    axes = principal_axes(points)
    extents = np.ptp(points @ axes.T, axis=0)
    if extents[1] <= max(FLAT * extents[0], 1e-9):
        return None, "is a line or a point"
    offset = axes[2] * (0.5 * min_thickness)
    return hull_of(np.concatenate([points - offset, points + offset])), "thickened"


def union_volume(hulls: Sequence[Hull]) -> float:
    """m3 of the union, overlaps counted once."""
    if len(hulls) < 2:
        return sum(h.volume for h in hulls)
    import manifold3d

    solids = [manifold3d.Manifold.hull_points(np.ascontiguousarray(h.vertices)) for h in hulls]
    union = manifold3d.Manifold.batch_boolean(solids, manifold3d.OpType.Add)
    volume = float(union.volume())
    low, high = max(h.volume for h in hulls), sum(h.volume for h in hulls)
    return min(max(volume, low), high)


def clip_to(hull: Hull, bounds: Hull) -> Hull | None:
    """What of the hull lies within another, `bounds`; the hull itself where it stays inside to 0.1 micrometre."""
    import manifold3d

    if bounds.contains(hull.vertices, 1e-7).all():
        return hull
    solids = [manifold3d.Manifold.hull_points(np.ascontiguousarray(h.vertices)) for h in (hull, bounds)]
    common = manifold3d.Manifold.batch_boolean(solids, manifold3d.OpType.Intersect)
    return hull_of(np.asarray(common.to_mesh64().vert_properties)[:, :3]) if common.volume() > 0 else None


def union_mesh(hulls: Sequence[Hull]) -> tuple[np.ndarray, np.ndarray]:
    """The surface of the union: vertices [n, 3] and faces [m, 3], closed and wound outward."""
    import manifold3d

    solids = [manifold3d.Manifold.hull_points(np.ascontiguousarray(h.vertices)) for h in hulls]
    mesh = manifold3d.Manifold.batch_boolean(solids, manifold3d.OpType.Add).to_mesh64()
    return np.asarray(mesh.vert_properties, np.float64)[:, :3], np.asarray(mesh.tri_verts).astype(np.int64)


def mesh_union_volume(meshes: Sequence[tuple[np.ndarray, np.ndarray]]) -> float | None:
    """m3 of the union of closed meshes (vertices, faces), or None where one of them is not a proper solid."""
    import manifold3d

    solids = []
    for vertices, faces in meshes:
        mesh = manifold3d.Mesh64(vertices.astype(np.float64), faces.astype(np.uint64))
        solids.append(manifold3d.Manifold(mesh))
        if solids[-1].status() != manifold3d.Error.NoError:
            return None
    return float(manifold3d.Manifold.batch_boolean(solids, manifold3d.OpType.Add).volume())


def reduce_vertices(hull: Hull, limit: int, *, keep_volume: bool = True) -> Hull:
    """A hull of at most `limit` vertices with the same bounding box and, as nearly as that allows, the same volume.

    With `keep_volume` False it stays inside the given hull, and is smaller.

    Picks extreme vertices (the six of the bounding box first, then always the one farthest outside what is picked),
    then spreads them about the middle until the volume is back, clipped to the bounding box.
    """
    if len(hull.vertices) <= limit:
        return hull
    picked = _farthest_first(hull, limit)
    low, high = hull.vertices.min(axis=0), hull.vertices.max(axis=0)
    best = picked
    if not keep_volume:
        return best
    middle = picked.vertices.mean(axis=0)
    spread = 1.0
    for _ in range(6):
        if abs(best.volume / hull.volume - 1.0) < 1e-3:
            break
        spread *= (hull.volume / best.volume) ** (1 / 3)
        moved = hull_of(np.clip(middle + spread * (picked.vertices - middle), low, high))
        if moved is None or abs(moved.volume - hull.volume) >= abs(best.volume - hull.volume):
            break
        best = moved
    return best


def _farthest_first(hull: Hull, limit: int) -> Hull:
    points = hull.vertices
    chosen = list(dict.fromkeys([*points.argmin(axis=0).tolist(), *points.argmax(axis=0).tolist()]))
    current = hull_of(points[chosen])
    while current is None:  # the six do not span a solid: add what is farthest from their middle
        left = [i for i in range(len(points)) if i not in chosen]
        away = np.linalg.norm(points[left] - points[chosen].mean(axis=0), axis=1)
        chosen.append(left[int(away.argmax())])
        current = hull_of(points[chosen])
    while len(chosen) < limit:
        outside = np.max(points @ current.planes[:, :3].T + current.planes[:, 3], axis=1)
        outside[chosen] = 0.0
        farthest = int(outside.argmax())
        if outside[farthest] <= 1e-9:
            break
        chosen.append(farthest)
        current = hull_of(points[chosen]) or current
    return current


def distance_outside(points: np.ndarray, hull: Hull) -> float:
    """Greatest distance of the points [p, 3] from the hull; 0 for those inside."""
    outside = points[~hull.contains(points)]
    if not len(outside):
        return 0.0
    return float(surface_distance(outside, hull.vertices[hull.faces]).max())


def surface_distance(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Distance of each point [p, 3] to the nearest of the triangles [m, 3, 3]. [p], exact.

    Large inputs are narrowed down to the triangles whose sampled points are nearest: then an upper bound that is
    exact but for rare ties.
    """
    from trimesh.triangles import closest_point

    m = len(triangles)
    if m <= 256:
        best = np.empty(len(points))
        rows = max(1, 200_000 // m)
        for start in range(0, len(points), rows):
            part = points[start : start + rows]
            near = closest_point(np.tile(triangles, (len(part), 1, 1)), np.repeat(part, m, axis=0))
            away = np.linalg.norm(near - np.repeat(part, m, axis=0), axis=1)
            best[start : start + rows] = away.reshape(len(part), m).min(axis=1)
        return best
    marks, owner = _sample_triangles(triangles, 20_000)
    k = 12
    _, nearest = scipy.spatial.KDTree(marks).query(points, k=k)
    candidates = owner[nearest]
    flat = np.repeat(points, k, axis=0)
    near = closest_point(triangles[candidates.ravel()], flat)
    return np.linalg.norm(near - flat, axis=1).reshape(-1, k).min(axis=1)


def sample_surface(triangles: np.ndarray, count: int) -> np.ndarray:
    """About `count` points [., 3] spread evenly over the triangles, and all corners and centres. No chance in it."""
    return _sample_triangles(triangles, count)[0]


def _sample_triangles(triangles: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    area = 0.5 * np.linalg.norm(np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]), axis=1)
    share = np.floor(area / max(float(area.sum()), 1e-300) * count).astype(int)
    owner = np.repeat(np.arange(len(triangles)), share)
    sequence = np.arange(len(owner), dtype=np.float64)
    u, v = (sequence * 0.7548776662466927) % 1.0, (sequence * 0.5698402909980532) % 1.0  # R2 low-discrepancy sequence
    fold = u + v > 1
    u[fold], v[fold] = 1 - u[fold], 1 - v[fold]
    a, b, c = triangles[owner, 0], triangles[owner, 1], triangles[owner, 2]
    inner = a + u[:, None] * (b - a) + v[:, None] * (c - a)
    every = np.arange(len(triangles))
    points = np.concatenate([inner, triangles.reshape(-1, 3), triangles.mean(axis=1)])
    return points, np.concatenate([owner, np.repeat(every, 3), every])
