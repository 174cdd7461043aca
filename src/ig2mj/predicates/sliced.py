"""Sliced(o): it was cut (table A.1). Of a whole that has given way to its halves, both must say so."""

from __future__ import annotations

from jaxtyping import Bool

from ig2mj.engine.view import Array
from ig2mj.predicates.base import Arguments, Context, Predicate, of_objects


def _evaluate(context: Context, arguments: Arguments) -> Bool[Array, "W P"]:
    return of_objects(context.states.sliced, arguments)


SLICED = Predicate(
    name="sliced",
    arguments=("object",),
    reads=("states.sliced",),
    evaluate=_evaluate,
    ability="sliceable",
)
