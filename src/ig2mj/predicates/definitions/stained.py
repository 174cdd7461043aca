"""Stained(o): more than half of the stain particles that were placed remain (table A.1)."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool

from ig2mj.engine.view import Array
from ig2mj.predicates.base import Context, Predicate
from ig2mj.states.definitions import stain
from ig2mj.states.model import StateModel
from ig2mj.states.world import ExtendedStates


def _stained(model: StateModel, states: ExtendedStates) -> Bool[Array, "W O"]:
    having, objects = model.parameters.stain_rows, model.tables.num_objects
    if not len(having):
        return jnp.zeros((states.sliced.shape[0], objects), bool)
    rows = np.zeros(objects, int)
    rows[having] = np.arange(len(having))
    return jnp.asarray(stain.stained(model, states.stain))[:, rows]  # of objects without stain nobody asks


def _why(context: Context, arguments: tuple[int, ...], world: int) -> str:
    row = stain.row_of(context.model, arguments[0])
    alive, placed = (int(f[world, row].sum()) for f in (context.states.stain.alive, context.states.stain.placed))
    limit = context.model.parameters.stained_threshold[arguments[0]]
    return f"{alive} of {placed} stain particles, stained above {limit:.0%}"


STAINED = Predicate.of_states(
    _stained,
    name="stained",
    ability="stainable",
    why=_why,
)
