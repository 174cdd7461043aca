"""ToggledOn(o): the switch (table A.1)."""

from __future__ import annotations

from jaxtyping import Bool

from ig2mj.engine.view import Array
from ig2mj.predicates.base import Predicate
from ig2mj.states.model import StateModel
from ig2mj.states.world import ExtendedStates


def _toggled_on(model: StateModel, states: ExtendedStates) -> Bool[Array, "W O"]:
    return states.toggled_on


TOGGLED_ON = Predicate.of_states(
    _toggled_on,
    name="toggled_on",
    ability="toggleable",
    aliases=("toggledon",),
)
