"""InHandOfAgent(o): assistive grasping is active on o (table A.1).

iGibson's physical grasping mode calls every object grasped while the fingers look closed on something;
here it is always about o.
"""

from __future__ import annotations

import jax.numpy as jnp
from jaxtyping import Bool

from ig2mj.engine.view import Array
from ig2mj.predicates.base import Arguments, Context, Predicate


def _evaluate(context: Context, arguments: Arguments) -> Bool[Array, "W P"]:
    objects = arguments[:, 0]
    return jnp.any(jnp.asarray(context.view.held), axis=1)[:, objects] & context.known(objects)


IN_HAND_OF_AGENT = Predicate(
    name="in_hand_of_agent",
    arguments=("object",),
    evaluate=_evaluate,
    of_arguments=True,
    aliases=("in_hand_of_robot", "inhandofagent", "inhandofrobot"),
)
