"""Writes to one world's physics by name, checked: poses of objects, positions of joints."""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np

from ig2mj.engine.base import Write
from ig2mj.engine.writes import joints, teleports
from ig2mj.errors import PoseError, UnknownNameError
from ig2mj.scene.scene import Scene

Vector = Sequence[float | int] | np.ndarray


def write_of_pose(scene: Scene, name: str, pos: Vector, quat: Vector) -> Write:
    """Puts an object somewhere.

    Args:
      pos: [3] m, world frame, of the main body's frame. quat: [4] w-x-y-z, of any length but zero.

    Raises:
      UnknownNameError: no such object. PoseError: it is fixed, or the pose is invalid.
    """
    index, number = scene.object_index(name), len(scene.object_names)
    if scene.tables.object_fixed[index]:
        raise PoseError(f"object '{name}' is fixed to the house and cannot be moved (its joints can: set_joint)")
    place = _finite(pos, 3, f"position of object '{name}'")
    turn = _finite(quat, 4, f"rotation of object '{name}'")
    length = float(np.linalg.norm(turn))
    if length < 1e-6:
        raise PoseError(f"the rotation of object '{name}' is the zero quaternion (give w, x, y, z)")
    return teleports(number, index, place, turn / length)


def write_of_joint(scene: Scene, name: str, q: float | int) -> Write:
    """Puts a hinge (rad) or slide (m) somewhere.

    Raises:
      UnknownNameError: no such joint. PoseError: it is a free joint, or q is not finite or beyond its range.
    """
    address = joint_address(scene, name)
    place = float(_finite([q], 1, f"position of joint '{name}'")[0])
    _check_range(scene.model, name, place)
    return joints(scene.model.nq, address, place)


def joint_address(scene: Scene, name: str) -> int:
    """Where a hinge's or slide's position stands in qpos. Raises UnknownNameError; PoseError for other joints."""
    model = scene.model
    number = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, name)
    if number < 0:
        raise UnknownNameError("joint", name, [model.joint(j).name for j in range(model.njnt)])
    if mujoco.mjtJoint(int(model.jnt_type[number])) not in (mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE):
        raise PoseError(f"joint '{name}' is neither a hinge nor a slide (use set_object_pose)")
    return int(model.jnt_qposadr[number])


def _check_range(model: mujoco.MjModel, name: str, q: float) -> None:
    """Raises PoseError where q is beyond the joint's range by more than rounding."""
    joint = model.joint(name)
    low, high = (float(v) for v in joint.range)
    slack = 1e-6 * (high - low)
    if joint.limited[0] and not low - slack <= q <= high + slack:
        unit = "rad" if int(joint.type[0]) == int(mujoco.mjtJoint.mjJNT_HINGE) else "m"
        raise PoseError(f"joint '{name}' goes from {low:.4g} to {high:.4g} {unit}; {q:.4g} is beyond its range")


def _finite(values: Vector, length: int, what: str) -> np.ndarray:
    """The values as float64 [length]. Raises PoseError."""
    try:
        array = np.asarray(values, np.float64)
    except (TypeError, ValueError):
        raise PoseError(f"the {what} is not a list of numbers: {values!r}") from None
    if array.shape != (length,):
        raise PoseError(f"the {what} needs {length} numbers, not an array of shape {array.shape}")
    if not np.isfinite(array).all():
        raise PoseError(f"the {what} is not finite: {array.tolist()}")
    if (np.abs(array) > mujoco.mjMAXVAL).any():
        raise PoseError(f"the {what} is beyond the {mujoco.mjMAXVAL:g} that MuJoCo computes with: {array.tolist()}")
    return array
