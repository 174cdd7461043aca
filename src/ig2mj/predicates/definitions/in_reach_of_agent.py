"""InReachOfAgent(o): o's centre of mass is less than 2 m from the agent's base (table A.1)."""

from __future__ import annotations

import jax.numpy as jnp
from jaxtyping import Bool

from ig2mj.engine.view import Array
from ig2mj.predicates.base import Arguments, Context, Predicate

MAX_DISTANCE = 2.0
"""Metres (table A.1, d_reach)."""


def _evaluate(context: Context, arguments: Arguments) -> Bool[Array, "W P"]:
    com = jnp.asarray(context.view.object_com)[:, None, arguments[:, 0]]
    offset = com - jnp.asarray(context.view.agent.base_pos)[:, :, None]
    return jnp.any(jnp.sum(offset * offset, axis=-1) < MAX_DISTANCE**2, axis=1)


def _why(context: Context, arguments: tuple[int, ...], world: int) -> str:
    if context.view.agent.base_pos.shape[1] == 0:
        return "there is no agent"
    offset = context.view.agent.base_pos[world] - context.view.object_com[world, arguments[0]]
    return f"{float(jnp.min(jnp.linalg.norm(offset, axis=-1))):.2f} m away, reach is {MAX_DISTANCE} m"


IN_REACH_OF_AGENT = Predicate(
    name="in_reach_of_agent",
    arguments=("object",),
    evaluate=_evaluate,
    of_arguments=True,
    aliases=("in_reach_of_robot", "inreachofagent", "inreachofrobot"),
    why=_why,
)
