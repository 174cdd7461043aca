"""Sliced(o): it was cut (table A.1). A whole that was replaced by halves is sliced if both halves are."""

from __future__ import annotations

from jaxtyping import Bool

from ig2mj.engine.view import Array
from ig2mj.predicates.base import Predicate
from ig2mj.states.model import StateModel
from ig2mj.states.world import ExtendedStates


def _sliced(model: StateModel, states: ExtendedStates) -> Bool[Array, "W O"]:
    return states.sliced


SLICED = Predicate.of_states(
    _sliced,
    name="sliced",
    ability="sliceable",
)
