"""Stained(o): more than half of the stain particles that were placed remain (table A.1)."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool

from ig2mj.engine.view import Array
from ig2mj.predicates.base import Arguments, Context, Predicate
from ig2mj.states.definitions import stain


def _evaluate(context: Context, arguments: Arguments) -> Bool[Array, "W P"]:
    having = context.model.parameters.stain_rows
    if not len(having):
        return context.none(arguments)
    rows = np.zeros(context.model.tables.num_objects, int)
    rows[having] = np.arange(len(having))
    return jnp.asarray(stain.stained(context.model, context.states.stain))[:, jnp.asarray(rows)[arguments[:, 0]]]


def _why(context: Context, arguments: tuple[int, ...], world: int) -> str:
    row = stain.row_of(context.model, arguments[0])
    alive, placed = (int(f[world, row].sum()) for f in (context.states.stain.alive, context.states.stain.placed))
    limit = context.model.parameters.stained_threshold[arguments[0]]
    return f"{alive} of {placed} stain particles, stained above {limit:.0%}"


STAINED = Predicate(
    name="stained",
    arguments=("object",),
    evaluate=_evaluate,
    of_arguments=True,
    ability="stainable",
    why=_why,
)
