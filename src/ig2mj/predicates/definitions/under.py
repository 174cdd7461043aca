"""Under(a, b): b is above a's centre of mass and not below it (table A.1). Touching and nearness play no part."""

from __future__ import annotations

from jaxtyping import Bool

from ig2mj.engine.view import Array
from ig2mj.predicates.base import Arguments, Context, Predicate, yes
from ig2mj.states.model import StateModel
from ig2mj.states.relations.plan import Query


def _queries(model: StateModel, arguments: Arguments) -> list[Query]:
    return [("vertical", int(a), int(b)) for a, b in arguments]


def _evaluate(context: Context, arguments: Arguments) -> Bool[Array, "W P"]:
    return context.relations.above(arguments) & ~context.relations.below(arguments)


def _why(context: Context, arguments: tuple[int, ...], world: int) -> str:
    below, above = (f([arguments])[world, 0] for f in (context.relations.below, context.relations.above))
    return f"it is above: {yes(above)}; it is below: {yes(below)}"


UNDER = Predicate(
    name="under",
    arguments=("object", "object"),
    evaluate=_evaluate,
    of_arguments=True,
    queries=_queries,
    why=_why,
)
