"""Contains(o, s): there is some of s in the container o."""

from __future__ import annotations

from jaxtyping import Bool

from ig2mj.engine.view import Array
from ig2mj.predicates.definitions.filled import why_volume
from ig2mj.predicates.substances import no_container, of_containers, of_pairs
from ig2mj.states.model import StateModel
from ig2mj.states.substances import volume
from ig2mj.states.world import ExtendedStates


def _contains(model: StateModel, states: ExtendedStates) -> Bool[Array, "W O A"]:
    table = None if model.substances is None else volume.contains(model, states.volume)
    return of_containers(model, table, states.sliced.shape[0])


CONTAINS_TABLE = _contains

CONTAINS = of_pairs("contains", _contains, why=why_volume, never=no_container)
