"""Hot(o): T >= 40 C (OmniGibson's heated.py); of an object that has a temperature."""

from __future__ import annotations

from jaxtyping import Bool

from ig2mj.engine.view import Array
from ig2mj.predicates.base import Context, Predicate, celsius
from ig2mj.states.definitions.temperature import HOT
from ig2mj.states.model import StateModel
from ig2mj.states.world import ExtendedStates


def _hot(model: StateModel, states: ExtendedStates) -> Bool[Array, "W O"]:
    return (states.temperature >= HOT) & model.parameters.thermal


def _why(context: Context, arguments: tuple[int, ...], world: int) -> str:
    if not context.model.parameters.thermal[arguments[0]]:
        return "it has no temperature"
    return f"temperature {celsius(float(context.states.temperature[world, arguments[0]]))}, hot from {HOT:g} C"


HOT_PREDICATE = Predicate.of_states(_hot, name="hot", why=_why, aliases=("heated",))
