"""Stable orientations of an object on a level floor (metadata.json `orientations`), computed with trimesh."""

from __future__ import annotations

import dataclasses

import numpy as np
import trimesh

from .model import HouseholdObject, hull_mesh

MIN_PROBABILITY = 0.03  # states.md section 3: stable poses under this probability are dropped
MOST = 8


@dataclasses.dataclass
class Orientation:
    """quat x, y, z, w; size: the box that the object fills when it is put down so, metres."""

    quat: tuple[float, float, float, float]
    prob: float
    size: tuple[float, float, float]


def centre_of_mass(model: HouseholdObject) -> np.ndarray:
    """Of all collision hulls at equal density, joints at 0, in the base frame."""
    total, moment = 0.0, np.zeros(3)
    for link in model.links:
        for points in link.hulls:
            mesh = hull_mesh(points)
            total += mesh.volume
            moment += mesh.volume * (np.asarray(mesh.center_mass) + link.origin)
    return moment / total


def stable_orientations(model: HouseholdObject) -> list[Orientation]:
    """Identity for things that stand as built; else the stable poses of the hull, most probable first."""
    low, high = model.bounds()
    upright = Orientation((0.0, 0.0, 0.0, 1.0), 1.0, tuple(high - low))
    if model.rest == "upright":
        return [upright]
    cloud = np.concatenate([points + link.origin for link in model.links for points in link.hulls])
    shape = trimesh.convex.convex_hull(cloud)
    matrices, probs = trimesh.poses.compute_stable_poses(
        shape, center_mass=centre_of_mass(model), sigma=0.0, n_samples=1, threshold=MIN_PROBABILITY
    )
    found = []
    for matrix, prob in zip(matrices, probs, strict=True):
        turn = _without_yaw(np.array(matrix)[:3, :3])
        moved = cloud @ turn.T
        w, x, y, z = trimesh.transformations.quaternion_from_matrix(_matrix4(turn))
        found.append(Orientation((x, y, z, w), float(prob), tuple(np.ptp(moved, axis=0))))
    found.sort(key=lambda o: (-round(o.prob, 6), tuple(round(q, 6) for q in o.quat)))
    return found[:MOST] or [upright]


def _without_yaw(turn: np.ndarray) -> np.ndarray:
    """The smallest rotation that brings the same direction of the object down; identity when it already is."""
    down = turn.T @ np.array([0.0, 0.0, -1.0])
    if down[2] < -1 + 1e-9:
        return np.eye(3)
    if down[2] > 1 - 1e-9:
        return np.diag([1.0, -1.0, -1.0])
    return np.array(trimesh.geometry.align_vectors(down, (0.0, 0.0, -1.0)))[:3, :3]


def _matrix4(turn: np.ndarray) -> np.ndarray:
    matrix = np.eye(4)
    matrix[:3, :3] = turn
    return matrix
