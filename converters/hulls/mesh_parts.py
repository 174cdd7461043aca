"""What a triangle mesh encloses: clean-up, connected parts, enclosed volume, and whether its hull stands for it.

Meshes in the wild have holes, parts turned inside out, doubled faces. Volumes therefore come from the generalised
winding number (Jacobson et al. 2013) where a mesh is not closed.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import scipy.sparse
import scipy.stats.qmc
import trimesh

from .convex import Hull, hull_of, mesh_union_volume, sample_surface, surface_distance, thickness

SAMPLES = 2048
"""Points that decide how much of a hull is filled: standard error about 1 % at worst."""
MARKS = 2000
"""Most points of a hull whose distance from the mesh is measured."""
WORK = 10_000_000
"""Most (point, triangle) pairs of one winding-number sum."""
OPEN_UP = 0.7
"""z of the normal of an opening's plane from which on it counts as facing up."""
THIN = 0.05
"""Metres: nothing is kept inside a closed shell that is no thicker."""
COVERED = 0.01
"""Every point of a shell's hull is this near to its mesh, relative to the diagonal."""
OPEN_SHARE = 0.03
"""Openings smaller than this share of the hull's surface are defects, not openings."""


@dataclasses.dataclass
class MeshComponent:
    """A connected part of a mesh.

    vertices [n, 3], faces [m, 3] wound outward; its hull; the m3 it encloses; closed: watertight; hollow: a sheet
    without thickness whose opening faces +z: a container, although its hull would close it.
    """

    vertices: np.ndarray
    faces: np.ndarray
    hull: Hull
    volume: float
    closed: bool
    hollow: bool = False

    @property
    def triangles(self) -> np.ndarray:
        return self.vertices[self.faces]


def clean(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Merges equal vertices; drops faces that are degenerate, doubled, out of range or not finite."""
    vertices = np.asarray(vertices, np.float64).reshape(-1, 3)
    faces = np.asarray(faces, np.int64).reshape(-1, 3)
    faces = faces[np.all((faces >= 0) & (faces < len(vertices)), axis=1)]
    finite = np.asarray(np.isfinite(vertices).all(axis=1))
    faces = faces[finite[faces].all(axis=1)]
    if not len(faces):
        return np.zeros((0, 3)), np.zeros((0, 3), np.int64)
    used, faces = np.unique(faces, return_inverse=True)
    vertices, faces = vertices[used], faces.reshape(-1, 3)
    step = max(float(np.ptp(vertices, axis=0).max()) * 1e-6, 1e-12)
    cells = np.round((vertices - vertices.min(axis=0)) / step).astype(np.int64)
    _, first, number = np.unique(cells, axis=0, return_index=True, return_inverse=True)
    vertices, faces = vertices[first], number.reshape(-1)[faces]
    a, b, c = faces.T
    faces = faces[(a != b) & (b != c) & (a != c)]
    _, once = np.unique(np.sort(faces, axis=1), axis=0, return_index=True)
    return vertices, faces[np.sort(once)]


def parts(vertices: np.ndarray, faces: np.ndarray) -> list[MeshComponent]:
    """The connected parts of a cleaned mesh, largest hull first; flat ones are left out.

    Parts are split where more than two faces meet, so two boxes that share an edge are two parts. A part inside
    another and wound the other way round is the other's cavity and stays with it.
    """
    if not len(faces):
        return []
    labels = _labels(faces)
    order = np.argsort(labels, kind="stable")
    found = []
    for own in np.split(faces[order], np.flatnonzero(np.diff(labels[order])) + 1):
        used, local = np.unique(own, return_inverse=True)
        hull = hull_of(vertices[used])
        if hull is None:
            continue
        mesh = trimesh.Trimesh(vertices[used], local.reshape(-1, 3), process=False)
        if not mesh.is_winding_consistent:
            trimesh.repair.fix_winding(mesh)
        found.append([mesh, hull, bool(mesh.is_watertight), signed_volume(_triangles(mesh))])
    if sum(f[3] for f in found) < 0:  # the whole file is inside out
        for f in found:
            f[0].invert()
            f[3] = -f[3]
    found.sort(key=lambda f: -f[1].volume)
    outer: list[list] = []
    for mesh, hull, closed, volume in found:
        if volume < 0:
            around = next((o for o in reversed(outer) if o[2] and o[1].contains(hull.vertices).all()), None)
            if around is not None and closed:
                around[0] = trimesh.util.concatenate([around[0], mesh])
                around[3] += volume
                continue
            mesh.invert()
            volume = -volume
        outer.append([mesh, hull, closed, volume])
    return [_part(*o, others=[x[1] for x in outer if x is not o]) for o in outer]


def signed_volume(triangles: np.ndarray) -> float:
    """m3 enclosed by [m, 3, 3]; negative if wound inward; means little for an open mesh."""
    moved = triangles - triangles[0, 0]
    a, b, c = (moved[:, i] for i in range(3))
    return float(np.einsum("mi,mi->", a, np.cross(b, c)) / 6)


def _triangles(mesh: trimesh.Trimesh) -> np.ndarray:
    return np.asarray(mesh.vertices)[np.asarray(mesh.faces)]


def _labels(faces: np.ndarray) -> np.ndarray:
    """Part number per face: joined over edges of exactly two faces."""
    pairs = np.asarray(trimesh.graph.face_adjacency(faces)).reshape(-1, 2)
    graph = scipy.sparse.coo_matrix((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(faces), len(faces)))
    return scipy.sparse.csgraph.connected_components(graph, directed=False)[1]


def _part(mesh: trimesh.Trimesh, hull: Hull, closed: bool, volume: float, others: list[Hull]) -> MeshComponent:
    rings = [] if closed else _holes(mesh)
    hollow = any(_opens_up(np.asarray(mesh.vertices)[ring], hull, others) for ring in rings)
    if rings and not hollow:
        capped = _capped(mesh, rings)
        if capped is not None:
            mesh, closed, volume = capped, True, abs(signed_volume(_triangles(capped)))
    vertices, faces = np.asarray(mesh.vertices), np.asarray(mesh.faces)
    if not closed or not 0 < volume <= hull.volume * 1.001:
        volume = hull.volume * float(np.mean(winding(points_in(hull), vertices[faces]) > 0.5))
    return MeshComponent(vertices, faces, hull, volume, closed, hollow)


def _holes(mesh: trimesh.Trimesh) -> list[list[int]]:
    """Closed rings of open edges, as vertex numbers, run against the mesh; [] where they do not close."""
    single = trimesh.grouping.group_rows(np.sort(mesh.edges, axis=1), require_count=1)
    after: dict[int, list[int]] = {}
    for a, b in np.asarray(mesh.edges)[single].tolist():
        after.setdefault(b, []).append(a)
    rings = []
    while after:
        start = next(iter(after))
        ring, at = [], start
        while True:
            ring.append(at)
            nexts = after.get(at)
            if not nexts:
                return []
            following = nexts.pop()
            if not nexts:
                del after[at]
            at = following
            if at == start:
                break
        if len(ring) >= 3:
            rings.append(ring)
    return rings


def _capped(mesh: trimesh.Trimesh, rings: list[list[int]]) -> trimesh.Trimesh | None:
    """The mesh with its holes closed by fans about their middles, or None if that does not close it."""
    vertices, faces = list(np.asarray(mesh.vertices)), list(np.asarray(mesh.faces))
    for ring in rings:
        vertices.append(np.mean([vertices[i] for i in ring], axis=0))
        faces += [[ring[i], ring[(i + 1) % len(ring)], len(vertices) - 1] for i in range(len(ring))]
    closed = trimesh.Trimesh(np.array(vertices), np.array(faces), process=False)
    return closed if closed.is_watertight and closed.is_winding_consistent else None


def _opens_up(ring: np.ndarray, hull: Hull, others: list[Hull]) -> bool:
    """Whether a hole with this rim [k, 3] is of some size and faces up, as a bowl's or a box's does.

    A hole that another part covers is only a hidden face.
    """
    corners = hull.vertices[hull.faces]
    total = float(np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1).sum())
    spokes = ring - ring.mean(axis=0)
    around = np.cross(spokes, np.roll(spokes, -1, axis=0)).sum(axis=0)
    area = float(np.linalg.norm(around))
    if area <= OPEN_SHARE * total or abs(around[2]) <= OPEN_UP * area:
        return False
    if float(ring[:, 2].mean()) <= float(hull.vertices[:, 2].mean()):
        return False
    middle = ring.mean(axis=0, keepdims=True)
    return not any(other.contains(middle, 0.02 * hull.diagonal).any() for other in others)


def enclosed_volume(solid: list[MeshComponent], whole: Hull) -> float:
    """m3 of the union of the parts, whose common hull is `whole`: exact where they are closed, else by sampling."""
    if len(solid) == 1:
        return solid[0].volume
    volume = None
    if all(p.closed for p in solid):
        volume = mesh_union_volume([(p.vertices, p.faces) for p in solid])
    if volume is None:
        triangles = np.concatenate([p.triangles for p in solid])
        volume = whole.volume * float(np.mean(winding(points_in(whole), triangles) > 0.5))
    return min(max(volume, max(p.volume for p in solid)), sum(p.volume for p in solid))


def points_in(hull: Hull, count: int = SAMPLES) -> np.ndarray:
    """About `count` points [., 3] spread evenly inside the hull, always the same ones."""
    low, high = hull.vertices.min(axis=0), hull.vertices.max(axis=0)
    share = hull.volume / max(float(np.prod(high - low)), 1e-300)
    requested = int(min(count / max(share, 1e-3), 64 * count))
    points = low + scipy.stats.qmc.Halton(3, scramble=False).random(requested) * (high - low)
    inside = points[hull.contains(points)]
    return inside if len(inside) else hull.vertices.mean(axis=0, keepdims=True)


def winding(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Generalised winding number of the surface about each point [p, 3]: about 1 inside, 0 outside.

    Large sums are kept small: the mesh is made coarser and only the first points are answered. [p' <= p]
    """
    if len(triangles) * 64 > WORK:
        v, f = decimate(triangles.reshape(-1, 3), np.arange(3 * len(triangles)).reshape(-1, 3), WORK // 64)
        triangles = v[f]
    points = points[: max(64, WORK // max(len(triangles), 1))]
    total = np.empty(len(points))
    rows = max(1, 400_000 // max(len(triangles), 1))
    for start in range(0, len(points), rows):
        a, b, c = (triangles[None, :, i] - points[start : start + rows, None] for i in range(3))
        la, lb, lc = (np.linalg.norm(x, axis=-1) for x in (a, b, c))
        over = np.einsum("pmi,pmi->pm", a, np.cross(b, c))
        ab, bc, ca = (np.einsum("pmi,pmi->pm", x, y) for x, y in ((a, b), (b, c), (c, a)))
        under = la * lb * lc + ab * lc + bc * la + ca * lb
        total[start : start + rows] = np.arctan2(over, under).sum(axis=1) / (2 * np.pi)
    return total


def decimate(vertices: np.ndarray, faces: np.ndarray, most: int) -> tuple[np.ndarray, np.ndarray]:
    """The mesh with at most about `most` faces (quadric edge collapse), cleaned if it had more."""
    import fast_simplification

    if len(faces) <= most:
        return vertices, faces
    vertices, faces = clean(vertices, faces)
    if len(faces) > most:
        found = fast_simplification.simplify(vertices, faces.astype(np.int32), target_reduction=1 - most / len(faces))
        vertices, faces = clean(found[0], found[1])
    return vertices, faces


def hull_stands_for(hull: Hull, triangles: np.ndarray, volume: float, ratio: float, depth: float) -> bool:
    """Whether the hull may replace the mesh: by volume, and no point of the hull is far from the mesh.

    Args:
      volume: m3 that the mesh encloses. ratio: most hull / mesh volume.
      depth: most metres from a point of the hull to the mesh; also at most 5 % of the diagonal.
    """
    if volume <= 0 or hull.volume > ratio * volume:
        return False
    marks = sample_surface(hull.vertices[hull.faces], 600)
    marks = marks[:: -(-len(marks) // MARKS)]
    return float(surface_distance(marks, triangles).max()) <= max(min(depth, 0.05 * hull.diagonal), 1e-6)


def is_thin_shell(hull: Hull, triangles: np.ndarray) -> bool:
    """Whether the mesh is the whole surface of its hull, and the hull is thin: a board, a panel, a knob.

    What the faces enclose does not matter then: modelling programs leave such shells without volume (doubled faces,
    faces that do not meet), and nothing could be put inside them.
    """
    if not len(triangles) or thickness(hull.vertices) > THIN:
        return False
    marks = sample_surface(hull.vertices[hull.faces], 600)
    marks = marks[:: -(-len(marks) // MARKS)]
    return float(surface_distance(marks, triangles).max()) <= COVERED * hull.diagonal
