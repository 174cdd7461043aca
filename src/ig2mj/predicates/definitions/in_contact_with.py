"""InContactWith(a, b), iGibson's Touching: the surfaces meet in at least one point (table A.1)."""

from __future__ import annotations

from jaxtyping import Bool

from ig2mj.engine.view import Array
from ig2mj.predicates.base import Arguments, Context, Predicate
from ig2mj.states.relations.touching import touching


def _evaluate(context: Context, arguments: Arguments) -> Bool[Array, "W P"]:
    return touching(context.view, arguments)


IN_CONTACT_WITH = Predicate(
    name="in_contact_with",
    arguments=("object", "object"),
    reads=("view.touching", "view.object_com"),
    evaluate=_evaluate,
    aliases=("touching",),
)
