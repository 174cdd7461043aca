"""`GoalRows`: which rows of a view's fields a goal can depend on, so that everything else may move.

A predicate of its arguments alone (`Predicate.of_arguments`) reads the rows of its arguments, of their links, bodies
and openable joints, and those of floors.
"""

from __future__ import annotations

import numpy as np

from ig2mj.engine.view import SCHEMA, Array
from ig2mj.predicates.literals import NO_OBJECT, Literals
from ig2mj.predicates.registry import find
from ig2mj.states.model import StateModel


class GoalRows:
    """The rows of the literals of a goal."""

    def __init__(self, model: StateModel, literals: Literals):
        tables, named = model.tables, set[int]()
        self._any = False  # some predicate reads more than the rows of its arguments
        for name, rows in literals.instances.items():
            predicate = find(name)
            if predicate.per_object is not None:  # reads states only
                continue
            self._any |= not predicate.of_arguments
            for row in rows:
                named.update(i for i, role in zip(row, predicate.arguments, strict=True) if role not in NO_OBJECT)
        of_goal = np.isin(np.arange(tables.num_objects), list(named)) | tables.object_is_floor
        objects = np.flatnonzero(of_goal)
        bodies = np.union1d(
            np.flatnonzero(np.isin(tables.body_object, objects)),
            tables.piece_body[np.isin(tables.piece_object, objects)],
        )
        links, joints = np.isin(tables.link_object, objects), np.isin(tables.openable_object, objects)
        chosen = {"O": objects, "B": bodies.astype(int), "L": np.flatnonzero(links), "J": np.flatnonzero(joints)}
        self._rows = {  # of `touching` [W, O, O] the first of both: it is symmetric
            name: [(k, chosen[str(x)]) for k, x in enumerate(field.axes) if x in chosen and x not in field.axes[:k]]
            for name, field in SCHEMA.items()
        }
        self._last: dict[str, tuple[Array, list[bytes]]] = {}  # of each field the array compared last, and its rows

    def same(self, name: str, now: Array, before: Array) -> bool:
        """Whether a field is the same in all that the goal can read of it; false where that is unknown."""
        if now is before:
            return True
        rows = self._rows[name]
        if self._any or not rows or not isinstance(now, np.ndarray) or not isinstance(before, np.ndarray):
            return False
        last, old = self._last.get(name, (None, []))
        if last is not before:
            old = [before.take(chosen, k).tobytes() for k, chosen in rows]
        new = [now.take(chosen, k).tobytes() for k, chosen in rows]
        self._last[name] = now, new
        return new == old
