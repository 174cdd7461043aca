"""`Relations`: relations of pairs of objects in one view.

There are two evaluations of the same formulas (adjacency.py, containment.py, nearness.py): of pairs that are known
before tracing, all together (`plan.RelationPlan`), and of traced pairs, one after the other (`traced.TracedRelations`).
"""

from __future__ import annotations

import abc
from collections.abc import Iterable, Sequence
from typing import Any, Literal

import numpy as np
from jaxtyping import Bool

from ig2mj.engine.view import Array

Kind = Literal["inside", "vertical", "horizontal", "near"]
Pairs = Iterable[Sequence[int]] | np.ndarray

KINDS: tuple[Kind, ...] = ("inside", "vertical", "horizontal", "near")
"""What is computed together."""

ANSWERS: dict[str, tuple[Kind, int]] = {
    "inside": ("inside", 0),
    "above": ("vertical", 0),
    "below": ("vertical", 1),
    "beside": ("horizontal", 0),
    "near": ("near", 0),
}
"""Each relation's kind, and which of the kind's answers it is."""


class Relations(abc.ABC):
    """Five relations of pairs (object, target) of object indices, in the order of the pairs.

    Axes: W worlds, P pairs.
    """

    def inside(self, pairs: Any) -> Bool[Array, "W P"]:
        """Two orthogonal axes through the object meet the target on both sides."""
        return self.answer("inside", pairs)

    def above(self, pairs: Any) -> Bool[Array, "W P"]:
        """The target is above the object (InSamePositiveVerticalAxisObjs of the object)."""
        return self.answer("above", pairs)

    def below(self, pairs: Any) -> Bool[Array, "W P"]:
        """The target is below the object (InSameNegativeVerticalAxisObjs of the object)."""
        return self.answer("below", pairs)

    def beside(self, pairs: Any) -> Bool[Array, "W P"]:
        """A horizontal ray of the object enters the target (InSameHorizontalPlaneObjs of the object)."""
        return self.answer("beside", pairs)

    def near(self, pairs: Any) -> Bool[Array, "W P"]:
        """The object and the target are near each other (nearness.py)."""
        return self.answer("near", pairs)

    @abc.abstractmethod
    def answer(self, relation: str, pairs: Any) -> Bool[Array, "W P"]:
        """A relation of `ANSWERS`, of pairs."""
