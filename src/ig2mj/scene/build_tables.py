"""Fills `SceneTables` from a compiled model, its manifest and its room maps; finds where they disagree."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np

from ig2mj.errors import ManifestError
from ig2mj.scene.agent_tables import agent_columns
from ig2mj.scene.convex_pieces import make_convex_pieces
from ig2mj.scene.manifest import Manifest, ObjectEntry
from ig2mj.scene.rooms import Rooms
from ig2mj.scene.tables import LinkKind, SceneTables

DEFAULT_RESOLUTION = 0.1
"""Metres a cell, of the empty room map of a scene that has none."""


class _Names:
    """Looks MJCF names up and says which element of the manifest asked for one that is missing."""

    def __init__(self, model: mujoco.MjModel, file: object):
        self.model, self.file = model, file

    def __call__(self, kind: str, name: str, element: str) -> int:
        number = mujoco.mj_name2id(self.model, getattr(mujoco.mjtObj, f"mjOBJ_{kind.upper()}"), name)
        if number < 0:
            raise ManifestError(
                self.file, f"names the {kind} '{name}', which scene.xml does not have", element=element, fix=_FIX
            )
        return number


_FIX = "manifest.json and scene.xml must come from one conversion: convert the scene again"


def build_tables(
    model: mujoco.MjModel, manifest: Manifest, rooms: Rooms | None = None, file: object = "manifest.json"
) -> SceneTables:
    """Makes the tables of a scene.

    Args:
      model: compiled from the scene.xml that belongs to the manifest.
      manifest: checked by `load_manifest`; agents compiled into the model are among its `agents`.
      rooms: the room maps, or None.
      file: how errors name the manifest.

    Raises:
      ManifestError: the manifest and the model disagree.
    """
    find = _Names(model, file)
    objects = manifest.objects
    body_object = _body_owners(model, objects, find)
    _check_fixed(model, objects, body_object, file)
    geom_object = body_object[model.geom_bodyid]
    names = [o.name for o in objects]
    return SceneTables(
        object_names=tuple(names),
        object_categories=tuple(o.category for o in objects),
        object_fixed=np.array([o.fixed for o in objects], bool),
        object_root=np.array([find("body", o.bodies[0], f"object '{o.name}'") for o in objects], int),
        object_part_of=np.array([-1 if o.part_of is None else names.index(o.part_of) for o in objects], int),
        object_parked=np.array([o.parked for o in objects], bool),
        object_is_floor=np.array([o.category == "floors" for o in objects], bool),
        object_mass=np.array([o.mass for o in objects], np.float64),
        object_bbox=np.array([o.bounding_box for o in objects], np.float64).reshape(-1, 3),
        object_bbox_center=np.array([o.base_link_offset for o in objects], np.float64).reshape(-1, 3),
        object_both_sides=np.array([o.openable_both_sides for o in objects], bool),
        body_object=body_object,
        geom_object=geom_object,
        **_resting_columns(model, body_object),
        **_openable_columns(model, objects, find),
        **_link_columns(model, objects, body_object, find, file),
        **_piece_columns(model, geom_object, file),
        **_room_columns(manifest, rooms, file),
        **agent_columns(model, manifest.agents, find),
        **_graspable_columns(model, objects, find),
    )


def _body_owners(model: mujoco.MjModel, objects: list[ObjectEntry], find: _Names) -> np.ndarray:
    """Object of each body: its own where the manifest lists the body, else its parent's."""
    owner = np.full(model.nbody, -1)
    for number, entry in enumerate(objects):
        for name in entry.bodies:
            body = find("body", name, f"object '{entry.name}'")
            if owner[body] not in (-1, number):
                other = objects[owner[body]].name
                raise ManifestError(
                    find.file, f"body '{name}' is also object '{other}''s", element=f"object '{entry.name}'"
                )
            owner[body] = number
    for body in range(1, model.nbody):  # parents come first
        if owner[body] < 0:
            owner[body] = owner[model.body_parentid[body]]
    return owner


def _resting_columns(model: mujoco.MjModel, body_object: np.ndarray) -> dict[str, Any]:
    rests = (model.body_weldid == 0) & (model.body_mocapid < 0) & (body_object >= 0)
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    return {"body_rests": rests, "body_rest_pos": np.array(data.xpos), "body_rest_quat": np.array(data.xquat)}


def _check_fixed(model: mujoco.MjModel, objects: list[ObjectEntry], body_object: np.ndarray, file: object) -> None:
    for entry in objects:
        root = model.body(entry.bodies[0])
        free = root.jntnum[0] > 0 and model.jnt_type[root.jntadr[0]] == mujoco.mjtJoint.mjJNT_FREE
        if free == entry.fixed:
            problem = (
                "is fixed in the manifest and free in scene.xml"
                if free
                else "is free in the manifest and has no free joint in scene.xml"
            )
            raise ManifestError(file, problem, element=f"object '{entry.name}'", fix=_FIX)


def _openable_columns(model: mujoco.MjModel, objects: list[ObjectEntry], find: _Names) -> dict[str, Any]:
    for entry in objects:
        for joint in entry.joints:
            find("joint", joint.name, f"object '{entry.name}'")
    rows = [
        (number, model.jnt_qposadr[find("joint", o.joint, f"object '{entry.name}'")], o.closed, o.open)
        for number, entry in enumerate(objects)
        for o in entry.openable
    ]
    table = np.array(rows, np.float64).reshape(-1, 4)
    return {
        "openable_object": table[:, 0].astype(int),
        "openable_qposadr": table[:, 1].astype(int),
        "openable_closed": table[:, 2],
        "openable_open": table[:, 3],
    }


def _link_columns(
    model: mujoco.MjModel, objects: list[ObjectEntry], body_object: np.ndarray, find: _Names, file: object
) -> dict[str, Any]:
    owner, kinds, body, pos, quat, geom, half = [], [], [], [], [], [], []
    for number, entry in enumerate(objects):
        for kind, link in entry.links.items():
            element = f"object '{entry.name}', link '{kind}'"
            if kind.upper() not in LinkKind.__members__:
                known = ", ".join(k.lower() for k in LinkKind.__members__)
                raise ManifestError(file, f"is of no known kind; kinds are {known}", element=element)
            if link.geom is not None:
                found = model.geom(find("geom", link.geom, element))
                size = model.geom_aabb[found.id].reshape(2, 3)[1]
            else:
                assert link.site is not None  # check_manifest
                found, size = model.site(find("site", link.site, element)), np.zeros(3)
            if body_object[found.bodyid[0]] != number:
                raise ManifestError(file, "rides on a body of another object", element=element, fix=_FIX)
            owner.append(number)
            kinds.append(LinkKind[kind.upper()])
            body.append(found.bodyid[0])
            pos.append(np.array(found.pos))
            quat.append(np.array(found.quat))
            geom.append(found.id if link.geom is not None else -1)
            half.append(np.array(size))
    return {
        "link_object": np.array(owner, int),
        "link_kind": np.array(kinds, int),
        "link_body": np.array(body, int),
        "link_geom": np.array(geom, int),
        "link_pos": np.array(pos, np.float64).reshape(-1, 3),
        "link_quat": np.array(quat, np.float64).reshape(-1, 4),
        "link_half": np.array(half, np.float64).reshape(-1, 3),
    }


def _piece_columns(model: mujoco.MjModel, geom_object: np.ndarray, file: object) -> dict[str, Any]:
    collides = (model.geom_contype != 0) | (model.geom_conaffinity != 0)
    geoms = np.flatnonzero(collides & (geom_object >= 0))
    try:
        pieces = make_convex_pieces(model, geoms)
    except ValueError as e:
        raise ManifestError(
            file,
            "collides and is not a box, sphere, capsule, cylinder or mesh",
            element=f"geom '{e}' of scene.xml",
            fix="use a box for a plane, a mesh for the others",
        ) from e
    count = len(pieces)
    planes = np.zeros((count, max((len(p.planes) for p in pieces), default=0), 4))
    planes[..., 3] = 1.0
    vertices = np.zeros((count, max((len(p.vertices) for p in pieces), default=1), 3))
    for k, piece in enumerate(pieces):
        planes[k, : len(piece.planes)] = piece.planes
        vertices[k] = piece.vertices[0]
        vertices[k, : len(piece.vertices)] = piece.vertices
    return {
        "piece_geom": geoms,
        "piece_object": geom_object[geoms],
        "piece_body": np.asarray(model.geom_bodyid[geoms], int),
        "piece_pos": np.array(model.geom_pos[geoms]),
        "piece_quat": np.array(model.geom_quat[geoms]),
        "piece_kind": np.array([p.kind for p in pieces], int),
        "piece_size": np.array(model.geom_size[geoms]),
        "piece_planes": planes,
        "piece_vertices": vertices,
    }


def _room_columns(manifest: Manifest, rooms: Rooms | None, file: object) -> dict[str, Any]:
    instances = manifest.rooms.instances
    if rooms is None:
        names, types = tuple(instances), tuple(r.type for r in instances.values())
        room_map, resolution = np.zeros((1, 1), int), DEFAULT_RESOLUTION
    else:
        names, types = tuple(rooms.names), tuple(rooms.types)
        room_map, resolution = np.asarray(rooms.room_map, int), float(rooms.resolution)
        missing = sorted(set(instances) - set(names))
        if missing:
            raise ManifestError(
                file, f"names rooms that are not on the map: {', '.join(missing)}", element="rooms", fix=_FIX
            )
    index = {name: r for r, name in enumerate(names)}
    annotated = np.zeros((len(manifest.objects), len(names)), bool)
    for number, entry in enumerate(manifest.objects):
        for room in entry.rooms if entry.fixed else []:
            if room in index:  # iGibson annotates rooms that its own maps do not have, too
                annotated[number, index[room]] = True
    return {
        "object_rooms": annotated,
        "room_names": names,
        "room_types": types,
        "room_map": room_map,
        "room_resolution": resolution,
    }


def _graspable_columns(model: mujoco.MjModel, objects: list[ObjectEntry], find: _Names) -> dict[str, Any]:
    """What hands can take hold of. iGibson's rule of assistive grasping."""
    rows = [
        (find("body", entry.bodies[0], f"object '{entry.name}'"), number, -1)
        for number, entry in enumerate(objects)
        if entry.assisted_grasp and not entry.fixed
    ]
    openable = [(number, entry, o.joint) for number, entry in enumerate(objects) for o in entry.openable]
    for column, (number, entry, joint) in enumerate(openable):
        if entry.fixed:
            rows.append((int(model.jnt_bodyid[find("joint", joint, f"object '{entry.name}'")]), number, column))
    table = np.array(rows, int).reshape(-1, 3)
    return {"graspable_body": table[:, 0], "graspable_object": table[:, 1], "graspable_joint": table[:, 2]}
