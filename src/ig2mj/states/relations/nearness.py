"""How near two objects are: what NextTo rests on (spec/states.md 5.5, paper table A.1).

The limit is a sixth of the sum of the two boxes' mean edge lengths. In the paper's rules the distance is that of the
closest points of the two collision meshes and must be under the limit; in iGibson's code it is the gap of the world
boxes and may equal it (spec/states.md section 17, row 7).

Axes: W worlds, P pairs, M pairs of pieces.
"""

from __future__ import annotations

import dataclasses

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float, Int

from ig2mj.engine.view import Array, PhysicsView
from ig2mj.geometry.boxes import box_gap
from ig2mj.geometry.gjk import piece_distance, pose_pieces
from ig2mj.states.model import StateModel

SHARE_OF_SIZE = 1 / 6
"""Of the sum of the mean edge lengths (iGibson's next_to.py)."""


def limit(view: PhysicsView, pairs: Int[np.ndarray, "P 2"]) -> Float[Array, "W P"]:
    """The largest distance, metres, at which two objects are near."""
    edges = jnp.asarray(view.aabb_high) - jnp.asarray(view.aabb_low)
    return SHARE_OF_SIZE * jnp.mean(edges[:, pairs[:, 0]] + edges[:, pairs[:, 1]], axis=-1)


def boxes_near(view: PhysicsView, pairs: Int[np.ndarray, "P 2"]) -> Bool[Array, "W P"]:
    """Whether the world boxes are near. Where they are not, the objects are not either."""
    low, high = jnp.asarray(view.aabb_low), jnp.asarray(view.aabb_high)
    a, b = pairs[:, 0], pairs[:, 1]
    return box_gap(low[:, a], high[:, a], low[:, b], high[:, b]) <= limit(view, pairs)


@dataclasses.dataclass(frozen=True, eq=False)
class NearPairs:
    """Pairs of objects whose closest points are computed together, laid out once.

    Attributes:
      first, second: pieces of all pairs of pieces. slots: for each pair of objects its pairs of pieces, padded with M.
    """

    model: StateModel
    pairs: Int[np.ndarray, "P 2"]
    first: Int[np.ndarray, "M"]
    second: Int[np.ndarray, "M"]
    slots: Int[np.ndarray, "P S"]

    @classmethod
    def build(cls, model: StateModel, pairs: Int[np.ndarray, "P 2"]) -> NearPairs:
        """Lists the pairs of pieces."""
        owner = model.tables.piece_object
        grids = [np.meshgrid(np.flatnonzero(owner == a), np.flatnonzero(owner == b)) for a, b in pairs]
        sizes = [g[0].size for g in grids]
        slots = np.full((len(pairs), max(sizes, default=0)), sum(sizes))
        for row, size, start in zip(slots, sizes, np.cumsum([0, *sizes[:-1]]), strict=True):
            row[:size] = start + np.arange(size)
        first = np.concatenate([g[0].ravel() for g in grids])
        second = np.concatenate([g[1].ravel() for g in grids])
        return cls(model, pairs, first, second, slots)

    def distance(self, view: PhysicsView) -> Float[Array, "W P"]:
        """Metres between the closest points, 0 where they overlap, inf for objects without pieces."""
        tables = self.model.tables
        a = pose_pieces(tables, view.body_pos, view.body_quat, self.first)
        b = pose_pieces(tables, view.body_pos, view.body_quat, self.second)
        found = piece_distance(a, b).distance
        padded = jnp.concatenate([found, jnp.full((found.shape[0], 1), jnp.inf)], axis=-1)
        return jnp.min(padded[:, self.slots], axis=-1, initial=jnp.inf)

    def near(self, view: PhysicsView) -> Bool[Array, "W P"]:
        """Whether they are near, given that their boxes are."""
        if not self.model.paper:
            return jnp.ones((view.object_com.shape[0], len(self.pairs)), bool)
        return self.distance(view) < limit(view, self.pairs)
