"""How a gripper on an arm turns what it places: it points about to where the robot looks."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from ig2mj.geometry.host_rotations import quat_multiply
from ig2mj.planning.world import PlannedWorld

ARM_TURNS = (0.0, *(sign * k * np.pi / 4 for k in (1, 2, 3) for sign in (1, -1)), np.pi)
"""The same of a hand on an arm, which points about to where the robot looks."""

ACROSS = 0.85
"""Cosine of the angle to where the robot looks beyond which a gripper points across."""

LEVEL = 0.5
"""Sine of the angle below the horizontal from which on a gripper points down."""


def points_ahead(world: PlannedWorld, palm: Float[np.ndarray, "3"], yaw: float) -> bool:
    """Whether a gripper that points along `palm` does not point back to a robot that looks along `yaw` (rad), or across
    it; a floating hand may."""
    flat = float(np.linalg.norm(palm[:2]))
    front = np.array([np.cos(yaw), np.sin(yaw), 0.0])
    return world.body.opening is None or flat < LEVEL or float(palm @ front) > ACROSS * flat


def level_orientations(world: PlannedWorld, name: str) -> list[Float[np.ndarray, "4"]]:
    """The orientation of an object that a gripper holds from above, if the gripper pointed ahead: there is no room for
    an arm above most places inside of things. It comes to rest as it falls."""
    if world.body.opening is None or name not in world.held:
        return []
    _, palm = world.hand_axes(world.held.index(name))
    yaw = world.base[1]
    front = np.array([np.cos(yaw), np.sin(yaw), 0.0])
    axis = np.cross(palm, front)
    if palm[2] > -LEVEL or np.linalg.norm(axis) < 1e-6:
        return []
    half = np.arccos(np.clip(palm @ front, -1.0, 1.0)) / 2
    turn = np.concatenate([[np.cos(half)], np.sin(half) * axis / np.linalg.norm(axis)])
    return [np.asarray(quat_multiply(turn, world.pose(name)[1]), float)]
