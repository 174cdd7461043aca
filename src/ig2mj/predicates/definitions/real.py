"""Real(o): o exists. What rules have consumed, or have not made yet, does not (`ig2mj.states.substances.things`)."""

from __future__ import annotations

import jax.numpy as jnp
from jaxtyping import Bool

from ig2mj.engine.view import Array
from ig2mj.predicates.base import Context, Predicate
from ig2mj.states.model import StateModel
from ig2mj.states.substances import things
from ig2mj.states.world import ExtendedStates


def _real(model: StateModel, states: ExtendedStates) -> Bool[Array, "W O"]:
    if model.substances is None:
        return jnp.ones(states.sliced.shape, bool)
    return ~things.absent(model, states)


def _why(context: Context, arguments: tuple[int, ...], world: int) -> str:
    return "it is used up, or not made yet"


REAL = Predicate.of_states(_real, name="real", why=_why)
