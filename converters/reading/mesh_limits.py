"""Checks that every mesh reader makes, and the error of a mesh that cannot be used."""

from __future__ import annotations

import numpy as np

from ig2mj.errors import InputError

from ..base.read_limits import check_limit

MAX_COORDINATE = 1e7
"""Of a vertex, in the file's own unit: 10 km in millimetres."""


class MeshError(InputError):
    """A geometry, or a mesh file's content, cannot be used: fatal for a collision, a warning for a visual."""


def check_vertices(vertices: np.ndarray, file: object) -> None:
    """Raises MeshError where a vertex is not finite, or so far away that the file must be broken."""
    if not np.all(np.isfinite(vertices)):
        raise MeshError(file, "has a vertex that is not finite")
    if len(vertices) and (far := float(np.abs(vertices).max())) > MAX_COORDINATE:
        raise MeshError(file, f"has a vertex {far:.3g} units away, the limit is {MAX_COORDINATE:.0e}")


def check_faces(count: int, file: object) -> None:
    """Raises MeshError for more triangles than `ReadLimits.mesh_faces`."""
    check_limit("mesh_faces", count, file, "faces", fix="simplify the mesh, for example in Blender", error=MeshError)
