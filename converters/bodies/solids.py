"""Volume, centre and spread of solids, exact for triangle meshes and primitives."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence

import numpy as np
import trimesh
from scipy.spatial import ConvexHull, QhullError

from ..base.description import Mesh, Shape
from ..base.transforms import apply

THIN = 1e-3  # m: thickness a flat mesh is given


@dataclasses.dataclass
class SolidMoments:
    """volume m^3, centre [3] m, covariance [3, 3] m^2: the mean of (x - centre)(x - centre)^T over the volume."""

    volume: float
    centre: np.ndarray
    covariance: np.ndarray

    def inertia(self, mass: float) -> np.ndarray:
        """[3, 3] kg m^2 about the centre, for a mass spread evenly."""
        return mass * inertia_of(self.covariance)


def inertia_of(covariance: np.ndarray) -> np.ndarray:
    """Inertia per mass [3, 3] of a covariance. Its own inverse up to the trace: see `covariance_of`."""
    return np.trace(covariance) * np.eye(3) - covariance


def covariance_of(inertia: np.ndarray) -> np.ndarray:
    """mass x covariance [3, 3] of an inertia tensor about the centre of mass."""
    return 0.5 * np.trace(inertia) * np.eye(3) - inertia


def joined(meshes: Sequence[Mesh]) -> trimesh.Trimesh:
    """One trimesh of all groups, equal vertices merged, as `trimesh.load(..., force="mesh")` gives it."""
    offsets = np.cumsum([0, *(len(m.vertices) for m in meshes)])
    return trimesh.Trimesh(
        np.concatenate([m.vertices for m in meshes]),
        np.concatenate([m.faces + o for m, o in zip(meshes, offsets, strict=False)]),
        process=True,
    )


def signed_volume(body: trimesh.Trimesh) -> float:
    """Volume by the divergence theorem, m^3 (trimesh's own divides by it to get at the centre, even where it is 0)."""
    a, b, c = np.moveaxis(np.asarray(body.triangles, dtype=float), 1, 0)
    return float(np.einsum("ij,ij->", a, np.cross(b, c))) / 6.0


def hull_volume(mesh: Mesh) -> float:
    """Volume of the convex hull; 0 of a flat mesh."""
    hull = _hull(mesh.vertices)
    return 0.0 if hull is None else signed_volume(hull)


def shape_solids(shape: Shape) -> list[SolidMoments]:
    """Solids of a baked shape (scale 1) in its link's frame.

    A mesh gives one hull per `o`/`g` group; without groups itself if it is watertight, else its hull. A flat mesh
    gives a plate `THIN` thick.
    """
    rotation = shape.pose[:3, :3]
    if shape.kind == "mesh":
        placed = [Mesh(apply(shape.pose, m.vertices), m.faces) for m in shape.meshes]
        return [_mesh_solid(m, hull=shape.grouped) for m in placed]
    volume, spread = _primitive(shape)
    return [SolidMoments(volume, shape.pose[:3, 3].copy(), rotation @ np.diag(spread) @ rotation.T)]


def combine(solids: Sequence[SolidMoments]) -> SolidMoments | None:
    """All solids as one of even density, overlaps counted twice; None for no volume."""
    volume = sum(s.volume for s in solids)
    if volume <= 0:
        return None
    centre = np.sum([s.volume * s.centre for s in solids], axis=0) / volume
    covariance = np.zeros((3, 3))
    for s in solids:
        arm = s.centre - centre
        covariance += s.volume / volume * (s.covariance + np.outer(arm, arm))
    return SolidMoments(volume, centre, covariance)


def _primitive(shape: Shape) -> tuple[float, list[float]]:
    """(volume, variances along the shape's own axes)."""
    if shape.kind == "box":
        return math.prod(shape.size), [length**2 / 12 for length in shape.size]
    r = shape.size[0]
    ball = 4 / 3 * math.pi * r**3
    if shape.kind == "sphere":
        return ball, [r**2 / 5] * 3
    length = shape.size[1]
    tube = math.pi * r**2 * length
    if shape.kind == "cylinder":
        return tube, [r**2 / 4, r**2 / 4, length**2 / 12]
    # A capsule's half balls have their mean 3/8 r beyond the tube's ends.
    across = (tube * r**2 / 4 + ball * r**2 / 5) / (tube + ball)
    along = (tube * length**2 / 12 + ball * (length**2 / 4 + 3 / 8 * length * r + r**2 / 5)) / (tube + ball)
    return tube + ball, [across, across, along]


def _mesh_solid(mesh: Mesh, hull: bool) -> SolidMoments:
    body = None if hull else joined([mesh])
    if body is None or not body.is_watertight or signed_volume(body) <= 0:
        body = _hull(mesh.vertices)
    if body is None:
        return _plate(mesh)
    centre = np.asarray(body.center_mass)
    return SolidMoments(float(body.volume), centre, covariance_of(np.asarray(body.moment_inertia)) / body.volume)


def _plate(mesh: Mesh) -> SolidMoments:
    """A flat or broken mesh as a plate: its surface, `THIN` thick."""
    corners = mesh.vertices[mesh.faces]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
    total = max(float(area.sum()), 1e-12)
    centre = np.einsum("i,ij->j", area, corners.mean(axis=1)) / total if area.sum() > 0 else corners.mean(axis=(0, 1))
    arms = corners - centre
    middle = arms.mean(axis=1)
    # A triangle's second moment: (sum of corner products + 9 x mean product) / 12.
    second = (np.einsum("fki,fkj->fij", arms, arms) + 9 * np.einsum("fi,fj->fij", middle, middle)) / 12
    covariance = np.einsum("f,fij->ij", area, second) / total + THIN**2 / 12 * np.eye(3)
    return SolidMoments(total * THIN, centre, covariance)


def _hull(points: np.ndarray) -> trimesh.Trimesh | None:
    """Convex hull, or None of flat points."""
    try:
        hull = ConvexHull(points)
    except (QhullError, ValueError):
        return None
    if hull.volume <= 1e-9 * float(np.linalg.norm(np.ptp(points, axis=0))) ** 3:
        return None
    corners = points[hull.simplices]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    inwards = np.einsum("ij,ij->i", normals, hull.equations[:, :3]) < 0
    faces = np.where(inwards[:, None], hull.simplices[:, ::-1], hull.simplices)
    return trimesh.Trimesh(points, faces, process=True)
