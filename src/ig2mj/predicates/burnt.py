"""Burnt(o): T_max >= T_burn (table A.1)."""

from __future__ import annotations

from jaxtyping import Bool

from ig2mj.engine.view import Array
from ig2mj.predicates.base import Arguments, Context, Predicate, of_objects


def _evaluate(context: Context, arguments: Arguments) -> Bool[Array, "W P"]:
    value = context.states.max_temperature >= context.model.parameters.burn_temperature
    return of_objects(value, arguments)


def _why(context: Context, arguments: tuple[int, ...], world: int) -> str:
    limit = context.model.parameters.burn_temperature[arguments[0]]
    reached = float(context.states.max_temperature[world, arguments[0]])
    return f"highest temperature {reached:.1f} C, burns at {limit:.1f} C"


BURNT = Predicate(
    name="burnt",
    arguments=("object",),
    reads=("states.max_temperature",),
    evaluate=_evaluate,
    ability="burnable",
    why=_why,
)
