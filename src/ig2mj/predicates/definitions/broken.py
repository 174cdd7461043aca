"""Broken(o): an impact has broken it (`ig2mj.states.definitions.broken`)."""

from __future__ import annotations

import jax.numpy as jnp
from jaxtyping import Bool

from ig2mj.engine.view import Array
from ig2mj.predicates.base import Predicate
from ig2mj.scene.extras import BROKEN
from ig2mj.states.model import StateModel
from ig2mj.states.world import ExtendedStates


def _broken(model: StateModel, states: ExtendedStates) -> Bool[Array, "W O"]:
    return states.broken if BROKEN in model.extras else jnp.zeros(states.sliced.shape, bool)


BROKEN_PREDICATE = Predicate.of_states(_broken, name="broken")
