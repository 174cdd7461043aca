"""Covered(o, s): at least one point of o is covered by s. Of dust and stains it is Dusty and Stained."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool

from ig2mj.engine.view import Array
from ig2mj.predicates.base import Context
from ig2mj.predicates.definitions.dusty import DUSTY
from ig2mj.predicates.definitions.stained import STAINED
from ig2mj.predicates.substances import FIRST, in_use, of_pairs, substance_names
from ig2mj.states.model import StateModel
from ig2mj.states.substances import coat
from ig2mj.states.world import ExtendedStates


def _covered(model: StateModel, states: ExtendedStates) -> Bool[Array, "W O A"]:
    used = None if model.substances is None else coat.covered(model, states)
    others = in_use(model, used, states.sliced.shape[0])
    dirt = []
    for predicate in (DUSTY, STAINED):
        assert predicate.per_object is not None and predicate.ability is not None
        dirt.append(jnp.asarray(predicate.per_object(model, states)) & model.parameters.has(predicate.ability))
    return jnp.concatenate([jnp.stack(dirt, axis=-1), others[..., len(dirt) :]], axis=-1)


def _why(context: Context, arguments: tuple[int, ...], world: int) -> str:
    obj, index = arguments
    name = substance_names(context.model)[index]
    if name in FIRST[:2]:
        predicate = (DUSTY, STAINED)[index]
        able = predicate.ability in context.model.parameters.abilities[obj]
        return predicate.why(context, (obj,), world) if able and predicate.why else f"it is not {predicate.ability}"
    found = context.model.substances
    if found is None or name not in found.names:
        return f"{name} is not in use"
    row = found.row[obj]
    if row == len(found.covered):
        return "it has no surface that can be covered"
    bits = np.asarray(context.states.coat)[world, row, found.names.index(name)]
    return f"{int(bits).bit_count()} of {coat.NUM_POINTS} points, covered from 1 on"


COVERED_TABLE = _covered

COVERED = of_pairs("covered", _covered, why=_why)
