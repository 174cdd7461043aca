"""An object as `manifest.json` lists it."""

from __future__ import annotations

import re
from typing import Any

import numpy as np

from ig2mj import knowledge
from ig2mj.scene.manifest import JointEntry, ObjectEntry, OpenableEntry, OrientationEntry, PartEntry, RoomEntry, Vec3

from ..base.description import ObjectModel, RoomMaps
from ..bodies.assembly import Assembly, extent
from ..bodies.joint_limits import joint_range, mujoco_type
from ..bodies.joint_rules import openable_ends
from .object import ObjectElements

_TASK_FILE = re.compile(r"_task_(?P<activity>.+)_(?P<definition>\d+)_(?P<instance>\d+)(_fixed_furniture)?$")


def object_entry(
    name: str,
    assembly: Assembly,
    elements: ObjectElements,
    *,
    fixed: bool,
    rooms: list[str] | None = None,
    parts: list[tuple[str, np.ndarray, np.ndarray]] | None = None,
    part_of: str | None = None,
    parked: bool = False,
    assisted_grasp: bool = True,
    scope: str | None = None,
) -> ObjectEntry:
    """The manifest's entry of an object that `add_object` has written; the initial extended state is still empty."""
    model = assembly.model
    box, offset = bounding_box(assembly)
    ends, _ = openable_ends(assembly)
    joints = [
        JointEntry(name=elements.joints[joint.name], type=mujoco_type(joint), range=joint_range(joint))
        for joint in assembly.joints()
    ]
    return ObjectEntry(
        name=name,
        category=model.category,
        model=model.model,
        bodies=[elements.bodies[i] for i in assembly.roots],
        fixed=fixed,
        bounding_box=vec3(box),
        mass=round(assembly.mass, 6),
        synset=knowledge.synset(model.category),
        rooms=list(rooms or []),
        scale=vec3(assembly.scale, 9),
        base_link_offset=vec3(offset),
        joints=joints,
        openable=[OpenableEntry(joint=elements.joints[j], closed=closed, open=open_) for j, closed, open_ in ends],
        openable_both_sides=model.metadata.openable_both_sides,
        links=elements.links,
        abilities=_abilities(model),
        orientations=_orientations(assembly),
        parts=[PartEntry(object=half, pos=vec3(pos), quat=_quat(quat)) for half, pos, quat in parts or []],
        part_of=part_of,
        parked=parked,
        assisted_grasp=assisted_grasp,
        object_scope=scope,
    )


def _abilities(model: ObjectModel) -> knowledge.Abilities:
    own = knowledge.Overrides(models={f"{model.category}/{model.model}": model.abilities}) if model.abilities else None
    return knowledge.abilities(model.category, model.model, overrides=own)


def bounding_box(assembly: Assembly) -> tuple[np.ndarray, np.ndarray]:
    """Size and centre [3] of an object's box in base axes, scaled: metadata.json's, or that of the collision
    pieces where there is none."""
    metadata = assembly.model.metadata
    if metadata.bbox_size is not None and metadata.base_link_offset is not None:
        return metadata.bbox_size, metadata.base_link_offset
    low, high = extent(assembly, np.eye(4))
    return high - low, (low + high) / 2


def room_entries(maps: RoomMaps | None, named: list[str]) -> dict[str, RoomEntry]:
    """Room instances of the maps, then those that only objects name (`kitchen_0` is of type `kitchen`)."""
    entries: dict[str, RoomEntry] = {}
    if maps is not None:
        entries = {name: RoomEntry(type=kind) for name, kind in zip(maps.names, maps.types, strict=True)}
    for name in named:
        entries.setdefault(name, RoomEntry(type=re.sub(r"_\d+$", "", name)))
    return entries


def task_entry(scene_file_stem: str, scopes: dict[str, str], rooms: dict[str, str], agents: list[dict]) -> dict | None:
    """What a cached BEHAVIOR scene says of its task; None where it says nothing.

    Args:
      scene_file_stem: `<scene>_task_<activity>_<definition>_<instance>[_fixed_furniture]`.
      scopes: BDDL instance -> object. rooms: BDDL room-floor instance -> room. agents: start poses.
    """
    if not scopes and not agents:
        return None
    task: dict[str, Any] = {}
    match = _TASK_FILE.search(scene_file_stem)
    if match:
        task |= {"activity": match["activity"]}
        task |= {"definition": int(match["definition"]), "instance": int(match["instance"])}
    task["object_scope"] = scopes
    if rooms:
        task["rooms"] = rooms
    if agents:
        task["agents"] = agents
    return task


def vec3(values: np.ndarray, digits: int = 6) -> Vec3:
    """Three rounded numbers: to 1 micrometre by default."""
    x, y, z = (round(float(v), digits) + 0.0 for v in values)
    return (x, y, z)


def _quat(values: np.ndarray) -> tuple[float, float, float, float]:
    w, x, y, z = (round(float(v), 9) + 0.0 for v in values)
    return (w, x, y, z)


def _orientations(assembly: Assembly) -> list[OrientationEntry]:
    return [
        OrientationEntry(quat=_quat(o.quat), prob=float(o.prob), size=vec3(o.size))
        for o in assembly.model.metadata.orientations
    ]
