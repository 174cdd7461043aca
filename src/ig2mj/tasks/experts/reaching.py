"""Taking hold of an object from above."""

from __future__ import annotations

import jax.numpy as jnp
from jaxtyping import Float

from ig2mj.engine.view import Array
from ig2mj.geometry.poses import length
from ig2mj.tasks.experts.motion import Wish, over, wish
from ig2mj.tasks.experts.sight import Sight

CLEARANCE = 0.12
"""m above an object's top at which a hand comes over it."""

CLOSING = 0.05
"""m from the point at which a hand that has to be closed does so."""

BELOW = 0.03
"""m below its top that the hand goes for: what lies there stops it."""


def take(see: Sight, name: str, hand: int = 0) -> Wish:
    """From above onto the middle of an object, until it is touched."""
    low, high = see.box(name)
    middle, top = 0.5 * (low + high), high[:, 2:]
    return take_at(see, jnp.concatenate([middle[:, :2], jnp.maximum(top, middle[:, 2:] + BELOW)], axis=1), hand)


def take_at(see: Sight, place: Float[Array, "W 3"], hand: int = 0) -> Wish:
    """From above onto a point of an object's surface, until it is touched; the hand closes when it is near."""
    down = jnp.array([0.0, 0.0, BELOW], jnp.float32)
    grip = see.grip(hand)
    return wish(over(grip, place - down, place[:, 2] + CLEARANCE), close=length(grip - place) < CLOSING)
