"""Soaked(o): w >= w_soaked (table A.1)."""

from __future__ import annotations

from jaxtyping import Bool

from ig2mj.engine.view import Array
from ig2mj.predicates.base import Context, Predicate
from ig2mj.states.definitions import wetness
from ig2mj.states.model import StateModel
from ig2mj.states.world import ExtendedStates


def _soaked(model: StateModel, states: ExtendedStates) -> Bool[Array, "W O"]:
    return wetness.soaked(model, states.wetness)


def _why(context: Context, arguments: tuple[int, ...], world: int) -> str:
    level = float(context.states.wetness[world, arguments[0]])
    return f"wetness {level:g} droplets, soaked at {context.model.parameters.wetness_soaked[arguments[0]]:g}"


SOAKED = Predicate.of_states(
    _soaked,
    name="soaked",
    ability="soakable",
    why=_why,
)
