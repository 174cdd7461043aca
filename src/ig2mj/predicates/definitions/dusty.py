"""Dusty(o): more than half of the dust particles that were placed remain (table A.1)."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool

from ig2mj.engine.view import Array
from ig2mj.predicates.base import Arguments, Context, Predicate
from ig2mj.states.definitions import dust


def _evaluate(context: Context, arguments: Arguments) -> Bool[Array, "W P"]:
    having = context.model.parameters.dust_rows
    if not len(having):
        return context.none(arguments)
    rows = np.zeros(context.model.tables.num_objects, int)
    rows[having] = np.arange(len(having))
    return jnp.asarray(dust.dusty(context.model, context.states.dust))[:, jnp.asarray(rows)[arguments[:, 0]]]


def _why(context: Context, arguments: tuple[int, ...], world: int) -> str:
    row = dust.row_of(context.model, arguments[0])
    alive, placed = (int(f[world, row].sum()) for f in (context.states.dust.alive, context.states.dust.placed))
    limit = context.model.parameters.dusty_threshold[arguments[0]]
    return f"{alive} of {placed} dust particles, dusty above {limit:.0%}"


DUSTY = Predicate(
    name="dusty",
    arguments=("object",),
    evaluate=_evaluate,
    of_arguments=True,
    ability="dustyable",
    why=_why,
)
