"""Soaking Towel: take the towel, bring it in front of the tap, and slide it below the spout."""

from __future__ import annotations

import jax.numpy as jnp
from jaxtyping import Float

from ig2mj.engine.view import Array
from ig2mj.geometry.poses import length
from ig2mj.tasks.experts.motion import RISE, Wish, around, levelled, outward, where, wish
from ig2mj.tasks.experts.reaching import take, take_at
from ig2mj.tasks.experts.sight import Sight
from ig2mj.tasks.points import WATER_BELOW, Water

TOWEL, SINK = "bath_towel_0", "sink_0"

TOP = 0.025
"""m of the towel's top below the tap's opening. (Where drops appear is 0.1 m below it.)"""

AHEAD = 0.11
"""m of the towel's middle in front of the opening, so that the hand is not below the spout."""

RUN_UP = 0.25
"""m in front of that where the towel comes down to the height at which it is slid in."""

EXACT, BLEND = 0.03, 0.06
"""m off the way in up to which the towel counts as on it, and over which it becomes wholly off it."""

CARRY = 0.18
"""m above that height on the way there."""

OUTSIDE = 0.42
"""m from the middle of the robot's body that the towel passes it."""

EDGE = 0.1
"""m from the towel's middle towards the robot at which Fetch takes it."""


def plan(see: Sight) -> list[Wish]:
    """One hand. The tap's front is where the robot stands: +y in its home."""
    opening = see.goal(Water(SINK), WATER_BELOW)
    towel, (_, high) = see.com(TOWEL), see.box(TOWEL)
    height = opening[:, 2] - TOP - (high[:, 2] - towel[:, 2])
    beside, ahead = towel[:, 0] - opening[:, 0], towel[:, 1] - opening[:, 1] - AHEAD
    off = jnp.maximum(_share(jnp.abs(beside)), _share(ahead - RUN_UP))
    rise = height + CARRY * off - towel[:, 2]
    back = RUN_UP * jnp.maximum(off, _share(jnp.abs(towel[:, 2] - height)))
    go = jnp.clip(1.5 - rise / RISE, 0.0, 1.0)
    move = jnp.stack([-beside * go, (back - ahead) * go, rise], axis=1)
    move = around(towel, move, see.base_pos(), OUTSIDE)
    turn, get = levelled(see.quat(TOWEL)), take(see, TOWEL)
    if see.robot == "fetch":
        turn += outward(see.hand_quat(), see.grip() - see.base_pos())
        get = take_at(see, _near_edge(see))
    return [where(see.holds(TOWEL), wish(move, turn, close=True), get)]


def _near_edge(see: Sight) -> Float[Array, "W 3"]:
    """A point of the towel's upper side, nearer to the robot than its middle: what sticks out lengthens the arm."""
    low, high = see.box(TOWEL)
    middle = jnp.asarray(0.5 * (low + high)).at[:, 2].set(high[:, 2])
    away = (middle - see.base_pos()) * jnp.array([1.0, 1.0, 0.0])
    return middle - EDGE * away / length(away)[:, None]


def _share(off: Float[Array, "W"]) -> Float[Array, "W"]:
    """0 on the way in, 1 wholly off it."""
    return jnp.clip((off - EXACT) / BLEND, 0.0, 1.0)
