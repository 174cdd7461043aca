"""Furniture that `ig2mj convert object` wrote, read so that it can be placed: links, joints, collision hulls.

The model's category is the path of its folder; `catalogue.find` and `catalogue.build_model` know it by that.
"""

from __future__ import annotations

import dataclasses
import functools
import pathlib

import mujoco
import numpy as np

from ig2mj.errors import InputError
from ig2mj.scene.manifest import ObjectEntry, load_manifest

from .entry import Entry
from .model import HouseholdObject, Joint, LinkBuilder, ObjectBuilder

ROUND = 16
"""Points of a circle that stands for a cylinder, a capsule or a sphere."""
KINDS = {mujoco.mjtJoint.mjJNT_HINGE: "revolute", mujoco.mjtJoint.mjJNT_SLIDE: "prismatic"}


@dataclasses.dataclass(frozen=True)
class FolderModel:
    """entry: the manifest's entry of the object. model: its shape."""

    entry: ObjectEntry
    model: HouseholdObject


def is_folder(category: str) -> bool:
    """Whether this is the path of a folder and no category of the catalogue."""
    return "/" in category or "\\" in category


@functools.cache
def folder_model(folder: str) -> FolderModel:
    """Reads a folder. Raises InputError, ManifestError."""
    path = pathlib.Path(folder)
    entry = load_manifest(path).objects[0]
    file = path / "object.xml"
    try:
        model = mujoco.MjModel.from_xml_path(str(file))
    except ValueError as e:
        raise InputError(file, f"MuJoCo cannot load it: {e}", fix="convert the object again") from e
    if len(entry.bodies) != 1:
        raise InputError(path, "has parts that lie loose on it", fix="only objects of one piece can be furniture")
    return FolderModel(entry, _household_object(model, entry, path.name))


def folder_entry(folder: str) -> Entry:
    """The line of the catalogue that stands for a folder."""
    found = folder_model(folder)
    low, high = found.model.bounds()
    x, y, z = (float(v) for v in high - low)
    return Entry(folder, _not_built, (x, y, z), found.entry.mass, 1, fixed=found.entry.fixed, rest="upright")


def _not_built(builder: ObjectBuilder) -> None:
    raise AssertionError(f"{builder.category} is read, not built")


def _household_object(model: mujoco.MjModel, entry: ObjectEntry, name: str) -> HouseholdObject:
    data = mujoco.MjData(model)
    data.qpos[:] = model.qpos0
    mujoco.mj_kinematics(model, data)
    base = model.body(entry.bodies[0]).id
    origin, turn = data.xpos[base].copy(), data.xmat[base].reshape(3, 3).copy()

    def local(points: np.ndarray) -> np.ndarray:
        return (points - origin) @ turn

    bodies = [b for b in range(model.nbody) if b == base or _under(model, b, base)]
    links: dict[int, LinkBuilder] = {}
    joints: list[Joint] = []
    openable = {opening.joint: 1 if opening.open > opening.closed else -1 for opening in entry.openable}
    for body in bodies:
        first = int(model.body_jntadr[body])
        numbers = [] if body == base else list(range(first, first + int(model.body_jntnum[body])))
        if body != base and not numbers:
            links[body] = links[int(model.body_parentid[body])]
        else:
            anchor = local(data.xanchor[numbers[0]]) if numbers else np.zeros(3)
            links[body] = LinkBuilder(model.body(body).name, anchor)
        for j in numbers[:1]:
            parent = links[int(model.body_parentid[body])]
            kind = KINDS[model.jnt_type[j]] if model.jnt_limited[j] else "continuous"
            x, y, z = (float(v) for v in data.xaxis[j] @ turn)
            low, high = (float(v) for v in model.jnt_range[j])
            at = links[body].origin - parent.origin
            child, way = links[body].name, openable.get(model.joint(j).name, 0)
            joints.append(Joint(model.joint(j).name, kind, parent.name, child, at, (x, y, z), (low, high), way))
    for geom in range(model.ngeom):
        body = int(model.geom_bodyid[geom])
        if body in links and (model.geom_contype[geom] or model.geom_conaffinity[geom]):
            points = _points(model, geom) @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom]
            links[body].hulls.append(local(points) - links[body].origin)
    solid = list({id(link): link for link in links.values() if link.hulls}.values())
    if links[base] not in solid:  # a frame without a body of its own: its first part stands for it
        links[base].hulls.append(local(data.xpos[base] + 1e-3 * _corners(np.ones(3))))
        solid.insert(0, links[base])
    kept = {link.name for link in solid}
    joints = [joint for joint in joints if joint.child in kept and joint.parent in kept]
    return HouseholdObject(entry.category, name, solid, joints, {}, "upright", furniture=entry.fixed)


def _under(model: mujoco.MjModel, body: int, base: int) -> bool:
    while body:
        body = int(model.body_parentid[body])
        if body == base:
            return True
    return False


def _points(model: mujoco.MjModel, geom: int) -> np.ndarray:
    """Points [n, 3] in a geom's frame whose hull is its shape."""
    kinds, size = mujoco.mjtGeom, model.geom_size[geom]
    kind = model.geom_type[geom]
    if kind == kinds.mjGEOM_MESH:
        mesh = model.geom_dataid[geom]
        first = int(model.mesh_vertadr[mesh])
        return np.array(model.mesh_vert[first : first + int(model.mesh_vertnum[mesh])], float)
    if kind == kinds.mjGEOM_BOX:
        return _corners(size)
    angles = np.linspace(0, 2 * np.pi, ROUND, endpoint=False)
    circle = np.stack([np.cos(angles), np.sin(angles), np.zeros(ROUND)], 1)
    if kind == kinds.mjGEOM_CYLINDER:
        return np.concatenate([circle * [size[0], size[0], 1] + [0, 0, z] for z in (-size[1], size[1])])
    heights = np.sin(np.linspace(-np.pi / 2, np.pi / 2, ROUND // 2 + 1))
    ball = np.concatenate([circle * [np.sqrt(1 - h * h)] * 3 + [0, 0, h] for h in heights])
    if kind == kinds.mjGEOM_CAPSULE:
        return np.concatenate([ball * size[0] + [0, 0, z] for z in (-size[1], size[1])])
    return ball * (size if kind == kinds.mjGEOM_ELLIPSOID else size[0])


def _corners(half: np.ndarray) -> np.ndarray:
    signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
    return signs * half
