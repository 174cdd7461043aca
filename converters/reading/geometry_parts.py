"""Triangles as the readers of DAE and glTF find them, and how instances of them become parts of a mesh file."""

from __future__ import annotations

import dataclasses
import pathlib
from collections.abc import Sequence

import numpy as np

from ..base.description import Mesh, Rgba
from ..base.file_access import FileGuard
from .looks import SurfaceLook, Texture, TextureReader, mean_vertex_colour
from .mesh_limits import MeshError, check_faces, check_vertices

Y_UP = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
"""Turns a file whose y axis points up to Z up."""


@dataclasses.dataclass
class MeshPart:
    """Triangles with one look. uv: [n, 2] of the one mesh, origin at the image's lower left, as in OBJ."""

    meshes: list[Mesh]
    rgba: Rgba | None = None
    texture: Texture | None = None
    uv: list[np.ndarray] | None = None


@dataclasses.dataclass(eq=False)
class Geometry:
    """Triangles of one primitive in its own frame, as the file has them.

    Attributes:
      vertices: [n, 3]. faces: [m, 3] of vertex indices. uv: [n, 2], origin at the lower left, or None.
      colours: [n, 3] or [n, 4] of vertices, 0..1, or None.
    """

    vertices: np.ndarray
    faces: np.ndarray
    uv: np.ndarray | None = None
    colours: np.ndarray | None = None


@dataclasses.dataclass
class PlacedGeometry:
    """An instance of a geometry. matrix: 4x4 into the file's frame. look: what its material says."""

    geometry: Geometry
    matrix: np.ndarray
    look: SurfaceLook = dataclasses.field(default_factory=SurfaceLook)


@dataclasses.dataclass(frozen=True, eq=False)
class MeshSource:
    """What a reader of a mesh format gets.

    Attributes:
      raw: bytes of the file. guard: resolves names of further files. textures: reads looks; None: they are passed over.
    """

    raw: bytes
    file: pathlib.Path
    guard: FileGuard
    textures: TextureReader | None


@dataclasses.dataclass(eq=False)
class MeshContent:
    """What a reader finds.

    Attributes:
      placed: instances of geometries. turn: 4x4 from the file's unit and axes to metres and Z up.
      lost: what could not be read while the rest could.
    """

    placed: list[PlacedGeometry]
    turn: np.ndarray = dataclasses.field(default_factory=lambda: np.eye(4))
    lost: list[str] = dataclasses.field(default_factory=list)


def parts_of(
    placed: Sequence[PlacedGeometry], turn: np.ndarray, file: pathlib.Path, textures: TextureReader | None
) -> list[MeshPart]:
    """One part per instance, vertices merged and moved by `turn` @ its matrix; instances without faces are left out.

    Args:
      turn: 4x4 from the file's frame to metres and Z up. textures: warns of what is lost of looks; None: no looks.

    Raises:
      MeshError: no faces at all, a face without vertex, vertices that are not finite, too many faces.
    """
    check_faces(sum(len(instance.geometry.faces) for instance in placed), file)
    merged: dict[tuple[int, bool], tuple[Mesh, np.ndarray | None] | None] = {}
    parts = []
    for instance in placed:
        look = _look(instance, textures, file)
        key = (id(instance.geometry), look.texture is not None)
        if key not in merged:
            merged[key] = _merged(instance.geometry, look.texture is not None, file)
        if (found := merged[key]) is None:
            continue
        mesh, uv = found
        matrix = turn @ instance.matrix
        check_vertices(matrix, file)
        faces = mesh.faces[:, ::-1] if np.linalg.det(matrix[:3, :3]) < 0 else mesh.faces
        moved = Mesh(mesh.vertices @ matrix[:3, :3].T + matrix[:3, 3], faces)
        parts.append(MeshPart([moved], look.rgba, look.texture, None if uv is None else [uv]))
    if not parts:
        raise MeshError(file, "is empty: it has no faces")
    return parts


def _look(instance: PlacedGeometry, textures: TextureReader | None, file: pathlib.Path) -> SurfaceLook:
    if textures is None:
        return SurfaceLook()
    geometry, look = instance.geometry, instance.look
    if look.texture is not None and (geometry.uv is None or not np.all(np.isfinite(geometry.uv))):
        look = textures.flat(look)
    if look == SurfaceLook() and geometry.colours is not None and len(geometry.colours):
        rgba, vary = mean_vertex_colour(geometry.colours)
        if vary:
            textures.warn(f"{file.name} has colours per vertex: their mean colour is used")
        look = SurfaceLook(rgba)
    return look


def _merged(geometry: Geometry, with_uv: bool, file: pathlib.Path) -> tuple[Mesh, np.ndarray | None] | None:
    """Equal vertices made one (files repeat them per face), degenerate triangles dropped; None where none is left."""
    vertices = np.asarray(geometry.vertices, dtype=float)
    faces = np.asarray(geometry.faces, dtype=np.int64)
    if not len(faces):
        return None
    check_vertices(vertices, file)
    if faces.min() < 0 or faces.max() >= len(vertices):
        raise MeshError(file, "a face names a vertex that does not exist")
    rows = vertices if not with_uv or geometry.uv is None else np.column_stack([vertices, geometry.uv])
    used, index = np.unique(rows, axis=0, return_inverse=True)
    faces = index.reshape(-1)[faces]
    a, b, c = faces.T
    faces = faces[(a != b) & (b != c) & (c != a)]
    if not len(faces):
        return None
    return Mesh(np.ascontiguousarray(used[:, :3]), faces), used[:, 3:] if used.shape[1] > 3 else None
