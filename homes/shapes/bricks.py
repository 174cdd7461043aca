"""Building bricks: visual meshes together with convex collision hulls.

A `Solid` carries both, so that a family writes a shape once and gets a smooth picture and a collision shape of few,
low-vertex convex pieces. Lengths are metres, angles degrees; z is up, the front of an object looks along +x.
Every brick stands on the origin (its lowest point is z = 0, centred in x and y) unless its docstring says otherwise.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence

import numpy as np
import shapely
import trimesh

from .shape import AXES, Mesh, Solid, Vec, join
from .turned import ball, cylinder, lathe, sleeve

__all__ = [
    "Mesh", "Solid", "Vec", "arc", "ball", "bar", "block", "box", "cylinder", "decal", "extrusion", "frustum", "hull",
    "join", "lathe", "prism", "rod", "sheet", "sleeve", "soft_box", "tube",
]  # fmt: skip


def _corners(size: Vec) -> np.ndarray:
    half = np.asarray(size, float) / 2
    signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
    return signs * half


BOX_FACES = np.array(
    [
        [0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
        [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3],
    ]
)  # fmt: skip


def block(size: Vec, centre: Vec = (0.0, 0.0, 0.0)) -> Solid:
    """A box with full edge lengths `size`, centred on `centre` (not standing on it)."""
    corners = _corners(size) + np.asarray(centre, float)
    return Solid((Mesh(corners, BOX_FACES),), (corners,))


def box(x: float, y: float, z: float) -> Solid:
    """A box standing on the origin."""
    return block((x, y, z), (0, 0, z / 2))


def soft_box(x: float, y: float, z: float, radius: float | None = None, steps: int = 1) -> Solid:
    """A box with rounded edges (cushions, bread, soap) standing on the origin; the hull is the plain box."""
    size = np.array([x, y, z])
    r = min(radius if radius is not None else 0.25 * size.min(), 0.499 * size.min())
    inner = size / 2 - r
    # A cube's surface grid, whose outermost cells become the rounded edges.
    angles = np.tan(np.linspace(0, math.pi / 4, steps + 1))
    ticks = np.concatenate([-1 - angles[::-1][:-1], [-1.0], [1.0], 1 + angles[1:]])
    vertices, faces, lookup = [], [], {}

    def vertex(key: tuple[int, int, int]) -> int:
        if key not in lookup:
            t = ticks[list(key)]
            core = np.clip(t, -1, 1)
            out = t - core
            length = np.linalg.norm(out)
            lookup[key] = len(vertices)
            vertices.append(core * inner + (out / length * r if length > 0 else 0))
        return lookup[key]

    last = len(ticks) - 1
    for axis in range(3):
        for side in (0, last):
            for i in range(last):
                for j in range(last):
                    quad = []
                    for di, dj in ((0, 0), (1, 0), (1, 1), (0, 1)):
                        key = [0, 0, 0]
                        key[axis], key[(axis + 1) % 3], key[(axis + 2) % 3] = side, i + di, j + dj
                        quad.append(vertex(tuple(key)))  # type: ignore[arg-type]
                    quad = quad if side == last else quad[::-1]
                    faces += [[quad[0], quad[1], quad[2]], [quad[0], quad[2], quad[3]]]
    mesh = Mesh(np.array(vertices) + np.array([0, 0, z / 2]), np.array(faces))
    return Solid((mesh,), (_corners(size) + np.array([0, 0, z / 2]),))


def rod(start: Vec, end: Vec, radius: float, sides: int = 8) -> Solid:
    """A straight round bar between two points."""
    a, b = np.asarray(start, float), np.asarray(end, float)
    length = float(np.linalg.norm(b - a))
    turn = trimesh.geometry.align_vectors((0, 0, 1), (b - a) / length)
    solid = lathe([(radius, 0), (radius, length)], sides)
    hull = lathe([(radius, 0), (radius, length)], 6).visuals[0].vertices
    matrix = np.array(turn)
    matrix[:3, 3] = a
    return Solid(solid.visuals, (hull,)).moved(matrix)


def bar(start: Vec, end: Vec, width: float, depth: float) -> Solid:
    """A straight square bar between two points; `width` lies level where it can, `depth` stands across it."""
    a, b = np.asarray(start, float), np.asarray(end, float)
    along = (b - a) / np.linalg.norm(b - a)
    up = np.array([0, 0, 1.0]) if abs(along[2]) < 0.95 else np.array([1.0, 0, 0])
    side = np.cross(up, along)
    side /= np.linalg.norm(side)
    matrix = np.eye(4)
    matrix[:3, 0], matrix[:3, 1], matrix[:3, 2] = along, side, np.cross(along, side)
    matrix[:3, 3] = (a + b) / 2
    return block((float(np.linalg.norm(b - a)), width, depth)).moved(matrix)


def tube(path: Sequence[Vec], radius: float, sides: int = 8, hulls: int | None = 1, closed: bool = False) -> Solid:
    """A bent round bar through the points of `path` (handles, taps, cords).

    hulls: number of convex pieces along the path (None: one per straight run). closed: the last point joins the first.
    """
    points = np.asarray(path, float)
    count = len(points)
    tangents = np.roll(points, -1, 0) - np.roll(points, 1, 0)
    if not closed:
        tangents[0], tangents[-1] = points[1] - points[0], points[-1] - points[-2]
    tangents /= np.linalg.norm(tangents, axis=1, keepdims=True)
    normal = np.cross(tangents[0], [0, 0, 1.0] if abs(tangents[0][2]) < 0.9 else [1.0, 0, 0])
    rings = []
    for k in range(count):
        normal = normal - tangents[k] * normal.dot(tangents[k])
        normal /= np.linalg.norm(normal)
        other = np.cross(tangents[k], normal)
        angles = np.arange(sides) * 2 * math.pi / sides
        rings.append(points[k] + radius * (np.cos(angles)[:, None] * normal + np.sin(angles)[:, None] * other))
    vertices = np.concatenate(rings)
    faces = []
    for k in range(count if closed else count - 1):
        low, high = k * sides, (k + 1) % count * sides
        for s in range(sides):
            n = (s + 1) % sides
            faces += [(low + s, low + n, high + n), (low + s, high + n, high + s)]
    if not closed:
        for s in range(1, sides - 1):
            faces += [(0, s + 1, s), ((count - 1) * sides, (count - 1) * sides + s, (count - 1) * sides + s + 1)]
    runs = count - 1 if hulls is None else hulls
    stations = list(range(count)) + ([0] if closed else [])
    edges = np.linspace(0, len(stations) - 1, runs + 1).round().astype(int)
    step = 2 if sides >= 8 else 1
    pieces = []
    for a, b in itertools.pairwise(edges):
        picked = stations[a : b + 1]
        if len(picked) > 5:
            picked = [picked[i] for i in np.linspace(0, len(picked) - 1, 5).round().astype(int)]
        pieces.append(np.concatenate([rings[k][::step] for k in picked]))
    return Solid((Mesh(vertices, np.array(faces)),), tuple(pieces) if runs else ())


def arc(radius: float, start: float, stop: float, count: int = 7, plane: str = "xz") -> list[np.ndarray]:
    """Points of a circular arc about the origin; degrees from the plane's first axis towards its second."""
    first, second = np.array(AXES[plane[0]]), np.array(AXES[plane[1]])
    angles = np.radians(np.linspace(start, stop, count))
    return [radius * (math.cos(a) * first + math.sin(a) * second) for a in angles]


def prism(outline: Sequence[tuple[float, float]], height: float) -> Solid:
    """An outline (x, y), counter-clockwise, extruded along z from 0; one hull around it."""
    return extrusion(outline, height, [outline])


def extrusion(
    outline: Sequence[tuple[float, float]], height: float, pieces: Sequence[Sequence[tuple[float, float]]]
) -> Solid:
    """A simple (also concave) outline (x, y), counter-clockwise, extruded along z; `pieces`: outlines of its hulls."""
    flat = np.asarray(outline, float)
    count = len(flat)
    caps = np.array(trimesh.creation.triangulate_polygon(shapely.Polygon(flat), engine="earcut")[1])
    (ax, ay), (bx, by) = (flat[caps[:, 1]] - flat[caps[:, 0]]).T, (flat[caps[:, 2]] - flat[caps[:, 0]]).T
    area = ax * by - ay * bx
    caps = np.where(area[:, None] < 0, caps[:, ::-1], caps)
    vertices = np.concatenate([np.c_[flat, np.zeros(count)], np.c_[flat, np.full(count, height)]])
    k = np.arange(count)
    n = (k + 1) % count
    sides = np.concatenate([np.c_[k, n, n + count], np.c_[k, n + count, k + count]])
    faces = np.concatenate([caps[:, ::-1], caps + count, sides])
    hulls = []
    for piece in pieces:
        p = np.asarray(piece, float)
        hulls.append(np.concatenate([np.c_[p, np.zeros(len(p))], np.c_[p, np.full(len(p), height)]]))
    return Solid((Mesh(vertices, faces),), tuple(hulls))


def hull(points: Sequence[Vec]) -> Solid:
    """The convex hull of points [n, 3], as visual and as collision hull."""
    cloud = np.asarray(points, float)
    mesh = trimesh.convex.convex_hull(cloud)
    return Solid((Mesh(np.array(mesh.vertices), np.array(mesh.faces)),), (cloud,))


def frustum(bottom: tuple[float, float], top: tuple[float, float], height: float, shift: float = 0.0) -> Solid:
    """A block whose level faces differ: (x, y) sizes below and above; the upper one is shifted by `shift` in x."""
    points = []
    for (x, y), z, s in ((bottom, 0.0, 0.0), (top, height, shift)):
        points += [(s - x / 2, -y / 2, z), (s - x / 2, y / 2, z), (s + x / 2, -y / 2, z), (s + x / 2, y / 2, z)]
    cloud = np.array([points[i] for i in (0, 4, 1, 5, 2, 6, 3, 7)])
    return Solid((Mesh(cloud, BOX_FACES),), (cloud,))


def decal(width: float, height: float, facing: str = "x") -> Solid:
    """A picture: a rectangle seen from +`facing` ("x", "y", "z", "-x", "-y"), centred on the origin, nothing to touch.

    The texture's whole image fills it upright: left to right as seen from outside, its top towards +z
    (towards -x for "z", so that a person standing at +x reads it).
    """
    w, h = width / 2, height / 2
    flat = np.array([[0, -w, -h], [0, w, -h], [0, w, h], [0, -w, h]], float)
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    corner = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], float)
    solid = Solid((Mesh(flat, faces, corner[faces]),))
    turns = {"x": [], "y": [("z", 90)], "-x": [("z", 180)], "-y": [("z", -90)], "z": [("y", -90)]}
    for axis, degrees in turns[facing]:
        solid = solid.turned(axis, degrees)
    return solid


def sheet(x: float, y: float, waves: float, thickness: float, count: int = 10, phase: float = 0.0) -> Solid:
    """A cloth lying down with small waves (height `waves`); its hull is a flat box of height thickness + waves."""
    u, v = np.meshgrid(np.linspace(-0.5, 0.5, count), np.linspace(-0.5, 0.5, count), indexing="ij")
    swell = 0.5 + 0.25 * np.sin(7 * u + phase) + 0.25 * np.sin(5 * v + 2 * u + 2 * phase)
    top = np.stack([u * x, v * y, thickness + waves * swell], -1).reshape(-1, 3)
    bottom = top - [0, 0, thickness]
    grid = np.arange(count * count).reshape(count, count)
    a, b, c, d = grid[:-1, :-1].ravel(), grid[1:, :-1].ravel(), grid[1:, 1:].ravel(), grid[:-1, 1:].ravel()
    upper = np.concatenate([np.c_[a, b, c], np.c_[a, c, d]])
    rim = np.concatenate([grid[:, 0], grid[-1, 1:], grid[-2::-1, -1], grid[0, -2:0:-1]])
    nxt = np.roll(rim, -1)
    total = count * count
    side = np.concatenate([np.c_[rim + total, nxt + total, nxt], np.c_[rim + total, nxt, rim]])
    faces = np.concatenate([upper, upper[:, ::-1] + total, side])
    hull_points = _corners((x, y, thickness + waves)) + np.array([0, 0, (thickness + waves) / 2])
    return Solid((Mesh(np.concatenate([top, bottom]), faces),), (hull_points,))
