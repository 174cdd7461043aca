"""Burnt(o): T_max >= T_burn (table A.1)."""

from __future__ import annotations

from jaxtyping import Bool

from ig2mj.engine.view import Array
from ig2mj.predicates.base import Context, Predicate, celsius
from ig2mj.states.model import StateModel
from ig2mj.states.world import ExtendedStates


def _burnt(model: StateModel, states: ExtendedStates) -> Bool[Array, "W O"]:
    return states.max_temperature >= model.parameters.burn_temperature


def _why(context: Context, arguments: tuple[int, ...], world: int) -> str:
    limit = context.model.parameters.burn_temperature[arguments[0]]
    reached = float(context.states.max_temperature[world, arguments[0]])
    return f"highest temperature {celsius(reached)}, burns at {limit:.1f} C"


BURNT = Predicate.of_states(
    _burnt,
    name="burnt",
    ability="burnable",
    why=_why,
)
