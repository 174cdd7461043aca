"""Taking hold of something between two fingers by their friction alone, and carrying it."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from ig2mj.engine.view import Array
from ig2mj.geometry.poses import (
    length,
    matrix_to_quat,
    quat_conjugate,
    quat_multiply,
    quat_rotate,
    quat_to_rotation_vector,
)
from ig2mj.tasks.experts.motion import HandMotion, hand_motion, over, pointing, where
from ig2mj.tasks.experts.sight import ExpertView

DEEP, BACK = 0.05, -0.004
"""m below the upper end of what stands at which fingers take it, and from its axis towards the wrist. (What fingers
hold creeps down by up to 1 cm/s, since MuJoCo's friction is soft, and forwards while the arm swings it.)"""

CARRIED = 0.022
"""m of an action in which it is carried: with 0.04 it slid out of the fingers in two thirds of the episodes."""

PITCH = 0.1
"""rad by which Fetch's gripper points down: steep enough that the wrist stays above the rim of a basin."""

CLEARANCE = 0.06
"""m above the upper end at which the open gripper comes over it."""

EXACT, BLEND = 0.015, 0.03
"""m next to the axis within which the gripper goes straight down, and over which it comes to do so. The fingers have as
much on either side of a towel; with a smaller distance, a policy that sees images stays above it."""

EASE = 0.6
"""Share of the way to it that the gripper goes in an action; the arm lags, and with all of it swings to and fro."""

CLOSING, BETWEEN = 0.02, 0.045
"""m from where it is taken within which fingers close, and next to the axis within which they hold it."""

SQUEEZED = 3.0
"""N of each of two fingers from which on it is held."""

PAD, ABOVE, ALIGNED = 0.035, 0.08, 0.15
"""From above: m over what an object lies on at which the middle of the fingers, which reach 3.2 cm further, takes it; m
above that at which the gripper turns; rad within which it is turned."""

AT, AWAY = 0.012, 0.15
"""m from where it is taken within which fingers close; m from the middle of the fingers beyond which it is not held."""

AHEAD, LEFT, UP = np.eye(3, dtype=np.float32)


def grip_standing(see: ExpertView, name: str, carry: Float[Array, "W 3"]) -> HandMotion:
    """Fetch's gripper takes an object that stands on end, and is narrower than it opens, from above, with a finger on
    either side.

    Args:
      carry: displacement of the object once it is held.
    """
    axis, half = _standing(see, name)
    quat = see.hand_quat()
    ahead = quat_rotate(quat, AHEAD)
    grip = see.grip() + BACK * _level(ahead)
    off = grip - see.com(name)
    along = jnp.sum(off * axis, axis=1)
    beside = length(off - along[:, None] * axis)
    place = see.com(name) + axis * (half - DEEP)[:, None]
    ready = length(grip - place) < CLOSING
    held = (see.squeeze(name) > SQUEEZED) & (beside < BETWEEN) & (along > 0) & (along < half)
    way = over(grip, place, place[:, 2] + DEEP + CLEARANCE, EXACT, BLEND)
    get = hand_motion(EASE * way, pointing(quat, ahead, PITCH))
    close = hand_motion(jnp.zeros_like(place), close=True)
    gently = carry * jnp.minimum(1.0, CARRIED / jnp.maximum(jnp.abs(carry).max(axis=1, keepdims=True), 1e-9))
    move = hand_motion(gently, pointing(quat, see.grip() - see.base_pos(), PITCH), close=True)
    return where(held, move, where(ready, close, get))


def grip_from_above(see: ExpertView, name: str, along: Float[Array, "W 3"], carry: HandMotion) -> HandMotion:
    """Fetch's gripper takes something long on a table that is narrower than it opens: pointing down, with a finger on
    either side of its centre of mass, so that it does not tip between them.

    Args:
      along: the long axis, of length 1, nearly level. carry: what is done once it is held.
    """
    quat, grip = see.hand_quat(), see.grip()
    low, _ = see.box(name)
    place = jnp.asarray(see.com(name))
    place = place.at[:, 2].max(low[:, 2] + PAD)
    across = jnp.cross(jnp.broadcast_to(UP, place.shape), _level(along))
    across *= jnp.where(jnp.sum(across * quat_rotate(quat, LEFT), axis=1) < 0, -1.0, 1.0)[:, None]
    down = jnp.broadcast_to(-UP, place.shape)
    requested = matrix_to_quat(jnp.stack([down, across, jnp.cross(down, across)], axis=-1))
    turn = quat_to_rotation_vector(quat_multiply(requested, quat_conjugate(quat)))
    goal = jnp.where((length(turn) < ALIGNED)[:, None], place, place + ABOVE * UP)
    get = hand_motion(EASE * over(grip, goal, place[:, 2] + ABOVE, EXACT, BLEND), turn)
    close = hand_motion(jnp.zeros_like(place), close=True)
    ready = (length((place - grip)[:, :2]) < AT) & (jnp.abs((place - grip)[:, 2]) < AT)
    held = (see.squeeze(name) > SQUEEZED) & (length(see.com(name) - grip) < AWAY)
    return where(held, carry, where(ready, close, get))


def _standing(see: ExpertView, name: str) -> tuple[Float[Array, "W 3"], Float[Array, "W"]]:
    """An object's own z axis or its opposite, whichever points up, and half the object's height, m."""
    low, high = see.box(name)
    axis = quat_rotate(see.quat(name), UP)
    return axis * jnp.where(axis[:, 2:] < 0, -1.0, 1.0), 0.5 * (high - low)[:, 2]


def _level(direction: Float[Array, "W 3"]) -> Float[Array, "W 3"]:
    """A direction's horizontal part, of length 1."""
    flat = direction * (AHEAD + LEFT)
    return flat / jnp.maximum(length(flat), 1e-6)[:, None]
