"""Taking hold of what stands between the fingers by their friction alone, and carrying it."""

from __future__ import annotations

import jax.numpy as jnp
from jaxtyping import Float

from ig2mj.engine.view import Array
from ig2mj.geometry.poses import length, quat_conjugate, quat_multiply, quat_rotate, quat_to_rotation_vector
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

AHEAD, LEFT, UP = jnp.eye(3)[0], jnp.eye(3)[1], jnp.eye(3)[2]

UPRIGHT_HAND = jnp.array([0.5, -0.5, 0.5, 0.5])
"""Of the humanoid's right hand in the body's frame: fingers ahead, the palm to the left, the thumb up."""

PRE, FORWARD = 0.06, -0.015
"""m to the right of an object at which the open hand comes down, and from the middle of the palm ahead to its axis."""

TURNED = 0.15
"""rad off `UPRIGHT_HAND` within which the palm is brought to the object."""

TOUCH = 0.012
"""m from the palm's place at the object within which fingers close."""

FIRM = 8.0
"""N of each of two fingers from which on the humanoid's hand holds it."""

LOST = 0.08
"""m from the palm's middle beyond which an object is not in the hand."""


def grip_standing(see: Sight, name: str, carry: Float[Array, "W 3"]) -> Wish:
    """What the acting hand does to an object that stands on end, and is narrower than the hand opens.

    Args:
      carry: displacement of the object once it is held.
    """
    return _by_gripper(see, name, carry) if see.robot == "fetch" else _by_palm(see, name, carry)


def _by_gripper(see: Sight, name: str, carry: Float[Array, "W 3"]) -> Wish:
    """From above, a finger on either side."""
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


def _by_palm(see: Sight, name: str, carry: Float[Array, "W 3"]) -> Wish:
    """From the right, with the palm upright, and fingers around it."""
    axis, half = _standing(see, name)
    (low, high), grip, base = see.box(name), see.grip(), see.base_quat()
    ahead, left = quat_rotate(base, AHEAD), quat_rotate(base, LEFT)
    wanted = quat_multiply(base, jnp.broadcast_to(UPRIGHT_HAND, base.shape))
    turn = quat_to_rotation_vector(quat_multiply(wanted, quat_conjugate(see.hand_quat())))
    turned = length(turn) < TURNED
    radius = 0.25 * (high - low)[:, :2].sum(1)
    middle = see.com(name) + axis * (half - DEEP)[:, None]
    place = middle - radius[:, None] * left - FORWARD * ahead
    off = place - grip
    aside = off - jnp.sum(off * left, axis=1, keepdims=True) * left
    beside_it = (length(aside) < CLOSING) & turned
    wait = place - PRE * left
    wait = jnp.where(turned[:, None], wait, wait + (2 * CLEARANCE + DEEP) * UP)
    get = wish(over(grip, wait, wait[:, 2] + 2 * CLEARANCE + DEEP), turn)
    touch = wish(off, turn)
    ready = beside_it & (length(off) < TOUCH)
    inside = (length(middle - grip) < LOST) & (see.squeeze(name) > 0.5)
    held = inside & (see.squeeze(name) > FIRM)
    close = wish(jnp.zeros_like(place), turn, close=True)
    return where(held, wish(carry, turn, close=True), where(ready | inside, close, where(beside_it, touch, get)))


def _standing(see: Sight, name: str) -> tuple[Float[Array, "W 3"], Float[Array, "W"]]:
    """An object's own z axis or its opposite, whichever points up, and half the object's height, m."""
    low, high = see.box(name)
    axis = quat_rotate(see.quat(name), UP)
    return axis * jnp.where(axis[:, 2:] < 0, -1.0, 1.0), 0.5 * (high - low)[:, 2]


def _level(direction: Float[Array, "W 3"]) -> Float[Array, "W 3"]:
    """A direction's horizontal part, of length 1."""
    flat = direction * (AHEAD + LEFT)
    return flat / jnp.maximum(length(flat), 1e-6)[:, None]
