"""Taking hold of what stands between the fingers by their friction alone, and carrying it."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from ig2mj.engine.view import Array
from ig2mj.geometry.poses import length, quat_rotate
from ig2mj.tasks.experts.motion import Wish, over, pointing, where, wish
from ig2mj.tasks.experts.sight import Sight

DEEP, BACK = 0.05, 0.006
"""m below the upper end of what stands at which fingers take it, and from its axis towards the wrist: behind them is
the gripper's own body. (What fingers hold creeps down by up to 1 cm/s, since MuJoCo's friction is soft.)"""

PITCH = 0.1
"""rad by which Fetch's gripper points down: steep enough that the wrist stays above the rim of a basin."""

CLEARANCE = 0.06
"""m above the upper end at which the open gripper comes over it."""

EXACT, BLEND = 0.008, 0.03
"""m beside the axis within which the gripper goes straight down, and over which it comes to do so."""

EASE = 0.6
"""Share of the way to it that the gripper goes in an action; the arm lags, and with all of it swings to and fro."""

CLOSING, BETWEEN = 0.02, 0.03
"""m from where it is taken within which fingers close, and beside the axis within which they hold it."""

SQUEEZED = 3.0
"""N of each of two fingers from which on it is held."""

AHEAD, LEFT, UP = np.eye(3, dtype=np.float32)


def grip_standing(see: Sight, name: str, carry: Float[Array, "W 3"]) -> Wish:
    """What Fetch's gripper does to an object that stands on end, and is narrower than it opens: from above, a finger on
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
    get = wish(EASE * way, pointing(quat, ahead, PITCH))
    close = wish(jnp.zeros_like(place), close=True)
    move = wish(carry, pointing(quat, see.grip() - see.base_pos(), PITCH), close=True)
    return where(held, move, where(ready, close, get))


def _standing(see: Sight, name: str) -> tuple[Float[Array, "W 3"], Float[Array, "W"]]:
    """An object's own z axis or its opposite, whichever points up, and half the object's height, m."""
    low, high = see.box(name)
    axis = quat_rotate(see.quat(name), UP)
    return axis * jnp.where(axis[:, 2:] < 0, -1.0, 1.0), 0.5 * (high - low)[:, 2]


def _level(direction: Float[Array, "W 3"]) -> Float[Array, "W 3"]:
    """A direction's horizontal part, of length 1."""
    flat = direction * (AHEAD + LEFT)
    return flat / jnp.maximum(length(flat), 1e-6)[:, None]
