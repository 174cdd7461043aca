"""How the base of a converted robot drives: radius and distance of its wheels, speeds and forces."""

from __future__ import annotations

import numpy as np

from ig2mj.agents.urdf.body import RobotBody
from ig2mj.agents.urdf.layout import Layout

GLIDE_SPEED, GLIDE_TURN, GLIDE_ACCELERATION = 1.0, 2.0, 4.0
"""m/s, rad/s and m/s2: most of an omnidirectional base."""


def drive(body: RobotBody, layout: Layout) -> tuple[float, float, float]:
    """Radius of the wheels and distance between both sides (m), and their largest speed (rad/s)."""
    hubs = np.array([body.pose(body.description.joint(name).child)[0] for name in layout.wheels])
    left, right = hubs.reshape(2, -1, 3).mean(1)
    radius = float(np.mean(hubs[:, 2])) + body.standing(layout)
    speed = min(body.description.joint(name).speed for name in layout.wheels)
    return radius, float(np.linalg.norm(left - right)), speed


def glide(body: RobotBody, layout: Layout) -> tuple[float, float, float]:
    """Largest speeds of an omnidirectional base (m/s and rad/s), and the force that drives it (N)."""
    speed, arm, push = GLIDE_SPEED, 0.0, 0.0
    if layout.wheels:
        joints = [body.description.joint(name) for name in layout.wheels]
        hubs = np.array([body.hub(joint.name) for joint in joints])
        radius = max(float(np.mean(hubs[:, 2])) + body.standing(layout), 0.01)
        arm = float(np.linalg.norm(hubs[:, :2] - hubs[:, :2].mean(0), axis=1).mean())
        speed = min(GLIDE_SPEED, radius * min(joint.speed for joint in joints))
        push = sum(joint.force for joint in joints) / radius
    return speed, min(GLIDE_TURN, speed / max(arm, 0.1)), min(push or np.inf, body.mass * GLIDE_ACCELERATION)


def wheel_signs(body: RobotBody, layout: Layout) -> np.ndarray:
    """1 for a wheel whose joint turns about the robot's y axis, -1 for one that turns the other way."""
    return np.array([1.0 if body.axis(name)[1] >= 0 else -1.0 for name in layout.wheels])
