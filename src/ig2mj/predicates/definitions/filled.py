"""Filled(o, s): s takes more than a fifth of what the container o holds (OmniGibson's filled.py)."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool

from ig2mj.engine.view import Array
from ig2mj.predicates.base import Context
from ig2mj.predicates.substances import no_container, of_containers, of_pairs, substance_names
from ig2mj.states.model import StateModel
from ig2mj.states.substances import volume
from ig2mj.states.world import ExtendedStates


def _filled(model: StateModel, states: ExtendedStates) -> Bool[Array, "W O A"]:
    table = None if model.substances is None else volume.filled(model, states.volume)
    return of_containers(model, table, states.sliced.shape[0])


def why_volume(context: Context, arguments: tuple[int, ...], world: int) -> str:
    """Litres of a substance in an object."""
    obj, index = arguments
    found, name = context.model.substances, substance_names(context.model)[index]
    row = None if found is None else found.containers.row_of(obj)
    if found is None or row is None:
        return "it is no container, or no substances are in use"
    if name not in found.names:
        return f"{name} is not in use"
    litres = float(np.asarray(context.states.volume)[world, row, found.names.index(name)])
    return f"{litres:.4g} l of {name}, it holds {float(found.containers.litres[row]):.4g} l"


FILLED = of_pairs("filled", _filled, why=why_volume, never=no_container)
