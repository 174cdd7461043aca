"""Relations of pairs of objects that are known before tracing, each computed once a step.

Heat sources need what is inside them; predicates need inside, above and below, beside, distance. `RelationPlan`
gathers the pairs before tracing; `PlannedRelations` holds the answers. All are computed in every step. (iGibson keeps
answers while two positions are the same, which are wrong once something turns, opens or closes.)

Axes: W worlds, P pairs of a kind, V answers of a pair.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Iterable, Mapping

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Int

from ig2mj.engine.view import Array, PhysicsView
from ig2mj.geometry.poses import AnyArray
from ig2mj.states.model import StateModel
from ig2mj.states.relations.adjacency import AdjacencyPairs
from ig2mj.states.relations.containment import ContainerPairs
from ig2mj.states.relations.nearness import NearPairs, boxes_near
from ig2mj.states.relations.relations import ANSWERS, KINDS, Kind, Pairs, Relations

Pair = tuple[int, int]
Query = tuple[Kind, int, int]
"""What is asked: kind, object, target. Answers: `Relations.inside`, `.above` with `.below`, `.beside`, `.near`."""


@dataclasses.dataclass(frozen=True)
class PlannedRelations(Relations):
    """Answers of one step to the pairs of a plan."""

    plan: RelationPlan
    values: dict[str, Bool[Array, "W P V"]]

    def answer(self, relation: str, pairs: Pairs) -> Bool[Array, "W P"]:
        """See `Relations.answer`; of pairs of the plan."""
        kind, number = ANSWERS[relation]
        where = [self.plan.index[kind][(int(a), int(b))] for a, b in pairs]
        return self.values[kind][:, np.array(where, int), number]


@dataclasses.dataclass(frozen=True, eq=False)
class RelationPlan:
    """The pairs of each kind, without repetition."""

    model: StateModel
    pairs: dict[Kind, tuple[Pair, ...]]

    @classmethod
    def build(cls, model: StateModel, queries: Iterable[Query]) -> RelationPlan:
        """Gathers what all askers need. A pair of an object with itself is left out: it never holds."""
        asked: dict[Kind, dict[Pair, None]] = {kind: {} for kind in KINDS}
        for kind, a, b in queries:
            asked[kind][(int(a), int(b))] = None
        return cls(model, {kind: tuple(pairs) for kind, pairs in asked.items()})

    @functools.cached_property
    def index(self) -> dict[Kind, dict[Pair, int]]:
        """Position of each pair in its kind's axis."""
        return {kind: {pair: i for i, pair in enumerate(pairs)} for kind, pairs in self.pairs.items()}

    @functools.cached_property
    def _work(self) -> dict[Kind, AdjacencyPairs | ContainerPairs | NearPairs]:
        make = {"inside": ContainerPairs, "near": NearPairs}
        return {
            kind: make.get(kind, AdjacencyPairs).build(self.model, np.array(pairs, int))
            for kind, pairs in self.pairs.items()
            if pairs
        }

    def evaluate(self, view: PhysicsView) -> PlannedRelations:
        """All answers, computed now."""
        values = {kind: self._compute(kind, view, self._gate(kind, view)) for kind in self._work}
        return PlannedRelations(self, self._padded(values, view))

    def _compute(self, kind: Kind, view: PhysicsView, needed: Bool[Array, "W P"]) -> Bool[Array, "W P V"]:
        """Answers where they are needed, false elsewhere."""
        work = self._work[kind]
        if isinstance(work, ContainerPairs):
            return work.inside(view, needed)[..., None]
        if isinstance(work, NearPairs):
            return work.near(view, needed)[..., None]
        if kind == "vertical":
            values = jnp.stack(work.vertical(view), axis=-1)
        else:
            positive, negative = work.horizontal(view)
            values = jnp.any(positive | negative, axis=-1)[..., None]
        return needed[..., None] & values

    def _gate(self, kind: Kind, view: PhysicsView) -> Bool[Array, "W P"]:
        return gate(kind, view, self._work[kind].pairs)

    def _padded(self, values: Mapping[str, Array], view: PhysicsView) -> dict[str, Array]:
        """Adds kinds without pairs, so that asking for no pairs gives empty arrays."""
        worlds = view.object_com.shape[0]
        none: dict[str, Array] = {kind: jnp.zeros((worlds, 0, 2), bool) for kind in KINDS if kind not in values}
        return {**none, **values}


def gate(kind: Kind, view: PhysicsView, pairs: Int[AnyArray, "P 2"]) -> Bool[Array, "W P"]:
    """Cheap necessary conditions from world boxes: false means that the answer is no."""
    apart = pairs[:, 0] != pairs[:, 1]
    if kind == "near":
        return boxes_near(view, pairs) & apart
    com = jnp.asarray(view.object_com)[:, pairs[:, 0]]
    low = jnp.asarray(view.aabb_low)[:, pairs[:, 1]] - BOX_SLACK
    high = jnp.asarray(view.aabb_high)[:, pairs[:, 1]] + BOX_SLACK
    within = (low <= com) & (com <= high)
    axes = {"inside": [0, 1, 2], "vertical": [0, 1], "horizontal": [2]}[kind]
    return jnp.all(within[..., np.array(axes)], axis=-1) & apart


BOX_SLACK = 0.005
"""Metres. Rounding of the world box, and the rays' own slack about hulls (`adjacency.INFLATE`)."""
