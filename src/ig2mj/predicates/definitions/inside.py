"""Inside(a, b): two orthogonal axes through a's centre of mass meet b's collision mesh on both sides (table A.1)."""

from __future__ import annotations

from jaxtyping import Bool

from ig2mj.engine.view import Array
from ig2mj.predicates.base import Arguments, Context, Predicate
from ig2mj.states.model import StateModel
from ig2mj.states.relations.plan import Query


def _queries(model: StateModel, arguments: Arguments) -> list[Query]:
    return [("inside", int(a), int(b)) for a, b in arguments]


def _evaluate(context: Context, arguments: Arguments) -> Bool[Array, "W P"]:
    return context.relations.inside(arguments)


INSIDE = Predicate(
    name="inside",
    arguments=("object", "object"),
    evaluate=_evaluate,
    of_arguments=True,
    aliases=("inside_of", "insideof"),
    queries=_queries,
)
