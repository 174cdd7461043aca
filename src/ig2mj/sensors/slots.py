"""`Slots`: shapes that cameras draw besides the scene's geoms, in each world its own. Some are free.

Axes: W worlds, S slots.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp
from flax import struct
from jaxtyping import Bool, Float, Int

from ig2mj.engine.view import Array
from ig2mj.sensors.render_model import NOWHERE

DUST, STAIN, WATER, SUBSTANCE, FIRE = range(5)


@struct.dataclass
class Slots:
    """Shapes to draw.

    Attributes:
      pos, rotation: world frame. size: half axes, m. colour: rgb, 0..1.
      owner: the object that is dirty, contains or burns, -1 none. kind: one of `DUST`, `STAIN`, `WATER`, `SUBSTANCE`,
        `FIRE`, or -1 where the slot is free. body: that a particle sticks to; 0, the world, for all else.
    """

    pos: Float[Array, "W S 3"]
    rotation: Float[Array, "W S 3 3"]
    size: Float[Array, "W S 3"]
    colour: Float[Array, "W S 3"]
    owner: Int[Array, "W S"]
    kind: Int[Array, "W S"]
    body: Int[Array, "W S"]

    def where(self, there: Bool[Array, "W S"]) -> Slots:
        """With the other slots free. Pure."""
        return jax.tree.map(
            lambda value, none: jnp.where(there.reshape(*there.shape, *(1,) * (value.ndim - 2)), value, none),
            self,
            free_slots(*there.shape),
        )


def free_slots(worlds: int, count: int) -> Slots:
    """Slots that show nothing."""
    return Slots(
        pos=jnp.full((worlds, count, 3), jnp.array(NOWHERE, jnp.float32)),
        rotation=jnp.full((worlds, count, 3, 3), jnp.eye(3)),
        size=jnp.full((worlds, count, 3), 1e-4, jnp.float32),
        colour=jnp.zeros((worlds, count, 3), jnp.float32),
        owner=jnp.full((worlds, count), -1, jnp.int32),
        kind=jnp.full((worlds, count), -1, jnp.int32),
        body=jnp.zeros((worlds, count), jnp.int32),
    )
