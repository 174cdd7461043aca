"""Mesh and Solid: visual meshes together with collision hulls. The bricks themselves are in solids.py and turned.py."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable, Sequence

import numpy as np
import trimesh

Vec = Sequence[float] | np.ndarray  # three numbers
AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}


@dataclasses.dataclass
class Mesh:
    """Triangles of a visual. vertices [n, 3], faces [m, 3]; uv [m, 3, 2] per face corner, or None: box mapping."""

    vertices: np.ndarray
    faces: np.ndarray
    uv: np.ndarray | None = None

    def moved(self, matrix: np.ndarray) -> Mesh:
        vertices = self.vertices @ matrix[:3, :3].T + matrix[:3, 3]
        flip = np.linalg.det(matrix[:3, :3]) < 0
        faces = self.faces[:, ::-1] if flip else self.faces
        uv = self.uv[:, ::-1] if flip and self.uv is not None else self.uv
        return Mesh(vertices, faces, uv)


@dataclasses.dataclass(frozen=True)
class Solid:
    """A shape: `visuals` are drawn, `hulls` are point sets [n, 3] whose convex hulls collide."""

    visuals: tuple[Mesh, ...] = ()
    hulls: tuple[np.ndarray, ...] = ()

    def __add__(self, other: Solid) -> Solid:
        return Solid(self.visuals + other.visuals, self.hulls + other.hulls)

    def moved(self, matrix: np.ndarray) -> Solid:
        """Transformed by a 4x4 matrix."""
        hulls = tuple(points @ matrix[:3, :3].T + matrix[:3, 3] for points in self.hulls)
        return Solid(tuple(mesh.moved(matrix) for mesh in self.visuals), hulls)

    def at(self, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Solid:
        matrix = np.eye(4)
        matrix[:3, 3] = (x, y, z)
        return self.moved(matrix)

    def turned(self, axis: str, degrees: float) -> Solid:
        """Rotated about a coordinate axis through the origin."""
        return self.moved(trimesh.transformations.rotation_matrix(math.radians(degrees), AXES[axis]))

    def scaled(self, x: float = 1.0, y: float = 1.0, z: float = 1.0) -> Solid:
        return self.moved(np.diag([x, y, z, 1.0]))

    def mirrored(self, axis: str) -> Solid:
        return self.scaled(**{axis: -1.0})

    def visual_only(self) -> Solid:
        """Only the visuals: a detail that nothing touches."""
        return Solid(self.visuals, ())

    def collision_only(self) -> Solid:
        """Only the collision hulls."""
        return Solid((), self.hulls)

    def points(self) -> np.ndarray:
        """All points [n, 3] of hulls and visuals."""
        return np.concatenate([*self.hulls, *(mesh.vertices for mesh in self.visuals)])


def join(solids: Iterable[Solid]) -> Solid:
    total = Solid()
    for solid in solids:
        total += solid
    return total
