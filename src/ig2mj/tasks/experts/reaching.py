"""Taking hold of an object from above."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from ig2mj.engine.view import Array
from ig2mj.geometry.poses import length
from ig2mj.tasks.experts.motion import HandMotion, hand_motion, outward, over
from ig2mj.tasks.experts.sight import ExpertView

CLEARANCE = 0.12
"""m above an object's top at which a hand comes over it."""

CLOSING = 0.05
"""m from the point at which a hand that has to be closed does so."""

BELOW = 0.03
"""m below its top that the hand goes for: what lies there stops it."""

THIN, CLOSE_TO = 0.015, 0.035
"""m that take the place of `BELOW` and `CLOSING` where what is to be taken is thin and slips away."""

AGAIN = 0.03
"""m that a hand rises, opens, and begins again, when its fingers have closed on nothing."""

UP = np.array([0.0, 0.0, 1.0], np.float32)

REACH, BLEND = 0.62, 0.1
"""m from the robot's middle beyond which the gripper of an arm turns outwards, and over which it comes to do so."""

ASIDE = 0.8
"""rad that it may then point aside: turned wholly outwards over a low table, the elbow comes down onto its edge."""


def take(see: ExpertView, name: str, hand: int = 0, above: Float[Array, "W"] | float = 0.0) -> HandMotion:
    """From above onto the middle of an object, until it is touched. `above`: m over it where the hand goes instead."""
    low, high = see.box(name)
    middle, top = 0.5 * (low + high), high[:, 2:]
    place = jnp.concatenate([middle[:, :2], jnp.maximum(top, middle[:, 2:] + BELOW)], axis=1)
    return take_at(see, place.at[:, 2].add(above), hand)


def take_at(see: ExpertView, place: Float[Array, "W 3"], hand: int = 0) -> HandMotion:
    """From above onto a point of an object's surface, until it is touched; the hand closes when it is near."""
    down = jnp.array([0.0, 0.0, BELOW], jnp.float32)
    grip = see.grip(hand)
    return hand_motion(over(grip, place - down, place[:, 2] + CLEARANCE), close=length(grip - place) < CLOSING)


def take_thin(see: ExpertView, place: Float[Array, "W 3"], hand: int = 0) -> HandMotion:
    """As `take_at`, of something thin: fingers close late, and open again when they missed it. (What a mitten only has
    to touch it takes as anything else.)"""
    if see.grasping == "mitten":
        return take_at(see, place, hand)
    grip = see.grip(hand)
    move, near = over(grip, place - THIN * UP, place[:, 2] + CLEARANCE), length(grip - place) < CLOSE_TO
    missed = near & (see.closed(hand) > see.controls[hand].closed_empty)
    return hand_motion(jnp.where(missed[:, None], AGAIN * UP, move), close=near & ~missed)


def far_out(see: ExpertView, goal: Float[Array, "W 3"], hand: int = 0) -> Float[Array, "W 3"]:
    """The rotation vector by which a gripper comes to point away from the robot, where its goal is far from it."""
    away = jnp.asarray(goal) - see.base_pos()
    near = 1.0 - jnp.clip((length(away[:, :2]) - REACH) / BLEND, 0.0, 1.0)
    turn = outward(see.hand_quat(hand), see.grip(hand) - see.base_pos())
    allowed = (ASIDE + (jnp.pi - ASIDE) * near)[:, None]
    return turn - jnp.clip(turn, -allowed, allowed)
