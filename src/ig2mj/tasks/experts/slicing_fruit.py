"""Slicing Fruit: take the knife by its handle, turn its edge down, and press it onto the apple."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from ig2mj.engine.view import Array
from ig2mj.geometry.poses import length, quat_rotate
from ig2mj.scene.tables import LinkKind
from ig2mj.tasks.experts.motion import Wish, horizontal, over, where, wish
from ig2mj.tasks.experts.reaching import far_out, take_thin
from ig2mj.tasks.experts.sight import Sight

KNIFE, FRUIT = "carving_knife_0", "apple_0"

HANDLE, ALONG, EDGE = (-0.105, 0.007, 0.011), (1.0, 0.0, 0.0), (0.0, -1.0, 0.0)
"""Where the hand takes the handle, m: so far back that fingers stay clear of the fruit. Where the blade points, and the
direction in which it cuts. The knife's frame."""

TIPWARD = -0.01
"""m from the middle of the edge to the point that cuts."""

STEEP = 1.25
"""rad between the edge's direction and straight down that are steep enough. Steeper, fingers would meet the table."""

CLEARANCE = 0.07
"""m above the fruit at which the blade comes over it."""

EXACT = 0.008
"""m beside the fruit's middle at which the blade comes down: farther out the fruit rolls away."""

PRESS = 0.03
"""m below the fruit's top that the blade goes for."""


def plan(see: Sight) -> list[Wish]:
    """One hand."""
    quat = see.quat(KNIFE)
    handle = see.pos(KNIFE) + quat_rotate(quat, jnp.asarray(HANDLE, jnp.float32))
    along = quat_rotate(quat, jnp.asarray(ALONG, jnp.float32))
    blade = see.link(KNIFE, LinkKind.SLICER) + TIPWARD * along
    _, high = see.box(FRUIT)
    fruit, top = see.com(FRUIT), high[:, 2]
    turn, left = _edge_down(quat_rotate(quat, jnp.asarray(EDGE, jnp.float32)))
    turn += horizontal(along)
    depth = jnp.where(left < 0.2, top - PRESS, top + CLEARANCE)
    goal = jnp.concatenate([fruit[:, :2], depth[:, None]], axis=1)
    take = take_thin(see, handle)
    if see.robot == "fetch":
        turn += far_out(see, goal)
        take = Wish(take.move, far_out(see, handle), take.close)
    cut = wish(over(blade, goal, top + CLEARANCE, near=EXACT, blend=EXACT), turn, close=True)
    done = jnp.asarray(see.states.sliced)[:, see.scene.object_index(FRUIT)]
    still = wish(jnp.zeros_like(handle), close=True)
    return [where(done, still, where(see.holds(KNIFE), cut, take))]


def _edge_down(edge: Float[Array, "W 3"]) -> tuple[Float[Array, "W 3"], Float[Array, "W"]]:
    """The turn that is left until the edge is steep, and its angle."""
    axis = jnp.cross(edge, np.array([0.0, 0.0, -1.0], np.float32))
    angle = jnp.arccos(jnp.clip(-edge[:, 2], -1.0, 1.0))
    left = jnp.maximum(angle - STEEP, 0.0)
    return axis / jnp.maximum(length(axis), 1e-6)[:, None] * left[:, None], left
