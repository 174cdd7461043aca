"""The controller of a URDF robot: its drive, each joint of the arm by its velocity, grippers and suction.

| numbers | in units of |
|---|---|
| forward, turn_left (where it drives) | the drive's largest speeds |
| forward, left, turn_left (of an omnidirectional base) | the drive's largest speeds |
| one for each joint of the arm, by its name | the joint's largest speed |
| gripper (where it has one; of several `<hand>_gripper`) | open from 0 on, closed below |
| `<link>_suction` for each suction cup | off from 0 on, on below |

Velocities of the arm become positions of servos, which go on from the last ones and not from where the arm sags to.
Fingers open and close at the speed of their joints, and in `CLOSING` at least, so that they do not knock away what lies
between them.

Axes: W worlds, J joints of the arm, G grippers and suction cups, F joints of all grippers.
"""

from __future__ import annotations

import dataclasses
from typing import Any

import jax.numpy as jnp
import numpy as np
from flax import struct
from jaxtyping import Bool, Float

from ig2mj.agents.base import HandReading
from ig2mj.agents.controllers import compiled_eye, differential_drive, drive_limits, wheel_odometry
from ig2mj.agents.kinematics import Chain, forward
from ig2mj.agents.urdf.base_motion import drive, glide, wheel_signs
from ig2mj.agents.urdf.body import RobotBody
from ig2mj.agents.urdf.description import Description
from ig2mj.agents.urdf.layout import OMNIDIRECTIONAL, Layout
from ig2mj.engine.view import Array, PhysicsView
from ig2mj.geometry.poses import length, quat_rotate_inverse
from ig2mj.scene.tables import SceneTables

LEASH = 0.15
"""rad or m, on top of two actions at full speed, that a servo's target may be ahead of its joint: a blocked arm
does not push ever harder."""


CLOSING = 0.5
"""s that fingers take from one limit to the other at least, as those of a Robotiq 2F-85 (150 mm/s) and a Panda do.
Files often give the speed of a bare motor."""


def finger_speeds(description: Description, layout: Layout, body: RobotBody) -> Float[np.ndarray, "F"]:
    """rad/s or m/s of all joints of grippers."""
    return np.array(
        [min(description.joint(n).speed, float(np.ptp(body.limits(n))) / CLOSING) for n in layout.gripper], np.float32
    )


@dataclasses.dataclass(frozen=True, eq=False)
class UrdfArm:
    """The arm that carries a hand.

    Attributes:
      chain: from the base to the hand. names: of its joints, which are numbers of the action, too.
      rest: rad or m, at the start. speed: rad/s or m/s at 1 of the action.
    """

    chain: Chain
    names: tuple[str, ...]
    rest: Float[np.ndarray, "J"]
    speed: Float[np.ndarray, "J"]


@struct.dataclass
class UrdfState:
    """What the controller remembers.

    Attributes:
      arm, fingers: positions of the servos. closed: the last action closed the gripper. held: it held something.
    """

    arm: Float[Array, "W J"]
    fingers: Float[Array, "W F"]
    closed: Bool[Array, "W G"]
    held: Bool[Array, "W G"]


class UrdfController:
    """See the module's text. `ig2mj.agents.base.Controller`."""

    moves_eye = False

    def __init__(
        self,
        tables: SceneTables,
        agent: int,
        period: float,
        description: Description,
        layout: Layout,
        body: RobotBody,
        hands: tuple[str, ...],
    ):
        """Of a robot that is compiled into the scene of these tables. hands: links, as the scene numbers them."""
        self.agent, self._period = agent, period
        own = tables.agent_names[agent]

        def places(names: tuple[str, ...]) -> np.ndarray:
            return np.array([tables.agent_joint_names.index(f"{own}_{n}") for n in names], int)

        glides = layout.base == OMNIDIRECTIONAL
        self._wheels = places(() if glides else layout.wheels)
        self._arm, self._fingers = places(layout.arm), places(layout.gripper)
        self._hands = np.flatnonzero(tables.hand_agent == agent)
        grippers = layout.grippers
        self._gripper_of = np.array(
            [next((g for g, one in enumerate(grippers) if n in one.joints), 0) for n in layout.gripper], int
        )
        closing = [*(one.hand for one in grippers), *layout.suction]
        of_hand = [[body.frame(link)[0] == hand for hand in hands] for link in closing]
        self._holds = np.array(of_hand, bool).reshape(len(closing), len(hands))
        self._grippers = len(grippers)
        self._arm_speed = np.array([description.joint(n).speed for n in layout.arm], np.float32)
        self._leash = (LEASH + 2 * period * self._arm_speed).astype(np.float32)
        limits = np.array([body.limits(n) for n in layout.arm], np.float32).reshape(-1, 2)
        self._low, self._high = limits[:, 0], limits[:, 1]
        ends = np.array([body.limits(n) for n in layout.gripper], np.float32).reshape(-1, 2)
        closes_low = np.array(
            [grippers[g].closes_low(n) for g, n in zip(self._gripper_of, layout.gripper, strict=True)], bool
        )
        self._finger_step = (finger_speeds(description, layout, body) * period).astype(np.float32)
        self._open = np.where(closes_low, ends[:, 1], ends[:, 0])
        self._closed = np.where(closes_low, ends[:, 0], ends[:, 1])
        self._start = np.array([body.start_of(n, layout) for n in (*layout.arm, *layout.gripper)], np.float32)
        self._drive = drive(body, layout) if layout.wheels and not glides else None
        self._signs, self._each_side = wheel_signs(body, layout), len(layout.wheels) // 2
        self._glides = np.array(glide(body, layout)[:2], np.float32)[[0, 0, 1]] if glides else None
        if self._drive is not None:
            self._speeds = drive_limits(*self._drive).astype(np.float32)
        self._chains = [(body.chain(layout, link), np.array(body.chain_joints(layout, link), int)) for link in hands]
        self.arms: tuple[UrdfArm | None, ...] = tuple(
            None if c is None else UrdfArm(c, tuple(layout.arm[k] for k in at), self._start[at], self._arm_speed[at])
            for c, at in self._chains
        )
        single = len(grippers) == 1
        self.action_names: tuple[str, ...] = (
            *(("forward", "left", "turn_left") if glides else ("forward", "turn_left") if self._drive else ()),
            *layout.arm,
            *("gripper" if single else f"{one.hand}_gripper" for one in grippers),
            *(f"{link}_suction" for link in layout.suction),
        )
        self.action_high: np.ndarray = np.ones(len(self.action_names), np.float32)
        self.action_low: np.ndarray = -self.action_high
        moving = (*layout.arm, *layout.gripper)
        self.proprioception_names: tuple[str, ...] = (
            *(("dd_base_lin_vel", "dd_base_ang_vel") if self._drive else ()),
            *(("base_lin_vel_x", "base_lin_vel_y", "base_ang_vel") if glides else ()),
            *(f"{name}_qpos" for name in moving),
            *(f"{name}_qvel" for name in moving),
            *("is_grasping" if len(hands) == 1 else f"{link}_is_grasping" for link in hands),
        )
        first = len(self.proprioception_names) - len(hands)
        self.hand_readings: tuple[HandReading, ...] = tuple(HandReading(first + k) for k in range(len(hands)))

    @property
    def action_size(self) -> int:
        return len(self.action_names)

    def initial(self, num_worlds: int) -> UrdfState:
        row = jnp.tile(jnp.asarray(self._start), (num_worlds, 1))
        no = jnp.zeros((num_worlds, len(self._holds)), bool)
        return UrdfState(row[:, : len(self._arm)], row[:, len(self._arm) :], no, no)

    def control(
        self, action: Float[Array, "W n"], view: PhysicsView, state: UrdfState
    ) -> tuple[Float[Array, "W U"], UrdfState]:
        action = jnp.clip(jnp.asarray(action, jnp.float32), self.action_low, self.action_high)
        q = jnp.asarray(view.agent.joint_pos)
        parts, first = [], 0
        if self._drive is not None:
            sides = differential_drive(action[:, :2] * self._speeds, *self._drive)
            parts.append(jnp.repeat(sides, self._each_side, axis=1) * self._signs)
            first = 2
        elif self._glides is not None:
            parts.append(action[:, :3] * self._glides)
            first = 3
        end = first + len(self._arm)
        now = q[:, self._arm]
        arm = jnp.clip(
            state.arm + action[:, first:end] * self._arm_speed * self._period, now - self._leash, now + self._leash
        )
        arm = jnp.clip(arm, self._low, self._high)
        in_hand = jnp.asarray(view.held)[:, self._hands].any(2)
        held = (in_hand[:, None] & self._holds).any(2)
        closed, fingers, of = action[:, end:] < 0, state.fingers, self._gripper_of
        if len(self._fingers):
            asked = jnp.where(closed[:, of], self._closed, self._open)
            turns = closed[:, of] != state.closed[:, of]
            begin = jnp.where(turns, q[:, self._fingers], state.fingers)
            asked = begin + jnp.clip(asked - begin, -self._finger_step, self._finger_step)
            frozen = jnp.where((held & ~state.held)[:, of], q[:, self._fingers], state.fingers)
            fingers = jnp.where(held[:, of], frozen, asked)
        cups = closed[:, self._grippers :].astype(jnp.float32)
        return jnp.concatenate([*parts, arm, fingers, cups], axis=1), UrdfState(arm, fingers, closed, held)

    def grip(self, state: UrdfState) -> Float[Array, "W H"]:
        return (state.closed[:, :, None] & self._holds).any(1).astype(jnp.float32)

    def lag(self, view: PhysicsView, state: UrdfState) -> Float[Array, "W H"]:
        """From where the arms are to where their servos pull them."""
        behind: list[Any] = [jnp.zeros((state.arm.shape[0], 0))]
        q = jnp.asarray(view.agent.joint_pos)[:, self._arm]
        for chain, joints in self._chains:
            if chain is None:
                behind.append(jnp.zeros((state.arm.shape[0], 1)))
            else:
                apart = forward(chain, state.arm[:, joints])[0] - forward(chain, q[:, joints])[0]
                behind.append(length(apart)[:, None])
        return jnp.concatenate(behind, axis=1)

    def eye(self, view: PhysicsView, state: UrdfState) -> tuple[Float[Array, "W 3"], Float[Array, "W 4"]]:
        return compiled_eye(view, self.agent)

    def proprioception(self, view: PhysicsView, state: UrdfState) -> Float[Array, "W m"]:
        """Speeds of the base computed from the wheels (m/s, rad/s), of an omnidirectional one those of the base itself
        in its own frame; positions and velocities of arm and gripper; 1 with something in the hand, else -1."""
        agent, moving = view.agent, np.concatenate([self._arm, self._fingers])
        q, speed = jnp.asarray(agent.joint_pos), jnp.asarray(agent.joint_vel)
        parts: list[Any] = []
        if self._drive is not None:
            radius, axle, _ = self._drive
            turning = (speed[:, self._wheels] * self._signs).reshape(len(speed), 2, self._each_side)
            parts.append(wheel_odometry(turning.mean(2), radius, axle))
        elif self._glides is not None:
            base = jnp.asarray(agent.base_quat)[:, self.agent]
            along = quat_rotate_inverse(base, jnp.asarray(agent.base_linvel)[:, self.agent])
            about = quat_rotate_inverse(base, jnp.asarray(agent.base_angvel)[:, self.agent])
            parts.append(jnp.concatenate([along[:, :2], about[:, 2:]], axis=1))
        parts += [q[:, moving], speed[:, moving]]
        holding = jnp.asarray(view.held)[:, self._hands].any(2)
        parts.append(jnp.where(holding, jnp.ones(holding.shape), -1.0))
        return jnp.concatenate(parts, axis=1)
