"""Friction of joints: so much that what is opened stays where it is left, so little that a hand opens it."""

from __future__ import annotations

import numpy as np

from ..shapes.sweeps import carried, turn
from .model import HouseholdObject, Joint, hull_mesh

SLIDE_FRICTION = 5.0  # N, a drawer stays where it is left
RIM_FRICTION = 4.0  # N at the farthest point of what turns on a hinge
HINGE_FRICTION = 1.0  # N m, the most that a hinge has which bears no weight
HOLD = 1.12
"""Friction of a hinge that lifts something, as a multiple of the largest torque that gravity has about it."""
ANGLES = 25  # at which gravity's torque is looked at
GRAVITY = 9.8  # m / s^2


def friction(model: HouseholdObject, joint: Joint, mass: float) -> float:
    """Coulomb friction, N or N m, of a joint of a model that stands as built and weighs `mass` kg.

    What opens about a level axis, a lid or a flap, is held at any angle, as by a friction hinge.
    """
    if joint.kind == "prismatic":
        return SLIDE_FRICTION
    axis, pivot = _axis(model, joint)
    moved = carried(model, joint)
    points = np.concatenate([p + link.origin - pivot for link in model.links if link.name in moved for p in link.hulls])
    reach = float(np.linalg.norm(points - np.outer(points @ axis, axis), axis=1).max())
    least = min(HINGE_FRICTION, RIM_FRICTION * reach)
    return max(least, HOLD * gravity_torque(model, joint, mass)) if joint.openable else least


def gravity_torque(model: HouseholdObject, joint: Joint, mass: float) -> float:
    """The largest torque, N m, that gravity has about a hinge within its range; 0 for a joint without limits.

    A link's share of the mass is that of its hulls' volume.
    """
    axis, pivot = _axis(model, joint)
    if joint.kind != "revolute" or abs(axis[2]) > 1 - 1e-9:
        return 0.0
    moved = carried(model, joint)
    total, moment = 0.0, np.zeros(3)
    for link in model.links:
        for points in link.hulls:
            mesh = hull_mesh(points)
            total += mesh.volume
            if link.name in moved:
                moment += mesh.volume * (np.asarray(mesh.center_mass) + link.origin - pivot)
    down = np.array([0.0, 0.0, -GRAVITY * mass])
    angles = np.linspace(*joint.limits, ANGLES)
    return max(abs(float(axis @ np.cross(turn(axis, angle) @ moment / total, down))) for angle in angles)


def _axis(model: HouseholdObject, joint: Joint) -> tuple[np.ndarray, np.ndarray]:
    """Unit direction of a joint's axis and a point on it, base frame, joints at 0."""
    pivot = next(link.origin for link in model.links if link.name == joint.child)
    return np.array(joint.axis) / np.linalg.norm(joint.axis), pivot
