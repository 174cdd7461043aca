"""OnTop(a, b): a touches b, b is below a's centre of mass, and b is not above it (table A.1)."""

from __future__ import annotations

from jaxtyping import Bool

from ig2mj.engine.view import Array
from ig2mj.predicates.base import Arguments, Context, Predicate, yes
from ig2mj.states.model import StateModel
from ig2mj.states.relations.plan import Query
from ig2mj.states.relations.touching import touching


def _queries(model: StateModel, arguments: Arguments) -> list[Query]:
    return [("vertical", int(a), int(b)) for a, b in arguments]


def _evaluate(context: Context, arguments: Arguments) -> Bool[Array, "W P"]:
    below, above = context.relations.below(arguments), context.relations.above(arguments)
    return touching(context.view, arguments) & below & ~above


def _why(context: Context, arguments: tuple[int, ...], world: int) -> str:
    a, b = arguments
    below, above = (f([(a, b)])[world, 0] for f in (context.relations.below, context.relations.above))
    touch = context.view.touching[world, a, b]
    return f"touching: {yes(touch)}; it is below: {yes(below)}; it is above: {yes(above)}"


ON_TOP = Predicate(
    name="on_top",
    arguments=("object", "object"),
    evaluate=_evaluate,
    of_arguments=True,
    aliases=("ontop", "on_top_of"),
    queries=_queries,
    why=_why,
)
