"""Present(s): there is some of s in a container or on an object."""

from __future__ import annotations

import jax.numpy as jnp
from jaxtyping import Bool

from ig2mj.engine.view import Array
from ig2mj.predicates.base import Arguments, Context, Predicate
from ig2mj.predicates.definitions.contains import CONTAINS_TABLE
from ig2mj.predicates.definitions.covered import COVERED_TABLE


def _evaluate(context: Context, arguments: Arguments) -> Bool[Array, "W P"]:
    model, states = context.model, context.states
    some = jnp.any(CONTAINS_TABLE(model, states) | COVERED_TABLE(model, states), axis=1)
    return some[:, arguments[:, 0]]


PRESENT = Predicate(name="present", arguments=("substance",), evaluate=_evaluate, of_arguments=True)
