"""Triangles with normals and texture coordinates, collected by material.

All of one material becomes one mesh: a renderer takes time for each geom, and little for each triangle. Plain colours
share one material, whose texture holds a square of each.

Axes: V vertices, F triangles.
"""

from __future__ import annotations

import dataclasses
import functools
import itertools
import math
from collections.abc import Iterable, Sequence

import numpy as np
from jaxtyping import Float, Int

from ig2mj.looks.materials import Material

CELLS = 16
"""Squares along each side of the texture of plain colours."""

Colour = tuple[float | int, float | int, float | int]
Vector = Sequence[float | int] | np.ndarray


@dataclasses.dataclass(frozen=True)
class Triangles:
    """Corners are not shared between faces of different directions.

    Attributes:
      vertices: metres. normals: unit length. uv: texture coordinates, v upwards.
    """

    vertices: Float[np.ndarray, "V 3"]
    normals: Float[np.ndarray, "V 3"]
    uv: Float[np.ndarray, "V 2"]
    faces: Int[np.ndarray, "F 3"]

    def moved(self, pos: Vector = (0, 0, 0), turn: float | int = 0.0, scale: float | int = 1.0) -> Triangles:
        """Scaled, turned about the vertical (rad), and put at `pos`."""
        c, s = math.cos(turn), math.sin(turn)
        matrix = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
        return dataclasses.replace(
            self,
            vertices=scale * self.vertices @ matrix.T + np.asarray(pos, float),
            normals=self.normals @ matrix.T,
        )

    def turned(self, matrix: Float[np.ndarray, "3 3"]) -> Triangles:
        """Turned by a rotation matrix."""
        return dataclasses.replace(self, vertices=self.vertices @ matrix.T, normals=self.normals @ matrix.T)


def joined(parts: Iterable[Triangles]) -> Triangles:
    """All of several as one."""
    parts = list(parts)
    starts = np.cumsum([0, *(len(p.vertices) for p in parts[:-1])])
    return Triangles(
        np.concatenate([p.vertices for p in parts]),
        np.concatenate([p.normals for p in parts]),
        np.concatenate([p.uv for p in parts]),
        np.concatenate([p.faces + start for p, start in zip(parts, starts, strict=True)]),
    )


def quad(
    corners: Float[np.ndarray, "4 3"] | Sequence[Vector], uv: Sequence[Vector] | np.ndarray | None = None
) -> Triangles:
    """A flat four-sided face, corners counter-clockwise as seen from its front."""
    corners = np.asarray(corners, float)
    normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
    normal /= max(float(np.linalg.norm(normal)), 1e-12)
    uv = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], float) if uv is None else np.asarray(uv, float)
    return Triangles(corners, np.tile(normal, (4, 1)), uv, np.array([[0, 1, 2], [0, 2, 3]]))


def sheet(corner: Vector, along: Vector, up: Vector, uv: Sequence[float | int], step: float | int = 0.0) -> Triangles:
    """A rectangle in pieces of about `step` m (0: one piece), so that light that is computed at corners varies on it.

    Args:
      corner: its first corner. along, up: its edges; its front looks along their cross product.
      uv: texture coordinates of the first corner and of the one opposite.
    """
    corner, along, up = (np.asarray(a, float) for a in (corner, along, up))
    columns, rows = (max(1, round(float(np.linalg.norm(e)) / step)) if step else 1 for e in (along, up))
    s, t = (a.ravel() for a in np.meshgrid(np.linspace(0, 1, columns + 1), np.linspace(0, 1, rows + 1)))
    u0, v0, u1, v1 = uv
    normal = np.cross(along, up)
    first = (np.arange(rows)[:, None] * (columns + 1) + np.arange(columns)).ravel()
    faces = np.stack([first, first + 1, first + columns + 2, first, first + columns + 2, first + columns + 1], 1)
    return Triangles(
        corner + s[:, None] * along + t[:, None] * up,
        np.tile(normal / np.linalg.norm(normal), (len(s), 1)),
        np.stack([u0 + s * (u1 - u0), v0 + t * (v1 - v0)], 1),
        faces.reshape(-1, 3),
    )


def box(middle: Vector, size: Vector, without: str = "") -> Triangles:
    """A box; `without` names sides to leave out: of "+x", "-x", ... "-z", joined by blanks."""
    unit = _unit_box(without)
    vertices = np.asarray(middle, float) + np.asarray(size, float) / 2 * unit.vertices
    return Triangles(vertices, unit.normals, unit.uv, unit.faces)


@functools.cache
def _unit_box(without: str) -> Triangles:
    """The box from -1 to 1. Nobody changes arrays of `Triangles`."""
    left_out, faces = without.split(), []
    for axis in range(3):
        for sign in (1, -1):
            if f"{'+-'[sign < 0]}{'xyz'[axis]}" in left_out:
                continue
            a, b = (axis + 1) % 3, (axis + 2) % 3
            if sign < 0:
                a, b = b, a
            corners = np.zeros((4, 3))
            corners[:, axis] = sign
            corners[:, a] = [-1, 1, 1, -1]
            corners[:, b] = [-1, -1, 1, 1]
            faces.append(quad(corners))
    return joined(faces)


def lathe(profile: Sequence[tuple[float | int, float | int]], pos: Vector = (0, 0, 0), sides: int = 12) -> Triangles:
    """A body of revolution about the vertical: (radius, height) from below to above, in m; its outside is its front."""
    points = np.array(profile, float)
    angle = np.linspace(0, 2 * np.pi, sides + 1)
    parts = []
    for (r0, z0), (r1, z1) in itertools.pairwise(points):
        slope = np.array([z1 - z0, r0 - r1])
        slope /= max(float(np.linalg.norm(slope)), 1e-12)
        ring = np.stack([np.cos(angle), np.sin(angle)], 1)
        lower = np.column_stack([r0 * ring, np.full(sides + 1, z0)])
        upper = np.column_stack([r1 * ring, np.full(sides + 1, z1)])
        normals = np.column_stack([slope[0] * ring, np.full(sides + 1, slope[1])])
        first = np.arange(sides)
        faces = np.stack([first, first + 1, first + sides + 2, first, first + sides + 2, first + sides + 1], 1)
        share = angle / (2 * np.pi)
        uv = np.concatenate([np.stack([share, np.full(sides + 1, v)], 1) for v in (0.0, 1.0)])
        parts.append(
            Triangles(
                np.concatenate([lower, upper]) + np.asarray(pos, float),
                np.tile(normals, (2, 1)),
                uv,
                faces.reshape(-1, 3),
            )
        )
    return joined(parts)


def ball(radius: float | Vector, pos: Vector = (0, 0, 0), sides: int = 10) -> Triangles:
    """An ellipsoid."""
    radii = np.broadcast_to(np.asarray(radius, float), (3,))
    rows = max(3, sides // 2)
    t = np.linspace(-np.pi / 2, np.pi / 2, rows + 1)
    made = lathe([(math.cos(a), math.sin(a)) for a in t], sides=sides)
    normals = made.vertices / radii
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    return Triangles(made.vertices * radii + np.asarray(pos, float), normals, made.uv, made.faces)


def rod(start: Vector, end: Vector, radius: float | int, sides: int = 8) -> Triangles:
    """A round rod without ends."""
    start, end = np.asarray(start, float), np.asarray(end, float)
    length = float(np.linalg.norm(end - start))
    z = (end - start) / max(length, 1e-12)
    x = np.cross([0.0, 1.0, 0.0] if abs(z[1]) < 0.9 else [1.0, 0.0, 0.0], z)
    x /= np.linalg.norm(x)
    made = lathe([(radius, 0.0), (radius, length)], sides=sides).turned(np.stack([x, np.cross(z, x), z], 1))
    return dataclasses.replace(made, vertices=made.vertices + start)


SMALL, BLURRED = 0.05, 0.15
"""m: extent below which a part is left out of what is not fine, and is a box: 2 and 5 pixels of a robot's camera, from
2 m."""


def _boxed(part: Triangles) -> Triangles:
    """The box around it, if that has fewer triangles."""
    low, high = part.vertices.min(0), part.vertices.max(0)
    if len(part.faces) <= 12 or (high - low).min() < 1e-3:
        return part
    around = box((low + high) / 2, high - low)
    return dataclasses.replace(around, uv=np.tile(part.uv.mean(0), (len(around.vertices), 1)))


def _one_sided(part: Triangles) -> Triangles:
    """Without triangles that are the back of another one."""
    _, number = np.unique(_keys(np.rint(part.vertices * 1e4).astype(np.int64)), return_inverse=True)
    _, first = np.unique(_keys(np.sort(number[part.faces], axis=1)), return_index=True)
    return dataclasses.replace(part, faces=part.faces[np.sort(first)])


def _keys(rows: Int[np.ndarray, "n 3"]) -> Int[np.ndarray, "n"]:
    """A number for each row, the same for the same rows, since `np.unique` of rows is slow. Values spread over less
    than 2 million: 200 m in tenths of a millimetre."""
    low = rows.min(axis=0)
    _, y, z = rows.max(axis=0) - low + 1
    return ((rows[:, 0] - low[0]) * y + rows[:, 1] - low[1]) * z + rows[:, 2] - low[2]


class Builder:
    """What a home is decorated with. `add` takes triangles of a material, `paint` those of a plain colour.

    Attributes:
      fine: with parts that are `SMALL`, both sides of what is thin, and walls in pieces; else for small images, of
        renderers that compute light for each pixel and show both sides of a triangle.
    """

    def __init__(self, fine: bool = True):
        self.fine = fine
        self.parts: dict[Material, list[Triangles]] = {}
        self._colours: dict[Colour, int] = {}
        self._painted: list[Triangles] = []

    def add(self, material: Material, *parts: Triangles) -> None:
        """Adds triangles that show a material."""
        self.parts.setdefault(material, []).extend(self._shown(parts))

    def paint(self, colour: Colour, *parts: Triangles) -> None:
        """Adds triangles of a plain colour (rgb, 0..1)."""
        key = tuple(round(float(c) * 31) / 31 for c in colour)
        number = self._colours.setdefault((key[0], key[1], key[2]), len(self._colours))
        if number >= CELLS * CELLS:
            number = min(
                range(CELLS * CELLS),
                key=lambda k: sum((a - b) ** 2 for a, b in zip(list(self._colours)[k], key, strict=True)),
            )
        at = (np.array([number % CELLS, number // CELLS]) + 0.5) / CELLS
        self._painted += [dataclasses.replace(p, uv=np.tile(at, (len(p.vertices), 1))) for p in self._shown(parts)]

    def _shown(self, parts: Iterable[Triangles]) -> list[Triangles]:
        if self.fine:
            return list(parts)
        seen = ((p, float(np.ptp(p.vertices, axis=0).max())) for p in parts)
        return [_boxed(p) if size < BLURRED else _one_sided(p) for p, size in seen if size >= SMALL]

    def meshes(self) -> list[tuple[Material, Triangles]]:
        """One mesh for each material."""
        found = [(material, joined(parts)) for material, parts in self.parts.items() if parts]
        if self._painted:
            squares = np.zeros((CELLS * CELLS, 3))
            squares[: min(len(self._colours), CELLS * CELLS)] = list(self._colours)[: CELLS * CELLS]
            image = squares.reshape(CELLS, CELLS, 3).repeat(4, 0).repeat(4, 1)
            found.append((Material("colours", image, specular=0.1, shininess=0.2), joined(self._painted)))
        return found
