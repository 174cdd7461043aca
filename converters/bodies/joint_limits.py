"""URDF joints: type, limits, motion."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from scipy.spatial.transform import Rotation

from ..base.description import Joint


def mujoco_type(joint: Joint) -> str:
    """ "slide" for a prismatic joint, "hinge" for a revolute or continuous one."""
    return "slide" if joint.type == "prismatic" else "hinge"


def joint_range(joint: Joint) -> tuple[float, float] | None:
    """Lower and upper limit, or None: `continuous`, no limits given, or lower above upper."""
    if joint.type == "continuous" or joint.lower is None or joint.upper is None or joint.lower > joint.upper:
        return None
    return (float(joint.lower), float(joint.upper))


def is_locked(joint: Joint) -> bool:
    """Whether the limits leave no room to move. MuJoCo refuses an empty range: such a joint is rigid, at its limit."""
    limits = joint_range(joint)
    return limits is not None and limits[1] - limits[0] < 1e-9


def clamp(joint: Joint, position: float) -> float:
    """A joint position inside the limits (positions are clamped at export)."""
    limits = joint_range(joint)
    return position if limits is None else min(max(position, limits[0]), limits[1])


def start_positions(joints: Mapping[str, Joint], given: Mapping[str, float]) -> dict[str, float]:
    """Joint -> position at the start: as given, brought inside the limits; of a joint that follows another, where that
    one puts it; else 0 brought inside the limits."""
    found: dict[str, float] = {}

    def at(name: str) -> float:
        if name not in found:
            joint = joints[name]
            if name not in given and joint.mimic is not None and joint.mimic.joint in joints:
                found[name] = joint.mimic.multiplier * at(joint.mimic.joint) + joint.mimic.offset
            else:
                found[name] = clamp(joint, given.get(name, 0.0))
        return found[name]

    return {name: at(name) for name in joints}


def unit_axis(joint: Joint) -> np.ndarray:
    """The joint's axis, unit length, in the body's own frame (URDF gives it there)."""
    norm = float(np.linalg.norm(joint.axis))
    assert math.isfinite(norm) and norm > 0, "the reader checks axes"
    return joint.axis / norm


def motion(joint: Joint, position: float) -> np.ndarray:
    """4x4 by which a joint position (radians or metres) moves the child's frame, in that frame."""
    pose, axis = np.eye(4), unit_axis(joint)
    if mujoco_type(joint) == "slide":
        pose[:3, 3] = position * axis
    else:
        pose[:3, :3] = Rotation.from_rotvec(position * axis).as_matrix()
    return pose
