"""Dusty(o): more than half of the dust particles that were placed remain (table A.1)."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool

from ig2mj.engine.view import Array
from ig2mj.predicates.base import Context, Predicate
from ig2mj.states.definitions import dust
from ig2mj.states.model import StateModel
from ig2mj.states.world import ExtendedStates


def _dusty(model: StateModel, states: ExtendedStates) -> Bool[Array, "W O"]:
    having, objects = model.parameters.dust_rows, model.tables.num_objects
    if not len(having):
        return jnp.zeros((states.sliced.shape[0], objects), bool)
    rows = np.zeros(objects, int)
    rows[having] = np.arange(len(having))
    return jnp.asarray(dust.dusty(model, states.dust))[:, rows]  # of objects without dust nobody asks


def _why(context: Context, arguments: tuple[int, ...], world: int) -> str:
    row = dust.row_of(context.model, arguments[0])
    alive, placed = (int(f[world, row].sum()) for f in (context.states.dust.alive, context.states.dust.placed))
    limit = context.model.parameters.dusty_threshold[arguments[0]]
    return f"{alive} of {placed} dust particles, dusty above {limit:.0%}"


DUSTY = Predicate.of_states(
    _dusty,
    name="dusty",
    ability="dustyable",
    why=_why,
)
