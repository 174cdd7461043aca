"""How hands move: memoryless displacements towards goals that stay above surrounding objects.

Axes: W worlds.
"""

from __future__ import annotations

import jax.numpy as jnp
from flax import struct
from jaxtyping import Bool, Float

from ig2mj.engine.view import Array
from ig2mj.geometry.poses import (
    axis_angle_to_quat,
    length,
    quat_conjugate,
    quat_multiply,
    quat_rotate,
    quat_to_rotation_vector,
)

DESCENT, BLEND = 0.03, 0.06
"""m: horizontal distance to a goal within which a hand goes straight down, and over which it comes down to that."""

RISE = 0.06
"""m below the height of travel at which a hand does not move sideways yet."""


@struct.dataclass
class HandMotion:
    """What one hand should do now; world frame.

    Attributes:
      move: m that the palm should be displaced by. turn: rotation vector by which it should be turned.
      close: the hand should be closed.
    """

    move: Float[Array, "W 3"]
    turn: Float[Array, "W 3"]
    close: Bool[Array, "W"]


def hand_motion(
    move: Float[Array, "W 3"], turn: Float[Array, "W 3"] | None = None, close: Array | bool = False
) -> HandMotion:
    """What a hand should do; without a turn the hand keeps its orientation."""
    return HandMotion(move, jnp.zeros_like(move) if turn is None else turn, jnp.broadcast_to(close, move.shape[:1]))


def over(
    pos: Float[Array, "W 3"],
    goal: Float[Array, "W 3"],
    height: Float[Array, "W"] | float,
    near: float = DESCENT,
    blend: float = BLEND,
) -> Float[Array, "W 3"]:
    """From `pos` to `goal`: up to `height` first, then across, at last straight to the goal.

    Args:
      height: z of the way across, m; not below the goal. near: horizontal distance from which it goes straight down.
      blend: further distance over which it comes down to that.
    """
    offset = goal - pos
    share = jnp.clip((length(offset[:, :2]) - near) / blend, 0.0, 1.0)
    level = goal[:, 2] + (jnp.maximum(height, goal[:, 2]) - goal[:, 2]) * share
    rise = level - pos[:, 2]
    across = jnp.clip(1.5 - rise / RISE, 0.0, 1.0)[:, None] * offset[:, :2]
    return jnp.concatenate([across, rise[:, None]], axis=1)


def around(
    pos: Float[Array, "W 3"], move: Float[Array, "W 3"], base: Float[Array, "W 3"], radius: float
) -> Float[Array, "W 3"]:
    """A displacement that does not lead nearer to the robot's own body than `radius`, and out of it where it is nearer.

    Args:
      base: of the robot; distances are horizontal.
    """
    offset = pos[:, :2] - base[:, :2]
    apart = length(offset)[:, None]
    out = offset / jnp.maximum(apart, 1e-6)
    along = jnp.sum(move[:, :2] * out, axis=1, keepdims=True)
    requested = jnp.maximum(along, radius - apart)
    flat = move[:, :2] + (requested - along) * out
    return jnp.concatenate([flat, move[:, 2:]], axis=1)


def levelled(quat: Float[Array, "W 4"]) -> Float[Array, "W 3"]:
    """The rotation vector, world frame, that makes an object's z axis vertical again, up or down as it nearly is."""
    axis = quat_rotate(quat, jnp.array([0.0, 0.0, 1.0]))
    up = jnp.zeros_like(axis).at[:, 2].set(jnp.where(axis[:, 2] < 0, -1.0, 1.0))
    return jnp.cross(axis, up)  # its length is the angle's sine: right for what is nearly level


def horizontal(direction: Float[Array, "W 3"]) -> Float[Array, "W 3"]:
    """The rotation vector that brings a direction of the world, which is nearly horizontal, to horizontal."""
    flat = direction * jnp.array([1.0, 1.0, 0.0])
    return jnp.cross(direction, flat / jnp.maximum(length(flat), 1e-6)[:, None])


def outward(quat: Float[Array, "W 4"], offset: Float[Array, "W 3"]) -> Float[Array, "W 3"]:
    """The rotation vector about the vertical by which a gripper comes to point away from the robot's middle.

    An arm reaches farthest so. With the orientation that it had ahead of the robot it does not reach far to the side.

    Args:
      quat: of the gripper, whose x axis points ahead. offset: from the robot's middle to it.
    """
    ahead = quat_rotate(quat, jnp.array([1.0, 0.0, 0.0]))
    across = ahead[:, 0] * offset[:, 1] - ahead[:, 1] * offset[:, 0]
    along = ahead[:, 0] * offset[:, 0] + ahead[:, 1] * offset[:, 1]
    return jnp.zeros_like(offset).at[:, 2].set(jnp.arctan2(across, along))


def pointing(quat: Float[Array, "W 4"], direction: Float[Array, "W 3"], pitch: float) -> Float[Array, "W 3"]:
    """The rotation vector by which a gripper comes to point along a direction, and down by `pitch`, its fingers side by
    side; either way up, whichever is nearer.

    Args:
      quat: of the gripper, whose x axis points ahead and whose fingers are at +-y. direction: its z does not count.
    """
    yaw = jnp.arctan2(direction[:, 1], direction[:, 0])
    up = jnp.array([0.0, 0.0, 1.0])
    level = axis_angle_to_quat(up, yaw)
    requested = quat_multiply(level, axis_angle_to_quat(jnp.array([0.0, 1.0, 0.0]), jnp.full_like(yaw, pitch)))
    left = quat_rotate(level, jnp.array([0.0, 1.0, 0.0]))
    upside_down = jnp.sum(left * quat_rotate(quat, jnp.array([0.0, 1.0, 0.0])), axis=1) < 0
    over = quat_multiply(requested, jnp.array([0.0, 1.0, 0.0, 0.0]))
    requested = jnp.where(upside_down[:, None], over, requested)
    return quat_to_rotation_vector(quat_multiply(requested, quat_conjugate(quat)))


def where(condition: Bool[Array, "W"], then: HandMotion, otherwise: HandMotion) -> HandMotion:
    """One motion where the condition holds, else the other."""

    def pick(a: Array, b: Array) -> Array:
        return jnp.where(condition.reshape(-1, *[1] * (a.ndim - 1)), a, b)

    return HandMotion(
        pick(then.move, otherwise.move), pick(then.turn, otherwise.turn), pick(then.close, otherwise.close)
    )
