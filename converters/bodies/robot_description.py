"""What MJCF does not keep of a robot: its motors' limits, and where its fixed links are (`robot.json`)."""

from __future__ import annotations

import json

import numpy as np

from ig2mj.errors import InputError

from ..base.description import ObjectModel
from .joint_limits import clamp, is_locked
from .kinematics import link_poses, shape_bounds

ROBOT_FILE = "robot.json"

FORMAT_VERSION = 1

MARKER_SIZE, MARKER_MASS = 0.01, 1e-3
"""m and kg: most of a marker."""

LAST_JOINTS = 2
"""Joints in a row at the end of an arm whose links may hold something."""


def put_on_floating_base(source: ObjectModel) -> None:
    """Makes the child of a floating joint the base where nothing but that joint hangs on the base, an empty link.

    So URDFs say that a robot is free to move in the world, which every robot's base is that drives. Raises InputError
    for a floating joint between parts of a robot.
    """
    floating = [joint for joint in source.joints.values() if joint.type == "floating"]
    below = [joint for joint in source.joints.values() if joint.parent == source.base]
    root = source.links[source.base]
    if len(below) == 1 and below == floating and not (root.visuals or root.collisions or root.inertial):
        source.base = floating[0].child
        del source.joints[floating[0].name], source.links[root.name]
    elif floating:
        element = f"joint '{floating[0].name}'"
        raise InputError(source.file, "a floating joint cuts the robot in two", element=element, fix="make it fixed")


def drop_markers(source: ObjectModel) -> None:
    """Takes their collision shapes from links that mark a point, as the one between two fingers where they grasp.

    Such a link is fixed, nothing hangs on it, and it has at most `MARKER_SIZE` and `MARKER_MASS`.
    """
    carrying = {joint.parent for joint in source.joints.values()}
    for joint in source.joints.values():
        link = source.links[joint.child]
        if joint.type != "fixed" or link.name in carrying or link.inertial is None or not link.collisions:
            continue
        boxes = [box for shape in link.collisions if (box := shape_bounds(shape)) is not None]
        if not boxes or link.inertial.mass > MARKER_MASS:
            continue
        size = np.max([box[1] for box in boxes], axis=0) - np.min([box[0] for box in boxes], axis=0)
        if size.max() <= MARKER_SIZE:
            link.collisions = []
            source.warnings.append(
                f"link '{link.name}' ({1000 * size.max():.0f} mm) marks a point and does not collide"
            )


def grasping_links(source: ObjectModel) -> set[str]:
    """The links at the ends of a robot's arms: those below the last two joints in a row that move, with what is fixed
    to them; of a hand also the one that its fingers hang on, and all between them."""
    joints = {joint.child: joint for joint in source.joints.values()}
    below: dict[str, list[str]] = {}
    for joint in source.joints.values():
        below.setdefault(joint.parent, []).append(joint.child)
    levels: dict[str, int] = {}
    for link in reversed(list(link_poses(source, {}))):  # children come before their parents
        moved = [levels[c] + (joints[c].type != "fixed" and not is_locked(joints[c])) for c in below.get(link, [])]
        levels[link] = max(moved, default=0)
    return {link for link, level in levels.items() if level < LAST_JOINTS}


def robot_json(source: ObjectModel) -> str:
    """The text of `robot.json`: joints that move, with their motors' limits (N m or N, rad/s or m/s), and for every
    link the one that moves it, with its position (m) and its axes (rotation matrix) in that one's frame."""
    joints = {joint.child: joint for joint in source.joints.values()}
    moves = {name for name, joint in joints.items() if joint.type != "fixed" and not is_locked(joint)}
    poses = link_poses(source, {j.name: clamp(j, 0.0) for j in joints.values() if is_locked(j)})
    mover: dict[str, str] = {}
    for link in poses:  # parents come before their children
        mover[link] = link if link in moves or link not in joints else mover[joints[link].parent]
    frames = {}
    for link, above in ((name, mover[name]) for name in source.links):
        pose = np.linalg.inv(poses[above]) @ poses[link]
        frames[link] = {"on": above, "pos": pose[:3, 3].round(9).tolist(), "axes": pose[:3, :3].round(9).tolist()}
    described = {
        "format_version": FORMAT_VERSION,
        "name": source.model,
        "base": source.base,
        "joints": [
            {
                "name": joint.name,
                "type": joint.type,
                "parent": mover[joint.parent],
                "child": joint.child,
                "effort": joint.effort or 0.0,
                "velocity": joint.velocity or 0.0,
                "mimics": None if joint.mimic is None else joint.mimic.joint,
            }
            for joint in source.joints.values()
            if joint.child in moves
        ],
        "frames": frames,
    }
    return json.dumps(described, indent=1)
