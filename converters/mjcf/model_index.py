"""Which bodies, geoms, joints and degrees of freedom of a compiled model belong to which object of the manifest."""

from __future__ import annotations

import dataclasses

import mujoco
import numpy as np

from ig2mj.scene.manifest import Manifest


@dataclasses.dataclass(frozen=True)
class ModelIndex:
    """Numbers per element of the model; -1: no object (the world, an agent, the parking slab).

    Attributes:
      names: object names, the manifest's order.
      body_object, geom_object: [nbody], [ngeom] object number.
      body_root, geom_root: [nbody], [ngeom] number of the root body of the kinematic tree (an object split at
        floating joints has several trees), -1 outside objects.
      roots: per object its root bodies, the main one first.
      solid: [ngeom] bool, the geom collides. link: [ngeom] bool, it is an annotated link (a blade, say).
      joints: per object its hinge and slide joints.
    """

    names: list[str]
    body_object: np.ndarray
    body_root: np.ndarray
    geom_object: np.ndarray
    geom_root: np.ndarray
    roots: list[list[int]]
    solid: np.ndarray
    link: np.ndarray
    joints: list[list[int]]

    def name(self, number: int) -> str:
        return self.names[number] if number >= 0 else "(no object)"


def index_model(model: mujoco.MjModel, manifest: Manifest) -> ModelIndex:
    """Raises ValueError where the manifest names a body that the model does not have."""
    body_object = np.full(model.nbody, -1)
    body_root = np.full(model.nbody, -1)
    roots: list[list[int]] = []
    for number, entry in enumerate(manifest.objects):
        own = []
        for name in entry.bodies:
            body = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, name)
            if body < 0:
                raise ValueError(f"object '{entry.name}' names the body '{name}', which the model does not have")
            body_object[body], body_root[body] = number, body
            own.append(body)
        roots.append(own)
    for body in range(1, model.nbody):
        if body_object[body] < 0:
            parent = model.body_parentid[body]
            body_object[body], body_root[body] = body_object[parent], body_root[parent]
    geom_object, geom_root = body_object[model.geom_bodyid], body_root[model.geom_bodyid]
    solid = (model.geom_contype != 0) | (model.geom_conaffinity != 0)
    annotated = np.zeros(model.ngeom, bool)
    for entry in manifest.objects:
        for link in entry.links.values():
            geom = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_GEOM, link.geom) if link.geom else -1
            if geom >= 0:
                annotated[geom] = True
    joints: list[list[int]] = [[] for _ in manifest.objects]
    turning = np.isin(model.jnt_type, [int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE)])
    for joint in np.flatnonzero(turning):
        owner = body_object[model.jnt_bodyid[joint]]
        if owner >= 0:
            joints[owner].append(int(joint))
    names = [entry.name for entry in manifest.objects]
    return ModelIndex(names, body_object, body_root, geom_object, geom_root, roots, solid, annotated, joints)


def geom_box(model: mujoco.MjModel, geom: int, rotation: np.ndarray, position: np.ndarray) -> np.ndarray:
    """Exact AABB [2, 3] (low, high) of a geom whose frame is turned by `rotation` [3, 3] and put at `position` [3]."""
    kind, size = model.geom_type[geom], model.geom_size[geom]
    types = mujoco.mjtGeom
    if kind == types.mjGEOM_MESH:
        mesh = model.geom_dataid[geom]
        start, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
        points = model.mesh_vert[start : start + count] @ rotation.T + position
        return np.stack([points.min(axis=0), points.max(axis=0)])
    axis = np.abs(rotation[:, 2])
    if kind == types.mjGEOM_SPHERE:
        half = np.full(3, size[0])
    elif kind == types.mjGEOM_CAPSULE:
        half = size[0] + size[1] * axis
    elif kind == types.mjGEOM_CYLINDER:
        half = size[0] * np.sqrt(np.maximum(1 - axis**2, 0)) + size[1] * axis
    elif kind == types.mjGEOM_ELLIPSOID:
        half = np.sqrt(((rotation * size) ** 2).sum(axis=1))
    else:  # a box; planes and height fields have no object
        half = np.abs(rotation) @ size
    return np.stack([position - half, position + half])
