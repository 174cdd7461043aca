"""Joints: friction, damping and limits for MuJoCo, and which joints open an object."""

from __future__ import annotations

import numpy as np

from ..base.description import Joint
from ..base.transforms import apply
from .assembly import Assembly
from .joint_limits import is_locked, joint_range, mujoco_type, unit_axis

#: iGibson holds every joint with a velocity motor of this greatest force: Coulomb friction, N or N m.
FRICTION = 10.0
FRICTION_BY_CATEGORY = {"oven": 30.0, "dishwasher": 30.0, "toilet": 3.0}
#: A hinge is held by no more than what this force (N) at the farthest point of the moving part overcomes. It changes
#: iGibson's value only for parts that reach less than 10 cm from their axis (knobs, small lids), which no hand
#: could turn otherwise.
FRICTION_LIMIT_AT_RIM = 100.0
#: Small values that keep light parts stable at 1/120 s; far below what the friction does.
DAMPING = {"hinge": 0.05, "slide": 0.5}  # N m s / rad, N s / m
ARMATURE = {"hinge": 1e-3, "slide": 1e-2}  # kg m^2, kg


def friction(joint: Joint, category: str, reach: float) -> float:
    """Coulomb friction of a joint, N or N m.

    The URDF's own `<dynamics friction>` where it gives one, else iGibson's motor: objects of iGibson's dataset never
    give one.

    Args:
      category: of the object; ovens, dishwashers and toilets have values of their own.
      reach: largest distance of the moving part from the joint's axis, m.
    """
    if joint.friction > 0:
        return float(joint.friction)
    value = FRICTION_BY_CATEGORY.get(category, FRICTION)
    return value if mujoco_type(joint) == "slide" else min(value, FRICTION_LIMIT_AT_RIM * reach)


def reach(assembly: Assembly, index: int) -> float:
    """Largest distance, m, of any collision piece moved by body `index` from the axis of its joint, at position 0."""
    body = assembly.bodies[index]
    assert body.joint is not None
    axis = unit_axis(body.joint)
    points = [np.zeros((1, 3))]
    poses = {index: np.eye(4)}
    for i, other in enumerate(assembly.bodies):
        if other.parent in poses and i not in poses:
            poses[i] = poses[other.parent] @ other.pose
        if i in poses:
            points += [apply(poses[i], piece.vertices) for piece in other.collisions]
    cloud = np.concatenate(points)
    return float(np.linalg.norm(cloud - np.outer(cloud @ axis, axis), axis=1).max())


def openable_ends(assembly: Assembly) -> tuple[list[tuple[str, float, float]], list[str]]:
    """Joints that say whether the object is open: (joint, closed end, open end), and warnings.

    The closed end is the lower limit, or the upper one where metadata.json gives direction -1.
    """
    joints = {joint.name: joint for joint in assembly.joints()}
    ends, warnings = [], []
    for name, direction in assembly.model.metadata.openable_joints:
        limits = joint_range(joints[name]) if name in joints else None
        if limits is None or is_locked(joints[name]):
            why = "has no limits" if name in joints else "is not a moving joint"
            warnings.append(f"openable joint '{name}' {why}; ignored when deciding whether the object is open")
            continue
        lower, upper = limits
        ends.append((name, lower, upper) if direction >= 0 else (name, upper, lower))
    return ends, warnings
