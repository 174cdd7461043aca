"""Saturated(o, s): o has absorbed as many drops of s as soak it. Of water it is Soaked."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool

from ig2mj.engine.view import Array
from ig2mj.knowledge.substances import WATER
from ig2mj.predicates.base import Context
from ig2mj.predicates.substances import FIRST, in_use, of_pairs, substance_names
from ig2mj.states.definitions import wetness
from ig2mj.states.model import StateModel
from ig2mj.states.substances import coat
from ig2mj.states.world import ExtendedStates


def _saturated(model: StateModel, states: ExtendedStates) -> Bool[Array, "W O A"]:
    used = None if model.substances is None else coat.saturated(model, states)
    others = in_use(model, used, states.sliced.shape[0])
    soaked = wetness.soaked(model, states.wetness)[..., None]
    return jnp.where(np.arange(others.shape[-1]) == FIRST.index(WATER), soaked, others)


def _why(context: Context, arguments: tuple[int, ...], world: int) -> str:
    obj, index = arguments
    name, model = substance_names(context.model)[index], context.model
    if name == WATER:
        level, limit = float(context.states.wetness[world, obj]), model.parameters.wetness_soaked[obj]
        return f"wetness {level:g} drops, soaked at {limit:g}"
    found = model.substances
    if found is None or name not in found.names or found.row[obj] == len(found.covered):
        return f"it absorbs no {name}"
    drops = float(np.asarray(context.states.absorbed)[world, found.row[obj], found.names.index(name)])
    return f"{drops:g} drops of {name} absorbed"


SATURATED = of_pairs("saturated", _saturated, why=_why)
