"""Points on the surfaces of pieces, drawn evenly by area, with outward normals: where dust and stains may sit.

`SurfaceTable` is made once from the pieces' shapes, and `sample_surface` draws from it, both on the host. Round pieces
are represented by triangles whose corners lie on them, so sampled points lie up to 0.5 % of the radius below the round
surface.
"""

from __future__ import annotations

import dataclasses

import numpy as np
from jaxtyping import Float, Int

from ig2mj.geometry.hulls import signed_depth
from ig2mj.geometry.poses import matrices_on_host
from ig2mj.scene.tables import PieceKind, SceneTables

SEGMENTS = 32
"""Around a round piece; 1 - cos(pi / 32) = 0.5 %."""

BURIED = 1e-4
"""Metres below the surface of another piece at which a point counts as covered by it."""


@dataclasses.dataclass(frozen=True, eq=False)
class SurfaceTable:
    """Triangles of some pieces in one common frame.

    Attributes:
      corners: three corners each, counter-clockwise seen from outside. normals: unit, outward. piece: position of the
      piece, in the list the table was made of, that the triangle belongs to. cumulative: area of this triangle and
      all before it, over the whole area. area: whole, square metres.
    """

    corners: Float[np.ndarray, "T 3 3"]
    normals: Float[np.ndarray, "T 3"]
    piece: Int[np.ndarray, "T"]
    cumulative: Float[np.ndarray, "T"]
    area: float


@dataclasses.dataclass(frozen=True, eq=False)
class SurfaceSample:
    """Points with outward unit normals, in the frame of the table, and the piece each lies on."""

    points: Float[np.ndarray, "n 3"]
    normals: Float[np.ndarray, "n 3"]
    piece: Int[np.ndarray, "n"]


def surface_table(
    kind: Int[np.ndarray, "K"],
    size: Float[np.ndarray, "K 3"],
    vertices: Float[np.ndarray, "K V 3"],
    pos: Float[np.ndarray, "K 3"],
    quat: Float[np.ndarray, "K 4"],
) -> SurfaceTable:
    """Triangles of K >= 1 pieces, posed by `pos` and `quat` in the common frame (a body's, an object's)."""
    assert len(kind) > 0, "a surface needs at least one piece"
    turn = matrices_on_host(quat)
    corners, piece = [], []
    for k in range(len(kind)):
        points = _outline(PieceKind(kind[k]), np.asarray(size[k], np.float64), np.asarray(vertices[k], np.float64))
        triangles = _hull_triangles(points)
        corners.append(triangles @ turn[k].T + pos[k])
        piece.append(np.full(len(triangles), k))
    triangles = np.concatenate(corners)
    product = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    twice = np.linalg.norm(product, axis=-1)
    real = twice > 0.0
    cumulative = np.cumsum(twice[real])
    return SurfaceTable(
        corners=triangles[real],
        normals=product[real] / twice[real, None],
        piece=np.concatenate(piece)[real],
        cumulative=cumulative / cumulative[-1],
        area=float(cumulative[-1] / 2),
    )


def object_surfaces(tables: SceneTables, obj: int) -> dict[int, SurfaceTable]:
    """Surfaces of an object's bodies that have pieces, each in its body's frame, by body."""
    mine = tables.piece_object == obj
    columns = (tables.piece_kind, tables.piece_size, tables.piece_vertices, tables.piece_pos, tables.piece_quat)
    return {
        int(body): surface_table(*(column[mine & (tables.piece_body == body)] for column in columns))
        for body in np.unique(tables.piece_body[mine])
    }


def sample_surface(table: SurfaceTable, count: int, rng: np.random.Generator) -> SurfaceSample:
    """`count` points, evenly by area. Pieces' faces inside other pieces count too; see `uncovered`."""
    triangle = np.minimum(np.searchsorted(table.cumulative, rng.random(count), side="right"), len(table.cumulative) - 1)
    weights = _barycentric(rng.random((count, 2)))
    points = np.einsum("nc,ncx->nx", weights, table.corners[triangle])
    return SurfaceSample(points, table.normals[triangle], table.piece[triangle])


def uncovered(
    sample: SurfaceSample,
    kind: Int[np.ndarray, "K"],
    size: Float[np.ndarray, "K 3"],
    planes: Float[np.ndarray, "K N 4"],
    pos: Float[np.ndarray, "K 3"],
    quat: Float[np.ndarray, "K 4"],
) -> SurfaceSample:
    """Those points of a sample that lie in no other of the K pieces: a decomposed object's real outside."""
    turn = matrices_on_host(quat)
    local = np.einsum("knx,kxy->kny", sample.points[None] - pos[:, None], turn).astype(np.float32)
    depth = np.asarray(signed_depth(kind[:, None], size[:, None], planes[:, None], local))
    covered = (depth > BURIED) & (sample.piece[None] != np.arange(len(kind))[:, None])
    kept = ~np.any(covered, axis=0)
    return SurfaceSample(sample.points[kept], sample.normals[kept], sample.piece[kept])


def _barycentric(uv: Float[np.ndarray, "n 2"]) -> Float[np.ndarray, "n 3"]:
    """Even weights of a triangle's corners from even numbers in the unit square: the far half is folded over."""
    folded = np.where(uv.sum(axis=-1, keepdims=True) > 1.0, 1.0 - uv, uv)
    return np.concatenate([1.0 - folded.sum(axis=-1, keepdims=True), folded], axis=-1)


def _outline(
    kind: PieceKind, size: Float[np.ndarray, "3"], vertices: Float[np.ndarray, "V 3"]
) -> Float[np.ndarray, "M 3"]:
    """Points whose convex hull stands for the piece."""
    if kind is PieceKind.POLYHEDRON:
        return np.unique(vertices, axis=0)
    angle = np.arange(SEGMENTS) * (2 * np.pi / SEGMENTS)
    ring = np.stack([np.cos(angle), np.sin(angle), np.zeros(SEGMENTS)], axis=-1)
    if kind is PieceKind.CYLINDER:
        return np.concatenate([size[0] * ring + [0, 0, end * size[1]] for end in (-1, 1)])
    shift = 0.0 if kind is PieceKind.SPHERE else size[1]
    polar = np.linspace(-np.pi / 2, np.pi / 2, SEGMENTS // 2 + 1)
    balls = []
    for latitude in polar:
        circle = size[0] * (np.cos(latitude) * ring + [0, 0, np.sin(latitude)])
        ends = (np.sign(latitude),) if abs(latitude) > 1e-9 else (-1.0, 1.0)
        balls += [circle + np.array([0, 0, end * shift]) for end in ends]
    return np.unique(np.concatenate(balls).round(12), axis=0)


def _hull_triangles(points: Float[np.ndarray, "M 3"]) -> Float[np.ndarray, "T 3 3"]:
    """Triangles of the convex hull, counter-clockwise from outside."""
    import scipy.spatial  # takes as long as all of this package

    try:
        hull = scipy.spatial.ConvexHull(points)
    except scipy.spatial.QhullError:
        hull = scipy.spatial.ConvexHull(points, qhull_options="QJ")  # nearly flat: joggle
    triangles = points[hull.simplices]
    product = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    inward = np.sum(product * hull.equations[:, :3], axis=-1) < 0.0
    triangles[inward] = triangles[inward][:, [0, 2, 1]]
    return triangles
