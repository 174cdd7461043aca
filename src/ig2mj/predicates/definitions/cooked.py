"""Cooked(o): T_cook <= T_max < T_burn (table A.1); in iGibson's code T_cook <= T_max, so that Burnt implies Cooked."""

from __future__ import annotations

from jaxtyping import Bool

from ig2mj.engine.view import Array
from ig2mj.predicates.base import Context, Predicate, celsius
from ig2mj.states.model import StateModel
from ig2mj.states.world import ExtendedStates


def _cooked(model: StateModel, states: ExtendedStates) -> Bool[Array, "W O"]:
    p, reached = model.parameters, states.max_temperature
    value = reached >= p.cook_temperature
    return value & (reached < p.burn_temperature) if model.paper else value


def _why(context: Context, arguments: tuple[int, ...], world: int) -> str:
    p, o = context.model.parameters, arguments[0]
    reached = celsius(float(context.states.max_temperature[world, o]))
    text = f"highest temperature {reached}, cooks at {p.cook_temperature[o]:.1f} C"
    return text + (f", burns at {p.burn_temperature[o]:.1f} C" if context.model.paper else "")


COOKED = Predicate.of_states(
    _cooked,
    name="cooked",
    ability="cookable",
    why=_why,
)
