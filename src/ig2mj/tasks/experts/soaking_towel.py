"""Soaking Towel: take the towel, bring it in front of the tap, and slide it below the spout."""

from __future__ import annotations

import jax.numpy as jnp

from ig2mj.tasks.experts.motion import Wish, around, over, where, wish
from ig2mj.tasks.experts.reaching import take
from ig2mj.tasks.experts.sight import Sight
from ig2mj.tasks.points import Water

TOWEL, SINK = "bath_towel_0", "sink_0"

TOP = 0.025
"""m of the towel's top below the tap's opening. (Where drops appear is 0.1 m below it.)"""

AHEAD = 0.11
"""m of the towel's middle in front of the opening, so that the hand is not below the spout."""

RUN_UP = 0.25
"""m in front of that where the towel is brought to the right height."""

EXACT = 0.03
"""m beside or above the way in at which the towel is slid in."""

CARRY = 0.05
"""m above the height of the way in, on the way there."""

OUTSIDE = 0.48
"""m from the middle of the robot's body that the towel passes it."""


def plan(see: Sight) -> list[Wish]:
    """One hand. The tap's front is where the robot stands: +y in its home."""
    opening = see.goal(Water(SINK), 0.1)
    towel, (_, high) = see.com(TOWEL), see.box(TOWEL)
    height = opening[:, 2] - TOP - (high[:, 2] - towel[:, 2])
    inside = jnp.stack([opening[:, 0], opening[:, 1] + AHEAD, height], axis=1)
    beside = jnp.abs(towel[:, 0] - inside[:, 0]) + jnp.abs(towel[:, 2] - height)
    goal = inside.at[:, 1].add(RUN_UP * jnp.clip((beside - EXACT) / EXACT, 0.0, 1.0))
    move = around(towel, over(towel, goal, height + CARRY), see.base_pos(), OUTSIDE)
    slide = wish(move, close=True)
    return [where(see.holds(TOWEL), slide, take(see, TOWEL))]
