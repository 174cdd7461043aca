"""Stable orientations of an object on a level floor (metadata.json `orientations`), computed with trimesh."""

from __future__ import annotations

import dataclasses

import numpy as np
import shapely
import trimesh

from .model import HouseholdObject, hull_mesh

MIN_PROBABILITY = 0.03  # stable poses under this probability are dropped, as in iGibson
MOST = 8
STANDING = 0.7  # probability that a "standing" object stands
SOLE = (0.02, 0.004)  # points this close to the lowest carry it: at most this part of its length, and at most so many m


@dataclasses.dataclass
class Orientation:
    """quat x, y, z, w; size: the box that the object fills when it is put down so, metres."""

    quat: tuple[float, float, float, float]
    prob: float
    size: tuple[float, float, float]


def centre_of_mass(model: HouseholdObject) -> np.ndarray:
    """Where a simulator that reads the collision meshes puts it; joints at 0, in the base frame, metres.

    Hulls count at equal density. Where those of a link share vertices, so that its mesh is not watertight, iGibson's
    rule takes the centre of the surface (`link_com` of the converter): that decides what is stable there.
    """
    total, moment = 0.0, np.zeros(3)
    for link in model.links:
        hulls = [hull_mesh(points) for points in link.hulls]
        volumes = np.array([mesh.volume for mesh in hulls])
        meshes = [hull_mesh(np.asarray(points).round(6)) for points in link.hulls]
        offsets = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
        written = trimesh.Trimesh(
            np.concatenate([mesh.vertices for mesh in meshes]),
            np.concatenate([mesh.faces + k for mesh, k in zip(meshes, offsets, strict=False)]),
        )
        if written.is_watertight:
            share = np.zeros(3)
            for volume, mesh in zip(volumes, hulls, strict=True):
                share += volume * (np.asarray(mesh.center_mass) + link.origin)
        else:
            share = volumes.sum() * (np.asarray(written.centroid) + link.origin)
        total += volumes.sum()
        moment += share
    return moment / total


def stable_orientations(model: HouseholdObject) -> list[Orientation]:
    """How the model can be put down, by its `rest`, the most likely first.

    "upright": only as built. "any": the stable poses of its hull with their probabilities. "standing": the same, but
    it stands as built seven times out of ten (a bottle), as iGibson's labels do by hand.
    """
    low, high = model.bounds()
    upright = Orientation((0.0, 0.0, 0.0, 1.0), 1.0, _three(high - low))
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
        found.append(Orientation((x, y, z, w), float(prob), _three(np.ptp(moved, axis=0))))
    found.sort(key=lambda o: (-round(o.prob, 6), tuple(round(q, 6) for q in o.quat)))
    found = found[:MOST] or [upright]
    if model.rest == "standing" and stands(model):
        others = [o for o in found if abs(o.quat[3]) < 1 - 1e-9][: MOST - 1]
        share = (1 - STANDING) / max(sum(o.prob for o in others), 1e-9)
        lying = [dataclasses.replace(o, prob=o.prob * share) for o in others]
        found = [dataclasses.replace(upright, prob=STANDING if lying else 1.0)]
        found += [o for o in lying if o.prob >= MIN_PROBABILITY]
    return found


def stands(model: HouseholdObject) -> bool:
    """Whether the model stays as built on a level floor: its centre of mass lies over the polygon it stands on."""
    cloud = np.concatenate([points + link.origin for link in model.links for points in link.hulls])
    sole = min(SOLE[0] * float(np.ptp(cloud, axis=0).max()), SOLE[1])
    foot = cloud[cloud[:, 2] < cloud[:, 2].min() + sole]
    polygon = shapely.MultiPoint(foot[:, :2]).convex_hull
    centre = shapely.Point(centre_of_mass(model)[:2])
    return bool(polygon.buffer(1e-6).contains(centre))


def _three(values: np.ndarray) -> tuple[float, float, float]:
    x, y, z = (float(v) for v in values)
    return (x, y, z)


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
