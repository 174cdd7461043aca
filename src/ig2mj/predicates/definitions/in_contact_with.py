"""InContactWith(a, b), iGibson's Touching: the surfaces meet in at least one point (table A.1).

Either argument may be an agent: then any part of it counts. What two agents do to each other is not in the view.
"""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool

from ig2mj.engine.view import Array
from ig2mj.predicates.base import Arguments, Context, Predicate
from ig2mj.states.relations.touching import touching


def _evaluate(context: Context, arguments: Arguments) -> Bool[Array, "W P"]:
    view, tables = context.view, context.model.tables
    objects, agents = tables.num_objects, len(tables.agent_names)
    if not agents or (isinstance(arguments, np.ndarray) and np.all(arguments < objects)):
        return touching(view, arguments)
    is_agent = arguments >= objects
    of_objects = touching(view, jnp.minimum(arguments, objects - 1)) & ~jnp.any(is_agent, axis=-1)
    agent = jnp.max(arguments, axis=-1) - objects
    other = jnp.minimum(jnp.min(arguments, axis=-1), objects - 1)
    flat = jnp.asarray(view.agent.touching).reshape(context.num_worlds, -1)
    of_agent = flat[:, jnp.maximum(agent, 0) * objects + other] & context.known(other)
    return of_objects | (of_agent & (jnp.sum(is_agent, axis=-1) == 1))


IN_CONTACT_WITH = Predicate(
    name="in_contact_with",
    arguments=("object or agent", "object or agent"),
    evaluate=_evaluate,
    of_arguments=True,
    aliases=("touching",),
)
