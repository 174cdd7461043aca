"""Taking hold of an object from above."""

from __future__ import annotations

import jax.numpy as jnp

from ig2mj.tasks.experts.motion import Wish, over, wish
from ig2mj.tasks.experts.sight import Sight

CLEARANCE = 0.12
"""m above an object's top at which a hand comes over it."""

BELOW = 0.03
"""m below its top that the hand goes for: what lies there stops it."""


def take(see: Sight, name: str, hand: int = 0, clearance: float = CLEARANCE) -> Wish:
    """From above onto the middle of an object, until it is touched."""
    low, high = see.box(name)
    middle, top = 0.5 * (low + high), high[:, 2]
    height = jnp.maximum(top - BELOW, middle[:, 2])
    goal = jnp.concatenate([middle[:, :2], height[:, None]], axis=1)
    return wish(over(see.grip(hand), goal, top + clearance))
