"""A scene as MJCF and manifest entries: objects at their places, unused ones parked, the start state as keyframe."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence

import mujoco
import numpy as np

from ig2mj import knowledge
from ig2mj.scene.manifest import ObjectEntry

from ..base.description import RoomMaps
from ..base.transforms import rotation_from_wxyz
from ..bodies.assembly import Assembly, extent
from ..bodies.joint_limits import start_positions
from ..bodies.placements import Placement
from ..reading.cached_states import convert_states
from .appearance import add_setting
from .manifest_entries import object_entry
from .model_builder import HIDDEN_GROUP, ModelBuilder
from .object import ObjectElements, add_object
from .parking import park
from .start_state import let_down

#: The start state: joint positions as saved, or 0 brought inside the limits.
START_KEY = "initial"

HOVERS = "above its support in the source"
"""What the warning about an object in mid-air says."""


@dataclasses.dataclass
class SceneBuild:
    """A scene being written: the model, one entry per object, and the names of its elements."""

    builder: ModelBuilder
    entries: list[ObjectEntry]
    elements: dict[str, ObjectElements]
    start_joints: dict[str, float]


def build_scene(
    builder: ModelBuilder,
    placements: Sequence[Placement],
    assemblies: Mapping[str, Assembly],
    *,
    rooms: RoomMaps | None = None,
    assisted_grasp: Mapping[str, bool] | None = None,
    ceiling_collision: bool = False,
) -> SceneBuild:
    """Writes all placements into the builder's model, then sky, lights, cameras and the keyframe "initial".

    Args:
      placements: in the order of the source.
      assemblies: object name -> its plan.
      assisted_grasp: category -> enable_ag of avg_category_specs.json; absent means yes.
      ceiling_collision: whether ceilings get collision geoms. Their visuals are in a hidden group either
        way, so that one can look into the house from above.
    """
    build = SceneBuild(builder, [], {}, {})
    poses = {p.name: root_poses(p, assemblies[p.name]) for p in placements if not p.parked}
    low, high = _scene_box(placements, assemblies, poses)
    groups = {p.name: assemblies[p.name] for p in placements if p.parts or p.part_of}
    places = park(builder, groups, low, high)
    for placement in placements:
        assembly = assemblies[placement.name]
        roots = poses.get(placement.name)
        if roots is None:
            roots = _with_extra_roots(assembly, places[placement.name])
        ceiling = placement.instance.category == "ceilings"
        elements = add_object(
            builder,
            assembly,
            placement.name,
            roots,
            fixed=placement.instance.fixed and not placement.parked,
            collide=ceiling_collision or not ceiling,
            visual_group=HIDDEN_GROUP if ceiling else None,
        )
        build.elements[placement.name] = elements
        build.start_joints |= _start_joints(placement, assembly, elements)
        ag = (
            placement.instance.kind == "object"
            and not placement.instance.fixed
            and (assisted_grasp or {}).get(placement.instance.category, True)
        )
        build.entries.append(
            object_entry(
                placement.name,
                assembly,
                elements,
                fixed=placement.instance.fixed,
                rooms=placement.instance.rooms,
                parts=placement.parts,
                part_of=placement.part_of,
                parked=placement.parked,
                assisted_grasp=ag,
                scope=placement.scope,
            )
        )
    add_setting(builder.spec, low, high, rooms)
    add_start_key(builder.spec, build.start_joints)
    return build


def root_poses(placement: Placement, assembly: Assembly) -> list[np.ndarray]:
    """World pose, 4x4, of the base and of every split-off body.

    The scene gives the pose of the bounding box's centre. Saved poses of centres of mass count only where
    that does not say enough: for split-off bodies, and for objects without a bounding box.
    """
    instance, metadata = placement.instance, assembly.model.metadata
    base = instance.pose.copy()
    saved = _saved_poses(placement, assembly)
    if metadata.base_link_offset is not None:
        base[:3, 3] -= base[:3, :3] @ metadata.base_link_offset
    elif saved:
        base = saved[0]
    poses = _with_extra_roots(assembly, base)
    if len(saved) == len(poses):
        poses[1:] = saved[1:]
    return poses


def _saved_poses(placement: Placement, assembly: Assembly) -> list[np.ndarray]:
    """Base-frame poses out of `base_poses` (centres of mass, w-x-y-z by now), one per root; [] where there are none."""
    saved = placement.instance.base_poses
    roots = assembly.roots
    if not saved or len(saved) != len(roots):
        return []
    poses = []
    for index, (position, quat) in zip(roots, saved, strict=True):
        pose = np.eye(4)
        pose[:3, :3] = rotation_from_wxyz(np.asarray(quat, float))
        pose[:3, 3] = np.asarray(position, float) - pose[:3, :3] @ assembly.bodies[index].com
        poses.append(pose)
    return poses


def _with_extra_roots(assembly: Assembly, base: np.ndarray) -> list[np.ndarray]:
    """The base's pose and those of the split-off bodies at their default places next to it."""
    return [base @ assembly.bodies[index].pose for index in assembly.roots]


def _start_joints(placement: Placement, assembly: Assembly, elements: ObjectElements) -> dict[str, float]:
    """MJCF joint -> start position. Saved names are `<object>_<joint>`; unknown ones are ignored."""
    saved = placement.instance.joint_states or {}
    given = {}
    for joint in assembly.joints():
        state = saved.get(f"{placement.name}_{joint.name}", saved.get(joint.name))
        if state is not None:
            given[joint.name] = float(state[0])
    start = start_positions(assembly.model.joints, given)
    return {name: start[joint] for joint, name in elements.joints.items()}


def _scene_box(
    placements: Sequence[Placement], assemblies: Mapping[str, Assembly], poses: Mapping[str, list[np.ndarray]]
) -> tuple[np.ndarray, np.ndarray]:
    """Corners of what is to be seen: walls and floors, or everything in use where there are none."""
    shown = [p for p in placements if p.instance.category in ("walls", "floors") and p.name in poses]
    shown = shown or [p for p in placements if p.name in poses]
    boxes = [extent(assemblies[p.name], poses[p.name][0]) for p in shown]
    if not boxes:
        return np.full(3, -1.0), np.full(3, 1.0)
    return np.min([low for low, _ in boxes], axis=0), np.max([high for _, high in boxes], axis=0)


def add_start_key(
    spec: mujoco.MjSpec,
    joints: Mapping[str, float],
    moved: Mapping[str, tuple[np.ndarray, np.ndarray]] | None = None,
) -> None:
    """Sets the keyframe "initial": free bodies where the model has them, the other joints as given (else 0).

    Args:
      joints: joint -> position. moved: free bodies that start elsewhere -> position, quaternion.
    """
    for key in spec.keys:
        spec.delete(key)
    qpos: list[float] = []
    bodies = list(reversed(spec.worldbody.bodies))
    while bodies:
        body = bodies.pop()
        bodies.extend(reversed(body.bodies))
        for joint in body.joints:
            if joint.type == mujoco.mjtJoint.mjJNT_FREE:
                pos, quat = (moved or {}).get(body.name, (body.pos, body.quat))
                qpos += [*pos, *quat]
            else:
                qpos.append(joints.get(joint.name, 0.0))
    spec.add_key(name=START_KEY, qpos=qpos)


def fill_states(build: SceneBuild, model: mujoco.MjModel, placements: Sequence[Placement]) -> None:
    """Turns saved extended states into the manifest's, with particles in the frames of the bodies that carry them."""
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key(START_KEY).id)
    mujoco.mj_kinematics(model, data)
    for placement, entry in zip(placements, build.entries, strict=True):
        if not placement.states:
            continue
        soaking = knowledge.abilities(entry.category, entry.model).get("soakable", {}).get("wetness_soaked", 1.0)
        bodies = build.elements[entry.name].bodies

        def frame(link: str | None, name: str = entry.name, bodies: list[str] = bodies) -> tuple[str, np.ndarray]:
            known = {link, f"{name}_{link}"} & set(bodies)
            body = known.pop() if len(known) == 1 else bodies[0]
            pose = np.eye(4)
            pose[:3, :3], pose[:3, 3] = data.body(body).xmat.reshape(3, 3), data.body(body).xpos
            return body, pose

        entry.state, warnings = convert_states(placement.states, float(soaking), frame)
        for line in warnings:
            build.builder.warn(entry.name, line)


def rest_start(build: SceneBuild, model: mujoco.MjModel, *, keep_hovering: bool = False) -> bool:
    """Brings the keyframe "initial" to rest (`start_state`); the bodies themselves keep the source's poses.

    Returns:
      whether anything changed; the model must then be written again.
    """
    owners = {body: name for name, elements in build.elements.items() for body in elements.bodies}
    parked = {body for entry in build.entries if entry.parked for body in entry.bodies}
    drops = let_down(model, START_KEY, parked, hovering=not keep_hovering)
    for drop in drops:
        if drop.body not in parked:
            text = f"hovers {100 * drop.distance:.1f} cm {HOVERS}: starts lower by that much"
            build.builder.warn(owners[drop.body], text)
    if drops:
        add_start_key(build.builder.spec, build.start_joints, {d.body: (d.pos, d.quat) for d in drops})
    return bool(drops)
