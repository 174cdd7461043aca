"""Fetch's proprioception: iGibson's default list of 41 numbers, and the 49 of its experiments with activities.

Axes: W worlds, 14 joints in the order of `JOINT_NAMES`.
"""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float

from ig2mj.agents.base import HandReading
from ig2mj.agents.controllers import sines_and_cosines, wheel_odometry
from ig2mj.agents.fetch.figures import (
    ARM,
    AXLE,
    CAMERA_JOINTS,
    CHAIN,
    CHAIN_JOINTS,
    DAMPING,
    EFFORT,
    FINGERS,
    STIFFNESS,
    TRUNK,
    WHEEL_RADIUS,
    WHEELS,
)
from ig2mj.agents.kinematics import forward
from ig2mj.engine.view import Array, PhysicsView
from ig2mj.geometry.poses import quat_rotate_inverse, quat_to_rpy

JOINT_NAMES = (
    *("r_wheel", "l_wheel", "torso_lift", "head_pan", "head_tilt"),
    *("shoulder_pan", "shoulder_lift", "upperarm_roll", "elbow_flex", "forearm_roll", "wrist_flex", "wrist_roll"),
    *("r_gripper_finger", "l_gripper_finger"),
)

DEFAULT = (
    *(f"camera_qpos_{f}_{n}" for f in ("sin", "cos") for n in ("pan", "tilt")),
    *(f"base_qpos_{f}_{n}" for f in ("sin", "cos") for n in ("r_wheel", "l_wheel")),
    *(f"robot_lin_vel_{n}" for n in "xyz"),
    *(f"robot_ang_vel_{n}" for n in "xyz"),
    *("dd_base_lin_vel", "dd_base_ang_vel"),
    *(f"arm_0_qpos_{f}_{JOINT_NAMES[j]}" for f in ("sin", "cos") for j in ARM),
    *(f"eef_0_pos_{n}" for n in "xyz"),
    *(f"eef_0_quat_{n}" for n in "wxyz"),
    *("gripper_0_qpos_right", "gripper_0_qpos_left", "grasp_0", "trunk_qpos"),
)
"""iGibson's default list."""

EXPERIMENTS = (
    *(f"eef_0_pos_{n}" for n in "xyz"),
    *(f"eef_0_{n}" for n in ("roll", "pitch", "yaw")),
    "has_grasped",
    *(f"{name}_{kind}" for name in JOINT_NAMES for kind in ("position", "velocity", "torque")),
)
"""That of the experiments with activities."""

LISTS = {"default": DEFAULT, "experiments": EXPERIMENTS}

HAND_READINGS = {
    "default": (HandReading(DEFAULT.index("grasp_0")),),  # its orientation is a quaternion there
    "experiments": (HandReading(EXPERIMENTS.index("has_grasped"), EXPERIMENTS.index("eef_0_pos_x")),),
}
"""Where the gripper stands in each of the `LISTS`."""


def feel(
    which: str,
    view: PhysicsView,
    agent: int,
    q: Float[Array, "W 14"],
    speed: Float[Array, "W 14"],
    asked: Float[Array, "W 14"],
    held: Bool[Array, "W"],
) -> Float[Array, "W m"]:
    """One of the `LISTS`: rad, m, rad/s, m/s, N m and N; the gripper's pose in the base's frame.

    Args:
      agent: its number. q, speed: positions and velocities of its joints.
      asked: of its servos: velocities of the wheels, positions of all other joints. held: the gripper holds something.
    """
    pos, quat, _ = forward(CHAIN, q[:, np.array(CHAIN_JOINTS)])
    grasp = jnp.where(held, 1.0, -1.0)[:, None]
    if which == "experiments":
        joints = jnp.stack([q, speed, torques(q, speed, asked)], axis=-1)
        return jnp.concatenate([pos, quat_to_rpy(quat), held[:, None], joints.reshape(len(q), -1)], axis=1)
    base = jnp.asarray(view.agent.base_quat)[:, agent]
    return jnp.concatenate(
        [
            sines_and_cosines(q[:, np.array(CAMERA_JOINTS)]),
            sines_and_cosines(q[:, np.array(WHEELS)]),
            quat_rotate_inverse(base, jnp.asarray(view.agent.base_linvel)[:, agent]),
            quat_rotate_inverse(base, jnp.asarray(view.agent.base_angvel)[:, agent]),
            wheel_odometry(speed[:, np.array(WHEELS[::-1])], WHEEL_RADIUS, AXLE),
            sines_and_cosines(q[:, np.array(ARM)]),
            pos,
            quat,
            q[:, np.array(FINGERS)],
            grasp,
            q[:, np.array(TRUNK)],
        ],
        axis=1,
    )


def torques(q: Float[Array, "W 14"], speed: Float[Array, "W 14"], asked: Float[Array, "W 14"]) -> Float[Array, "W 14"]:
    """N m (N of slides) of the servos, by their law (see `ig2mj.agents.parts.servo`)."""
    stiffness, damping = jnp.asarray(STIFFNESS, jnp.float32), jnp.asarray(DAMPING, jnp.float32)
    drive = jnp.where(stiffness > 0, stiffness * (asked - q), damping * asked) - damping * speed
    return jnp.clip(drive, -jnp.asarray(EFFORT, jnp.float32), jnp.asarray(EFFORT, jnp.float32))
