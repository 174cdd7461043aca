"""`GoalRows`: which rows of the view's fields a goal can depend on, so that what it does not name may move.

A predicate that rests on its arguments alone (`Predicate.of_arguments`) reads the rows of its arguments, their links
and their bodies. Where all predicates of the goal that read the view do so, only those rows are compared.
"""

from __future__ import annotations

import numpy as np

from ig2mj.engine.view import SCHEMA
from ig2mj.predicates.compile import CompiledExpression
from ig2mj.predicates.registry import find
from ig2mj.states.model import StateModel


class GoalRows:
    """The rows of one goal."""

    def __init__(self, model: StateModel, goal: CompiledExpression | None):
        """Without a goal no row matters."""
        tables, named = model.tables, set()
        self._every = False
        for name, rows in goal.literals.instances.items() if goal is not None else ():
            predicate = find(name)
            if predicate.per_object is not None:  # reads states only
                continue
            self._every |= not predicate.of_arguments
            for row in rows:
                named.update(i for i, role in zip(row, predicate.arguments, strict=True) if role != "room")
        objects = np.array(sorted(i for i in named if i < tables.num_objects), int)
        of_bodies = np.isin(tables.body_object, objects)
        of_bodies[tables.piece_body[np.isin(tables.piece_object, objects)]] = True
        links = np.flatnonzero(np.isin(tables.link_object, objects))
        self._rows = {"O": objects, "B": np.flatnonzero(of_bodies), "L": links}

    def same(self, name: str, now: np.ndarray, before: np.ndarray) -> bool:
        """Whether a field is the same in all that the goal can read of it; false where that cannot be told."""
        axes = [k for k, axis in enumerate(SCHEMA[name].axes) if axis in self._rows]
        if self._every or not axes:
            return False
        for k in axes:
            rows = self._rows[str(SCHEMA[name].axes[k])]
            if now.take(rows, axis=k).tobytes() != before.take(rows, axis=k).tobytes():
                return False
        return True
