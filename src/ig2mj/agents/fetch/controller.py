"""Fetch's eleven-number action and its proprioception (iGibson's fetch.py).

| numbers | in units of |
|---|---|
| forward, turn_left | the drive's largest speeds |
| head_pan, head_tilt | 1.57 rad/s |
| eef_x, eef_y, eef_z | 0.2 m that the gripper is to move in the base's frame |
| eef_rx, eef_ry, eef_rz | 0.5 rad that it is to turn about the base's axes (a rotation vector) |
| gripper | open from 0 on, closed below |

As in iGibson the joints move at twice the distance to the solution of the inverse kinematics per second, and an
action's goal begins at the present pose: in an action of 0.1 s a fifth of the way is made. Its velocities become
positions of servos, which go on from the last ones and not from where the arm sags to.

Axes: W worlds, 14 joints, 8 joints of trunk and arm.
"""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
from flax import struct
from jaxtyping import Bool, Float

from ig2mj.agents.base import HandReading
from ig2mj.agents.controllers import (
    compiled_eye,
    differential_drive,
    drive_limits,
    scale_command,
    two_finger_grip,
)
from ig2mj.agents.fetch.figures import (
    AXLE,
    CAMERA_JOINTS,
    CHAIN,
    CHAIN_JOINTS,
    FINGERS,
    LOWER,
    MAX_WHEEL,
    UPPER,
    VELOCITY,
    WHEEL_RADIUS,
)
from ig2mj.agents.fetch.proprioception import HAND_READINGS, JOINT_NAMES, LISTS, feel
from ig2mj.agents.kinematics import forward, inverse
from ig2mj.engine.view import Array, PhysicsView
from ig2mj.geometry.poses import length, quat_multiply, rotation_vector_to_quat
from ig2mj.scene.tables import SceneTables

GAIN = 2.0
"""1/s: joint velocity for each radian (or metre) to the solution (iGibson's kv)."""

STRETCH = np.array([0.2, 0.2, 0.2, 0.5, 0.5, 0.5])
"""m and rad: goal of a full command."""

EASE = (VELOCITY[CHAIN_JOINTS] / VELOCITY[CHAIN_JOINTS].max()) ** 2
"""Weights of trunk and arm in inverse kinematics: squares of their speed limits. With equal weights the slow trunk
(0.1 m/s) makes most of each vertical movement, and the arm moves at a third of its speed."""

AHEAD, POSTURE = 0.25, 0.005
"""Share of a command that inverse kinematics solves, and of the way to the posture at rest that its iterations make.
A full command's goal is 0.2 m ahead, of which an action makes a fifth; with the gripper's orientation kept it is often
out of reach: the iterations do not converge, and the arm nearly stops. What they find for the near goal goes on."""

LEASH = 0.15
"""rad or m that a servo's target may be ahead of its joint: a blocked arm does not push ever harder."""


@struct.dataclass
class FetchState:
    """What the controller remembers.

    Attributes:
      target: positions that the servos are at, of the joints from the trunk on. wheels: rad/s of the wheels'.
      solution: of the inverse kinematics at the last action, which is averaged with the next; known: there was one.
      closed: the last action closed the gripper. held: it held something at the last action.
    """

    target: Float[Array, "W 12"]
    wheels: Float[Array, "W 2"]
    solution: Float[Array, "W 8"]
    known: Bool[Array, "W"]
    closed: Bool[Array, "W"]
    held: Bool[Array, "W"]


class FetchController:
    """See the module's text. `ig2mj.agents.base.Controller`."""

    action_names: tuple[str, ...] = (
        *("forward", "turn_left", "head_pan", "head_tilt"),
        *("eef_x", "eef_y", "eef_z", "eef_rx", "eef_ry", "eef_rz", "gripper"),
    )
    moves_eye = False
    action_low: np.ndarray = -np.ones(11)
    action_high: np.ndarray = np.ones(11)

    def __init__(
        self,
        tables: SceneTables,
        agent: int,
        period: float,
        start: Float[np.ndarray, "14"],
        proprioception: str = "default",
    ):
        """Args: start: positions of the joints. proprioception: one of `ig2mj.agents.fetch.proprioception.LISTS`."""
        self.agent, self._period, self._start = agent, period, np.asarray(start)
        self._list, self.proprioception_names = proprioception, LISTS[proprioception]
        self.hand_readings: tuple[HandReading, ...] = HAND_READINGS[proprioception]
        name = tables.agent_names[agent]
        self._joints = np.array([tables.agent_joint_names.index(f"{name}_{n}_joint") for n in JOINT_NAMES])
        self._hand = np.flatnonzero(tables.hand_agent == agent)
        self._drive = drive_limits(WHEEL_RADIUS, AXLE, MAX_WHEEL)

    @property
    def rest(self) -> Float[np.ndarray, "14"]:
        """Positions of the joints that inverse kinematics keep near."""
        return self._start

    @property
    def stretch(self) -> Float[np.ndarray, "6"]:
        """m and rad that the gripper is to move and turn at 1 of the action; see the module's text."""
        return STRETCH

    @property
    def action_size(self) -> int:
        return len(self.action_names)

    def initial(self, num_worlds: int) -> FetchState:
        no = jnp.zeros(num_worlds, bool)
        target = jnp.tile(jnp.asarray(self._start[2:], jnp.float32), (num_worlds, 1))
        wheels, solution = jnp.zeros((num_worlds, 2), jnp.float32), jnp.zeros((num_worlds, 8), jnp.float32)
        return FetchState(target, wheels, solution, no, no, no)

    def control(
        self, action: Float[Array, "W 11"], view: PhysicsView, state: FetchState
    ) -> tuple[Float[Array, "W 14"], FetchState]:
        ones = np.ones(2)
        q = jnp.asarray(view.agent.joint_pos)[:, self._joints]
        drive = scale_command(action[:, :2], -ones, ones, -self._drive, self._drive)
        wheels = differential_drive(drive, WHEEL_RADIUS, AXLE, MAX_WHEEL)[:, ::-1]  # ours are right, left

        speed = VELOCITY[CAMERA_JOINTS]
        camera = self._move(state, q, CAMERA_JOINTS, scale_command(action[:, 2:4], -ones, ones, -speed, speed))
        solution = self._solve(scale_command(action[:, 4:10], -np.ones(6), np.ones(6), -STRETCH, STRETCH), q)
        goal = jnp.where(state.known[:, None], (solution + state.solution) / 2, solution)
        chain = self._move(state, q, CHAIN_JOINTS, GAIN * (goal - q[:, np.array(CHAIN_JOINTS)]))

        command = jnp.asarray(action, jnp.float32)[:, 10:]
        held = jnp.asarray(view.held)[:, self._hand].any((1, 2))
        newly = (held & ~state.held)[:, None]
        fingers = jnp.where(newly, q[:, np.array(FINGERS)], state.target[:, np.array(FINGERS) - 2])
        fingers = jnp.where(held[:, None], fingers, two_finger_grip(command, LOWER[12], UPPER[12]))

        target = jnp.concatenate([chain[:, :1], camera, chain[:, 1:], fingers], axis=1)
        new = FetchState(target, wheels, solution, jnp.ones_like(state.known), command[:, 0] < 0, held)
        return jnp.concatenate([wheels, target], axis=1), new

    def _solve(self, command: Float[Array, "W 6"], q: Float[Array, "W 14"]) -> Float[Array, "W 8"]:
        """Trunk and arm for a gripper that is moved by a command from where it is."""
        q = q[:, np.array(CHAIN_JOINTS)]
        pos, quat, _ = forward(CHAIN, q)
        near = AHEAD * command
        turned = quat_multiply(rotation_vector_to_quat(near[:, 3:]), quat)
        found = inverse(CHAIN, q, pos + near[:, :3], turned, self._start[CHAIN_JOINTS], posture=POSTURE, ease=EASE)
        return q + (found - q) / AHEAD

    def _move(
        self, state: FetchState, q: Float[Array, "W 14"], joints: list[int], velocity: Float[Array, "W n"]
    ) -> Float[Array, "W n"]:
        """Targets after an action at these velocities, within the limits of position and velocity.

        Where one joint would be too fast all are slowed down alike, so that the gripper keeps its direction (iGibson
        clips each by itself).
        """
        at = np.array(joints)
        velocity = velocity / jnp.maximum(1.0, jnp.max(jnp.abs(velocity) / VELOCITY[at], axis=1, keepdims=True))
        target = jnp.clip(state.target[:, at - 2] + velocity * self._period, q[:, at] - LEASH, q[:, at] + LEASH)
        return jnp.clip(target, jnp.asarray(LOWER[at], jnp.float32), jnp.asarray(UPPER[at], jnp.float32))

    def grip(self, state: FetchState) -> Float[Array, "W 1"]:
        return state.closed[:, None].astype(jnp.float32)

    def lag(self, view: PhysicsView, state: FetchState) -> Float[Array, "W 1"]:
        """From where trunk and arm are to where their servos pull them."""
        q = jnp.asarray(view.agent.joint_pos)[:, self._joints][:, np.array(CHAIN_JOINTS)]
        pulled, _, _ = forward(CHAIN, state.target[:, np.array(CHAIN_JOINTS) - 2])
        return length(pulled - forward(CHAIN, q)[0])[:, None]

    def eye(self, view: PhysicsView, state: FetchState) -> tuple[Float[Array, "W 3"], Float[Array, "W 4"]]:
        return compiled_eye(view, self.agent)

    def proprioception(self, view: PhysicsView, state: FetchState) -> Float[Array, "W m"]:
        """See `ig2mj.agents.fetch.proprioception`."""
        agent = view.agent
        q, speed = jnp.asarray(agent.joint_pos)[:, self._joints], jnp.asarray(agent.joint_vel)[:, self._joints]
        held = jnp.asarray(view.held)[:, self._hand].any((1, 2))
        asked = jnp.concatenate([state.wheels, state.target], axis=1)
        return feel(self._list, view, self.agent, q, speed, asked, held)
