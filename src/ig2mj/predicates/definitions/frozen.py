"""Frozen(o): T <= T_frozen (table A.1)."""

from __future__ import annotations

from jaxtyping import Bool

from ig2mj.engine.view import Array
from ig2mj.predicates.base import Context, Predicate
from ig2mj.states.model import StateModel
from ig2mj.states.world import ExtendedStates


def _frozen(model: StateModel, states: ExtendedStates) -> Bool[Array, "W O"]:
    return states.temperature <= model.parameters.freeze_temperature


def _why(context: Context, arguments: tuple[int, ...], world: int) -> str:
    limit = context.model.parameters.freeze_temperature[arguments[0]]
    return f"temperature {float(context.states.temperature[world, arguments[0]]):.1f} C, freezes at {limit:.1f} C"


FROZEN = Predicate.of_states(
    _frozen,
    name="frozen",
    ability="freezable",
    why=_why,
)
