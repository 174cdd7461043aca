"""InContactObjs (paper table A.4): what touches what. It is the engine's; here are the ways to ask for pairs."""

from __future__ import annotations

import jax.numpy as jnp
from jaxtyping import Bool, Int

from ig2mj.engine.view import Array, PhysicsView
from ig2mj.geometry.poses import AnyArray


def touching(view: PhysicsView, pairs: Int[AnyArray, "P 2"]) -> Bool[Array, "W P"]:
    """Whether the surfaces of two objects touch; false where a centre of mass is not finite."""
    num_objects = view.touching.shape[-1]
    flat = jnp.asarray(view.touching).reshape(view.touching.shape[0], -1)
    place = finite(view)
    return flat[:, pairs[:, 0] * num_objects + pairs[:, 1]] & place[:, pairs[:, 0]] & place[:, pairs[:, 1]]


def finite(view: PhysicsView) -> Bool[Array, "W O"]:
    """Whether an object's place is known at all: predicates are false where it is not."""
    return jnp.all(jnp.isfinite(jnp.asarray(view.object_com)), axis=-1)
