"""InSource(o, s): o is a source of s: a tap of water, or a container that does not become empty."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool

from ig2mj.engine.view import Array
from ig2mj.knowledge.substances import WATER
from ig2mj.predicates.substances import FIRST, of_containers, of_pairs
from ig2mj.states.model import StateModel
from ig2mj.states.world import ExtendedStates


def _insource(model: StateModel, states: ExtendedStates) -> Bool[Array, "W O A"]:
    found = of_containers(model, None if model.substances is None else states.stock, states.sliced.shape[0])
    taps = np.isin(np.arange(model.tables.num_objects), model.parameters.water_object)
    return found | (taps[:, None] & (np.arange(found.shape[-1]) == FIRST.index(WATER)))


INSOURCE = of_pairs("insource", _insource, aliases=("in_source",))
