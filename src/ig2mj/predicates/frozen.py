"""Frozen(o): T <= T_frozen (table A.1)."""

from __future__ import annotations

from jaxtyping import Bool

from ig2mj.engine.view import Array
from ig2mj.predicates.base import Arguments, Context, Predicate, of_objects


def _evaluate(context: Context, arguments: Arguments) -> Bool[Array, "W P"]:
    value = context.states.temperature <= context.model.parameters.freeze_temperature
    return of_objects(value, arguments)


def _why(context: Context, arguments: tuple[int, ...], world: int) -> str:
    limit = context.model.parameters.freeze_temperature[arguments[0]]
    return f"temperature {float(context.states.temperature[world, arguments[0]]):.1f} C, freezes at {limit:.1f} C"


FROZEN = Predicate(
    name="frozen",
    arguments=("object",),
    reads=("states.temperature",),
    evaluate=_evaluate,
    ability="freezable",
    why=_why,
)
