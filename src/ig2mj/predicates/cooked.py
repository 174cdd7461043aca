"""Cooked(o): T_cook <= T_max < T_burn (table A.1); in iGibson's code T_cook <= T_max, so that Burnt implies Cooked."""

from __future__ import annotations

from jaxtyping import Bool

from ig2mj.engine.view import Array
from ig2mj.predicates.base import Arguments, Context, Predicate, of_objects


def _evaluate(context: Context, arguments: Arguments) -> Bool[Array, "W P"]:
    p, reached = context.model.parameters, context.states.max_temperature
    value = reached >= p.cook_temperature
    if context.model.paper:
        value &= reached < p.burn_temperature
    return of_objects(value, arguments)


def _why(context: Context, arguments: tuple[int, ...], world: int) -> str:
    p, o = context.model.parameters, arguments[0]
    text = f"highest temperature {float(context.states.max_temperature[world, o]):.1f} C, cooks at "
    text += f"{p.cook_temperature[o]:.1f} C"
    return text + (f", burns at {p.burn_temperature[o]:.1f} C" if context.model.paper else "")


COOKED = Predicate(
    name="cooked",
    arguments=("object",),
    reads=("states.max_temperature",),
    evaluate=_evaluate,
    ability="cookable",
    why=_why,
)
