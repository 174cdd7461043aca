"""NextTo(a, b): side by side (table A.1, iGibson's next_to.py).

Near means: at most a sixth of the sum of their mean edge lengths apart, a third of the average of their six box edges.
The paper measures the closest points of the two objects, and asks for b in a's horizontal plane. iGibson's code
measures the gap of the world boxes, and takes either object's horizontal plane (docs/design/rules.md#next-to).
"""

from __future__ import annotations

from jaxtyping import Bool

from ig2mj.engine.view import Array
from ig2mj.predicates.base import Arguments, Context, Predicate, yes
from ig2mj.states.model import StateModel
from ig2mj.states.relations.plan import Query


def _queries(model: StateModel, arguments: Arguments) -> list[Query]:
    asked: list[Query] = []
    for a, b in arguments.tolist():
        asked.append(("near", a, b))
        asked.append(("horizontal", a, b))
        if not model.paper:
            asked.append(("horizontal", b, a))
    return asked


def _evaluate(context: Context, arguments: Arguments) -> Bool[Array, "W P"]:
    beside = context.relations.beside(arguments)
    if not context.model.paper:
        beside |= context.relations.beside(arguments[:, ::-1])
    return context.relations.near(arguments) & beside


def _why(context: Context, arguments: tuple[int, ...], world: int) -> str:
    near, beside = (f([arguments])[world, 0] for f in (context.relations.near, context.relations.beside))
    return f"near enough: {yes(near)}; in the horizontal plane: {yes(beside)}"


NEXT_TO = Predicate(
    name="next_to",
    arguments=("object", "object"),
    evaluate=_evaluate,
    of_arguments=True,
    aliases=("nextto",),
    queries=_queries,
    why=_why,
)
