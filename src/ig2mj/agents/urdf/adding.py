"""How a converted robot is added to a scene (`add_robot`)."""

from __future__ import annotations

import dataclasses
from typing import Any

import mujoco
import numpy as np

from ig2mj.agents.parts import Vector, multiply, rotate
from ig2mj.agents.urdf.body import RobotBody
from ig2mj.agents.urdf.layout import Layout
from ig2mj.agents.urdf.references import BASE, OBJECT, keep_relations, name_base, named_spec, rebase_joint_equalities


def add_robot(
    body: RobotBody, spec: mujoco.MjSpec, name: str, pos: Vector, quat: Vector, fixed: bool, layout: Layout
) -> dict[str, mujoco.MjsBody]:
    """Adds the robot to a scene, its joints at the layout's start: bodies by link. `fixed`: bolted to the world.

    Equalities, tendons and sensors of its file are kept. Keyframes, motors and sensors of motors are not: an agent has
    its own start and servos. Contact excludes are not needed, because no two bodies of the robot collide.
    """
    own, prefix = named_spec(body.file, body.description.name, name), f"{body.description.name}_"
    own_start = {prefix + joint: at for joint, at in zip(body.scalar_names, body.start(layout), strict=True)}
    keep_relations(own, body.model, own_start)
    motors = (OBJECT.mjOBJ_ACTUATOR, OBJECT.mjOBJ_UNKNOWN)  # of unknown objects: clocks and user's data
    measuring = [s for s in own.sensors if s.objtype in motors or s.reftype == OBJECT.mjOBJ_ACTUATOR]
    for element in (*own.excludes, *own.keys, *measuring, *own.actuators):
        own.delete(element)
    base = own.body(BASE)
    base.pos, base.quat = [0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0]
    own.nkey = spec.nkey
    for mine, scenes in ((own.option, spec.option), (own.visual.map, spec.visual.map)):
        _agree(mine, scenes)
    frame = spec.worldbody.add_frame(pos=list(pos), quat=list(quat))
    added = frame.attach_body(base, name, "")
    name_base(spec, added, name)
    for joint in added.joints:
        if joint.type == mujoco.mjtJoint.mjJNT_FREE and fixed:
            spec.delete(joint)
    for joint, value in own_start.items():
        _bend(spec.joint(f"{name}_{joint.removeprefix(prefix)}"), value)
    rebase_joint_equalities(
        spec,
        {
            f"{name}_{follower}": dataclasses.replace(
                coupling, leader=None if coupling.leader is None else f"{name}_{coupling.leader}"
            )
            for follower, coupling in body.couplings.items()
        },
    )
    links = {f"{name}_{link}": link for link in body.links()} | {name: body.description.base}
    return {links[one.name]: one for one in (added, *added.find_all("body")) if one.name in links}


def _bend(joint: mujoco.MjsJoint, q: float) -> None:
    """Poses the joint's body as at position `q`, which becomes the joint's reference.

    Without it a scene whose keyframes have no positions would start with the robot at joint positions 0.
    """
    body, turned, by = joint.parent, np.array([1.0, 0.0, 0.0, 0.0]), q - joint.ref
    if joint.type == mujoco.mjtJoint.mjJNT_SLIDE:
        body.pos = body.pos + rotate(body.quat, np.asarray(joint.axis) * by)
    else:
        mujoco.mju_axisAngle2Quat(turned, np.asarray(joint.axis), by)
        body.quat = multiply(body.quat, turned)
    joint.ref = q


def _agree(mine: Any, scenes: Any) -> None:
    """Takes over all settings: MuJoCo warns where a part has others than the whole."""
    for name in dir(scenes):
        value = getattr(scenes, name)
        if name.startswith("_") or callable(value):
            continue
        if isinstance(value, np.ndarray):
            getattr(mine, name)[:] = value
        else:
            setattr(mine, name, value)
