"""`dirty`: the predicate of a kind of dirt: more than a share of the particles that were placed remain (table A.1)."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool

from ig2mj.engine.view import Array
from ig2mj.predicates.base import Context, Predicate
from ig2mj.states.definitions.dirt import Dirt
from ig2mj.states.model import StateModel
from ig2mj.states.world import ExtendedStates


def dirty(name: str, dirt: Dirt) -> Predicate:
    """Whether an object carries so much of a kind of dirt; False without its ability."""

    def of_states(model: StateModel, states: ExtendedStates) -> Bool[Array, "W O"]:
        having, objects = dirt.rows(model), model.tables.num_objects
        if not len(having):
            return jnp.zeros((states.sliced.shape[0], objects), bool)
        rows = np.zeros(objects, int)
        rows[having] = np.arange(len(having))
        levels = dirt.is_dirty(model, getattr(states, dirt.name))
        return jnp.asarray(levels)[:, rows]  # never read for objects without rows

    def why(context: Context, arguments: tuple[int, ...], world: int) -> str:
        row, rows = dirt.row_of(context.model, arguments[0]), getattr(context.states, dirt.name)
        alive, placed = (int(field[world, row].sum()) for field in (rows.alive, rows.placed))
        limit = dirt.threshold(context.model)[arguments[0]]
        return f"{alive} of {placed} {dirt.name} particles, {name} above {limit:.0%}"

    return Predicate.of_states(of_states, name=name, ability=dirt.ability, why=why)
