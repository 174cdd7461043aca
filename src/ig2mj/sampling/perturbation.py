"""Random disturbance of a scene: loose objects are lifted, shifted, turned and let go. Pure JAX, all worlds at once.

For pools of settled initial states, and for measuring how much of the scene wakes at once. It keeps rooms as they are
furnished; `ig2mj.sampling.many` places objects by predicates.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float, Int, UInt

from ig2mj.engine.base import Write
from ig2mj.engine.view import Array, PhysicsView
from ig2mj.geometry.poses import axis_angle_to_quat, quat_multiply
from ig2mj.scene.tables import SceneTables

SHIFT = 0.05
"""Metres: objects move by up to this much along x and along y."""

LIFT = (0.02, 0.10)
"""Metres: objects are let go from between these heights over where they lay."""


def loose_objects(tables: SceneTables) -> Int[np.ndarray, "M"]:
    """Objects that can be moved: free, in use at the start, and no half of another object."""
    return np.flatnonzero(~tables.object_fixed & ~tables.object_parked & (tables.object_part_of < 0))


def perturb(
    tables: SceneTables,
    objects: Int[np.ndarray, "M"],
    view: PhysicsView,
    key: UInt[Array, "W 2"],
    share: float = 0.5,
) -> Write:
    """A write that lifts each of the objects with probability `share`, shifts it, and turns it about the vertical.

    Args:
      tables, view: the scene and where everything is.
      objects: those that may move.
      key: a random key per world.
      share: probability of moving, per object and world.
    """

    def one(k: UInt[Array, "2"]) -> tuple[Bool[Array, "O"], Float[Array, "O 3"], Float[Array, "O"]]:
        which, shift, lift, turn = jax.random.split(k, 4)
        count = tables.num_objects
        offset = jnp.concatenate(
            [
                jax.random.uniform(shift, (count, 2), minval=-SHIFT, maxval=SHIFT),
                jax.random.uniform(lift, (count, 1), minval=LIFT[0], maxval=LIFT[1]),
            ],
            axis=1,
        )
        moves = jax.random.bernoulli(which, share, (count,))
        return moves, offset, jax.random.uniform(turn, (count,), minval=-jnp.pi, maxval=jnp.pi)

    moves, offset, angle = jax.vmap(one)(key)
    allowed = np.isin(np.arange(tables.num_objects), objects)
    turned = axis_angle_to_quat(jnp.array([0.0, 0.0, 1.0]), angle)
    return Write(
        object_mask=moves & allowed,
        object_pos=view.object_pos + offset,
        object_quat=quat_multiply(turned, jnp.asarray(view.object_quat)),
    )
