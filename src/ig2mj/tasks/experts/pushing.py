"""Sliding an object over its support without a grasp: closed fingers press on it and drag it along."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from ig2mj.engine.view import Array
from ig2mj.geometry.poses import length
from ig2mj.tasks.experts.motion import HandMotion, hand_motion, where
from ig2mj.tasks.experts.reaching import far_out, take_at
from ig2mj.tasks.experts.sight import ExpertView

PRESS, SINK = 10.0, 0.02
"""N with which it is pressed down, and m that the hand goes down for it in an action where there is no force yet."""

ON_IT, ABOVE = 0.06, 0.06
"""m next to and above the point to press on within which a hand that touches the object draws it."""

SPEED = 0.03
"""m in an action."""

FLAT = np.array([1.0, 1.0, 0.0], np.float32)


def draw(see: ExpertView, name: str, goal: Float[Array, "W 3"], behind: float = 0.0, hand: int = 0) -> HandMotion:
    """Draws an object's middle horizontally towards a goal.

    Args:
      goal: of which only x and y count. behind: m behind its middle, seen from the goal, that fingers press on: what is
        to fall over an edge must be pressed where it still lies.
    """
    low, high = see.box(name)
    middle = 0.5 * (low + high)
    way = (goal - middle) * FLAT
    ahead = way / jnp.maximum(length(way), 1e-6)[:, None]
    place = jnp.asarray(middle - behind * ahead).at[:, 2].set(high[:, 2])
    off = see.grip(hand) - place
    on_it = see.touches(name) & (length(off[:, :2]) < ON_IT) & (off[:, 2] < ABOVE)
    down = SINK * jnp.clip(1.0 - see.pressed(name) / PRESS, -1.0, 1.0)
    step = jnp.minimum(SPEED, length(way))[:, None] * ahead
    turn = far_out(see, place, hand) if see.controls[hand].on_arm else None
    along = hand_motion(step.at[:, 2].set(-down), turn, close=True)
    return where(on_it, along, HandMotion(take_at(see, place, hand).move, along.turn, along.close))
