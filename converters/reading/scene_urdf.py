"""Scene URDF (the pseudo-URDF of iGibson's scenes) -> `SceneDescription`.

A `<link>` there is an instance of an object; its `<joint>` gives the pose of the object's bounding-box centre and
whether it is fixed. All parents are "world", so the file is a flat list.
"""

from __future__ import annotations

import dataclasses
import os
import pathlib
from collections.abc import Collection

import numpy as np

from ig2mj.errors import InputError

from ..base.description import Instance, SceneDescription
from ..base.options import ConvertOptions
from ..base.transforms import read_origin
from ..base.xml_reader import Element, numbers, read_xml, where
from .json_reader import decode_json
from .scene_state import read_body_poses, read_body_velocities, read_joint_states, read_pose_offsets
from .urdf_tree import check_name

BUILDING = ("walls", "floors", "ceilings")
KINDS = {name: "building" for name in BUILDING} | {
    name: name for name in ("multiplexer", "grouper", "agent", "agent_pose")
}
"""Special categories -> `Instance.kind`; every other category is an object."""
FIXED_FURNITURE = (
    "bottom_cabinet",
    "bottom_cabinet_no_top",
    "top_cabinet",
    "shelf",
    "pool_table",
    "stand",
    "pedestal_table",
    "coffee_table",
    "breakfast_table",
    "console_table",
    "desk",
    "gaming_table",
)
"""Categories that BEHAVIOR's `_fixed_furniture` scenes turn fixed."""


@dataclasses.dataclass(frozen=True)
class SceneOptions:
    """What of a scene is read.

    Attributes:
      seed: for models named "random".
      fixed_furniture: fix the 12 categories that BEHAVIOR's `_fixed_furniture` variants fix.
      only_rooms: room instances or room types; an object stays if one of its rooms is named. Building parts stay.
      only_categories: an object stays if its category is named. Building parts stay.
      without_categories: dropped, building parts too.
      random_index: read `<scene>_random_<index>.urdf` instead of `<scene>_best.urdf`.
    """

    seed: int = 0
    fixed_furniture: bool = False
    only_rooms: Collection[str] | None = None
    only_categories: Collection[str] | None = None
    without_categories: Collection[str] = ()
    random_index: int | None = None

    @classmethod
    def of(cls, options: ConvertOptions) -> SceneOptions:
        """Those of a conversion."""
        return cls(
            seed=options.seed,
            fixed_furniture=options.fixed_furniture,
            only_rooms=options.only_rooms,
            only_categories=options.only_categories,
        )


def read_scene(file: str | os.PathLike, name: str) -> SceneDescription:
    """Reads a scene URDF: every instance, models still as written (may be "random"); no maps, no filters.

    Raises:
      InputError: naming the file and the element.
    """
    path = pathlib.Path(file)
    warnings: list[str] = []
    robot = read_xml(path, "robot", warnings)
    joints = _joints_by_child(robot, path)
    instances: list[Instance] = []
    seen: set[str] = set()
    for element in robot.iterfind("link"):
        instance_name = check_name(element, path, warnings)
        if instance_name in seen:
            raise InputError(path, "this name occurs twice", element=where(element))
        seen.add(instance_name)
        if instance_name != "world":
            instances.append(_read_instance(element, instance_name, joints.get(instance_name), path))
    for child, joint in joints.items():
        if child not in seen:
            raise InputError(path, f"its child link '{child}' does not exist", element=where(joint))
    _check_references(instances, path)
    return SceneDescription(name, path, instances, warnings=warnings)


def parse_object_scope(text: str) -> dict[str, str | None]:
    """BDDL instances an object is bound to -> the room of each, None where it names none.

    "book.n.02_1" gives {"book.n.02_1": None}; on floors "floor.n.01_1:room_floor_kitchen_0" gives
    {"floor.n.01_1": "kitchen_0"}.
    """
    scope: dict[str, str | None] = {}
    for word in text.split(","):
        instance, colon, room = word.strip().partition(":")
        if instance:
            scope[instance] = room.strip().removeprefix("room_floor_") if colon else None
    return scope


def _joints_by_child(robot: Element, file: pathlib.Path) -> dict[str, Element]:
    joints: dict[str, Element] = {}
    for joint in robot.iterfind("joint"):
        child, parent = joint.find("child"), joint.find("parent")
        if child is None or not child.get("link"):
            raise InputError(file, "has no child link", element=where(joint))
        if parent is None or (parent.get("link") or "").strip() != "world":
            raise InputError(file, "its parent link is not 'world'", element=where(joint))
        name = child.get("link").strip()
        if name in joints:
            raise InputError(file, f"link '{name}' has another joint already", element=where(joint))
        joints[name] = joint
    return joints


def _read_instance(link: Element, name: str, joint: Element | None, file: pathlib.Path) -> Instance:
    category = (link.get("category") or "").strip()
    if not category:
        raise InputError(file, "has no category", element=where(link))
    kind = KINDS.get(category, "object")
    model = (link.get("model") or "").strip()
    if kind in ("object", "building"):
        if not model:
            raise InputError(file, "has no model", element=where(link))
        for what, word in (("name", name), ("category", category), ("model", model)):
            _check_file_name(word, what, link, file)
    if joint is None and kind in ("object", "building"):
        raise InputError(file, "no joint has it as its child", element=where(link), fix="add its joint to 'world'")
    fixed, pose = True, np.eye(4)
    if joint is not None:
        joint_type = (joint.get("type") or "").strip()
        if joint_type not in ("fixed", "floating"):
            raise InputError(file, f"joint type '{joint_type}' is neither fixed nor floating", element=where(joint))
        fixed, pose = joint_type == "fixed", read_origin(joint, file)
    if link.get("bounding_box") is not None and link.get("scale") is not None:
        raise InputError(file, "has both bounding_box and scale", element=where(link), fix="keep one of them")
    instance = Instance(
        name,
        category,
        model,
        pose,
        fixed,
        kind=kind,
        random_group=link.get("random_group"),
        bounding_box=_positive(link, "bounding_box", file),
        scale=_positive(link, "scale", file),
        rooms=[room.strip() for room in (link.get("room") or "").split(",") if room.strip()],
        object_scope=link.get("object_scope") or None,
        base_poses=read_body_poses(link, file),
        base_velocities=read_body_velocities(link, file),
        joint_states=read_joint_states(link, file),
        multiplexer=link.get("multiplexer") or None,
        grouper=link.get("grouper") or None,
        pose_offsets=read_pose_offsets(link, file),
        attributes={str(k): str(v) for k, v in link.attrib.items()},
    )
    if (text := link.get("states")) is not None:
        instance.states = decode_json(text, file, f"{where(link)} attribute 'states'")
        if instance.states is not None and not isinstance(instance.states, dict):
            raise InputError(file, "attribute 'states' is not JSON object", element=where(link))
    if (text := link.get("current_index")) is not None:
        if text.strip() not in ("0", "1"):
            raise InputError(file, f"current_index='{text}' is neither 0 nor 1", element=where(link))
        instance.current_index = int(text)
    return instance


def _positive(link: Element, attribute: str, file: pathlib.Path) -> np.ndarray | None:
    if link.get(attribute) is None:
        return None
    value = numbers(link, attribute, 3, file)
    if np.any(value <= 0):
        raise InputError(file, f"{attribute}='{link.get(attribute)}' is not positive", element=where(link))
    return value


def _check_file_name(word: str, what: str, link: Element, file: pathlib.Path) -> None:
    """Names, categories and models become parts of paths."""
    if "/" in word or "\\" in word or word.startswith("."):
        raise InputError(
            file, f"the {what} '{word}' holds a slash or begins with a dot", element=where(link), fix="rename it"
        )


def _check_references(instances: list[Instance], file: pathlib.Path) -> None:
    """Multiplexers and groupers that are named exist."""
    kinds = {i.name: i.kind for i in instances}
    for instance in instances:
        for kind, target in (("multiplexer", instance.multiplexer), ("grouper", instance.grouper)):
            if target is not None and kinds.get(target) != kind:
                raise InputError(file, f"its {kind} '{target}' does not exist", element=f"link '{instance.name}'")
