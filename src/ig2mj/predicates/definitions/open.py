"""Open(o): a relevant joint is more than 5 % of its range from its closed end (table A.1; states/open.py)."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool

from ig2mj.engine.view import Array
from ig2mj.predicates.base import Arguments, Context, Predicate
from ig2mj.states.definitions.open import is_open, thresholds


def _evaluate(context: Context, arguments: Arguments) -> Bool[Array, "W P"]:
    return is_open(context.model, context.view.joint_pos)[:, arguments[:, 0]]


def _why(context: Context, arguments: tuple[int, ...], world: int) -> str:
    joints = np.flatnonzero(context.model.tables.openable_object == arguments[0])
    limit = thresholds(context.model)
    parts = [f"{float(context.view.joint_pos[world, j]):.3f} (opens at {limit[j]:.3f})" for j in joints]
    return "joints at " + ", ".join(parts) if parts else "no relevant joints"


OPEN = Predicate(
    name="open",
    arguments=("object",),
    evaluate=_evaluate,
    of_arguments=True,
    ability="openable",
    why=_why,
)
