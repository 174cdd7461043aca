"""Empty(o): there is nothing in the container o; False of an object that holds nothing."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool

from ig2mj.engine.view import Array
from ig2mj.predicates.base import Predicate
from ig2mj.states.model import StateModel
from ig2mj.states.substances.volume import CONTAINS
from ig2mj.states.world import ExtendedStates


def _empty(model: StateModel, states: ExtendedStates) -> Bool[Array, "W O"]:
    worlds, objects = states.sliced.shape
    if model.substances is None:
        return jnp.zeros((worlds, objects), bool)
    row = np.full(objects, states.volume.shape[1])
    row[model.substances.containers.object] = np.arange(states.volume.shape[1])
    some = (jnp.sum(states.volume, axis=-1) >= CONTAINS) | jnp.any(states.stock, axis=-1)
    return jnp.concatenate([~some, jnp.zeros((worlds, 1), bool)], axis=1)[:, row]


EMPTY = Predicate.of_states(_empty, name="empty")
