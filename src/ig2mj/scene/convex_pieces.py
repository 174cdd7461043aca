"""Convex collision pieces of a compiled model: the half-spaces and corners of `SceneTables.piece_*`.

All in the geom's own frame as MuJoCo compiled it: the compiler moves a mesh to its centre of inertia and principal axes
and moves the geom's pose the other way, so the compiled vertices and the compiled geom pose belong together.
"""

from __future__ import annotations

import dataclasses
import pathlib

import mujoco
import numpy as np

from ig2mj.scene.kept_hulls import hulls_of
from ig2mj.scene.tables import PieceKind

SAME_FACET = 1e-3
"""Facets whose unit normals differ by less are one facet: triangles of one flat side, not a design choice."""

SUPPORTED = {
    mujoco.mjtGeom.mjGEOM_SPHERE: PieceKind.SPHERE,
    mujoco.mjtGeom.mjGEOM_CAPSULE: PieceKind.CAPSULE,
    mujoco.mjtGeom.mjGEOM_CYLINDER: PieceKind.CYLINDER,
    mujoco.mjtGeom.mjGEOM_BOX: PieceKind.POLYHEDRON,
    mujoco.mjtGeom.mjGEOM_MESH: PieceKind.POLYHEDRON,
}


@dataclasses.dataclass(frozen=True)
class ConvexPiece:
    """One convex piece in its own frame.

    planes [n, 4]: half-spaces (nx, ny, nz, d) with n.x <= d, unit normals; empty for round primitives.
    vertices [v, 3]: corners; of a round primitive the corners of its box.
    """

    kind: PieceKind
    planes: np.ndarray
    vertices: np.ndarray


def hull_planes(vertices: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Half-spaces and corners of the convex hull of points [n, 3]; triangles of one flat side give one half-space.

    Every point lies inside every half-space: distances are those of the farthest point.

    Returns:
      planes [m, 4], corners [k, 3] in the order of `vertices`.
    """
    import scipy.spatial  # not needed where hulls are known

    try:
        hull = scipy.spatial.ConvexHull(vertices)
    except scipy.spatial.QhullError:
        hull = scipy.spatial.ConvexHull(vertices, qhull_options="QJ")  # nearly flat: joggle
    corners = vertices[np.sort(hull.vertices)]
    normals = hull.equations[:, :3]
    # A union-find would chain gently curved sides into one facet; comparing with the group's first member does not.
    kept: list[np.ndarray] = []
    for normal in normals:
        if not kept or np.min(np.max(np.abs(np.asarray(kept) - normal), axis=1)) > SAME_FACET:
            kept.append(normal)
    planes = np.array(kept)
    return np.concatenate([planes, np.max(planes @ corners.T, axis=1, keepdims=True)], 1), corners


def mesh_corners(model: mujoco.MjModel, mesh: int) -> np.ndarray:
    """Vertices [v, 3] that MuJoCo collides with: those of its convex hull, where it has one, else all."""
    start, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
    vertices = np.asarray(model.mesh_vert[start : start + count], np.float64)
    graph = model.mesh_graphadr[mesh]
    if graph < 0:
        return vertices
    number = model.mesh_graph[graph]  # layout: numvert, numface, edge address per vertex, vertex ids, ...
    return vertices[np.sort(model.mesh_graph[graph + 2 + number : graph + 2 + 2 * number])]


def _box_piece(half: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    signs = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1], indexing="ij")).reshape(3, 8).T
    planes = np.concatenate([np.concatenate([np.eye(3), -np.eye(3)]), np.tile(half, 2)[:, None]], 1)
    return planes, signs * half


def make_convex_pieces(model: mujoco.MjModel, geoms: np.ndarray) -> list[ConvexPiece]:
    """Pieces of the given geoms [K], in their order.

    Raises:
      ValueError: a geom is not a convex solid (plane, height field, ellipsoid, SDF); the message is its name.
    """
    of_mesh = [int(model.geom_dataid[g]) for g in geoms if model.geom_type[g] == mujoco.mjtGeom.mjGEOM_MESH]
    meshes = list(dict.fromkeys(of_mesh))
    hulls = hulls_of([mesh_corners(model, mesh) for mesh in meshes], hull_planes, pathlib.Path(__file__))
    known, pieces = dict(zip(meshes, hulls, strict=True)), []
    for geom in geoms:
        shape, size = mujoco.mjtGeom(int(model.geom_type[geom])), np.asarray(model.geom_size[geom])
        kind = SUPPORTED.get(shape)
        if kind is None:
            raise ValueError(model.geom(geom).name)
        if shape == mujoco.mjtGeom.mjGEOM_MESH:
            planes, vertices = known[int(model.geom_dataid[geom])]
        else:
            radius = size[0]
            half = {
                mujoco.mjtGeom.mjGEOM_SPHERE: np.array([radius, radius, radius]),
                mujoco.mjtGeom.mjGEOM_CAPSULE: np.array([radius, radius, radius + size[1]]),
                mujoco.mjtGeom.mjGEOM_CYLINDER: np.array([radius, radius, size[1]]),
            }.get(shape, size)
            planes, vertices = _box_piece(half)
            if kind != PieceKind.POLYHEDRON:
                planes = np.zeros((0, 4))
        pieces.append(ConvexPiece(kind, planes, vertices))
    return pieces
