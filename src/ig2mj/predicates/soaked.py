"""Soaked(o): w >= w_soaked (table A.1)."""

from __future__ import annotations

from jaxtyping import Bool

from ig2mj.engine.view import Array
from ig2mj.predicates.base import Arguments, Context, Predicate, of_objects
from ig2mj.states import wetness


def _evaluate(context: Context, arguments: Arguments) -> Bool[Array, "W P"]:
    return of_objects(wetness.soaked(context.model, context.states.wetness), arguments)


def _why(context: Context, arguments: tuple[int, ...], world: int) -> str:
    level = float(context.states.wetness[world, arguments[0]])
    return f"wetness {level:g} droplets, soaked at {context.model.parameters.wetness_soaked[arguments[0]]:g}"


SOAKED = Predicate(
    name="soaked",
    arguments=("object",),
    reads=("states.wetness",),
    evaluate=_evaluate,
    ability="soakable",
    why=_why,
)
