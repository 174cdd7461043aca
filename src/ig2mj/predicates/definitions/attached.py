"""Attached(a, b): a is held to b by a joint (OmniGibson's attached_to.py)."""

from __future__ import annotations

import jax.numpy as jnp
from jaxtyping import Bool

from ig2mj.engine.view import Array
from ig2mj.predicates.base import Arguments, Context, Predicate
from ig2mj.states.definitions.attached import of


def _evaluate(context: Context, arguments: Arguments) -> Bool[Array, "W P"]:
    if context.model.joints is None:
        return context.none(arguments)
    joints = of(context.model)
    pair = (jnp.asarray(arguments)[:, :1] == joints.child) & (jnp.asarray(arguments)[:, 1:] == joints.parent)  # [P, N]
    return jnp.any(jnp.asarray(context.states.attached)[:, None] & pair, axis=-1)


ATTACHED = Predicate(
    name="attached",
    arguments=("object", "object"),
    evaluate=_evaluate,
    aliases=("assembled", "hung"),
    of_arguments=True,
)
