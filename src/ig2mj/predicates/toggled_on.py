"""ToggledOn(o): the switch (table A.1)."""

from __future__ import annotations

from jaxtyping import Bool

from ig2mj.engine.view import Array
from ig2mj.predicates.base import Arguments, Context, Predicate, of_objects


def _evaluate(context: Context, arguments: Arguments) -> Bool[Array, "W P"]:
    return of_objects(context.states.toggled, arguments)


TOGGLED_ON = Predicate(
    name="toggled_on",
    arguments=("object",),
    reads=("states.toggled",),
    evaluate=_evaluate,
    ability="toggleable",
    aliases=("toggledon",),
)
