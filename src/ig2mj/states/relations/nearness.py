"""How near two objects are: what NextTo rests on (spec/states.md 5.5, paper table A.1).

The limit is a sixth of the sum of the two boxes' mean edge lengths. In the paper's rules the distance is that of the
closest points of the two collision meshes and must be under the limit; in iGibson's code it is the gap of the world
boxes and may equal it (spec/states.md section 17, row 7).

Closest points are dear (`ig2mj.geometry.gjk`), and two cluttered objects have thousands of pairs of pieces. So only
those of object pairs that a mask names are looked at, some at a time, and of their pieces only those whose boxes are
within the limit. Memory is that of one chunk, whatever the number of worlds.

Axes: W worlds, P pairs, C pairs of a chunk, S and T pieces of the two objects, N pairs of pieces of a block.
"""

from __future__ import annotations

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float, Int

from ig2mj.engine.view import Array, PhysicsView
from ig2mj.geometry.boxes import box_gap
from ig2mj.geometry.gjk import PosedPieces, piece_distance
from ig2mj.geometry.poses import AnyArray, compose, quat_rotate, quat_to_matrix
from ig2mj.scene.tables import SceneTables
from ig2mj.states.model import StateModel

SHARE_OF_SIZE = 1 / 6
"""Of the sum of the mean edge lengths (iGibson's next_to.py)."""

PAIRS_OF_PIECES = 2**18
"""Pairs of pieces of a chunk: their boxes are compared at a time."""

BLOCK = (32, 4096)
"""The fewest and the most pairs of pieces whose closest points are computed at a time."""

ROUNDING = 1e-3
"""Metres that the boxes of two pieces may be farther apart than the limit before the pieces are passed over: far more
than the errors of boxes and distances, so that it changes no answer."""


def limit(view: PhysicsView, pairs: Int[AnyArray, "P 2"]) -> Float[Array, "W P"]:
    """The largest distance, metres, at which two objects are near."""
    edges = jnp.asarray(view.aabb_high) - jnp.asarray(view.aabb_low)
    return SHARE_OF_SIZE * jnp.mean(edges[:, pairs[:, 0]] + edges[:, pairs[:, 1]], axis=-1)


def boxes_near(view: PhysicsView, pairs: Int[AnyArray, "P 2"]) -> Bool[Array, "W P"]:
    """Whether the world boxes are near. Where they are not, the objects are not either."""
    low, high = jnp.asarray(view.aabb_low), jnp.asarray(view.aabb_high)
    a, b = pairs[:, 0], pairs[:, 1]
    return box_gap(low[:, a], high[:, a], low[:, b], high[:, b]) <= limit(view, pairs)


def pieces_of(tables: SceneTables, objects: Int[np.ndarray, "P"]) -> Int[np.ndarray, "P S"]:
    """Indices of each object's pieces, padded with -1."""
    rows = [np.flatnonzero(tables.piece_object == o) for o in objects]
    found = np.full((len(rows), max(map(len, rows), default=0)), -1)
    for row, pieces in zip(found, rows, strict=True):
        row[: len(pieces)] = pieces
    return found


@dataclasses.dataclass(frozen=True, eq=False)
class NearPairs:
    """Pairs of objects whose closest points are computed together.

    Attributes:
      pairs: of objects. first, second: their pieces, padded with -1. All three may be traced.
    """

    model: StateModel
    pairs: Int[AnyArray, "P 2"]
    first: Int[AnyArray, "P S"]
    second: Int[AnyArray, "P T"]

    @classmethod
    def build(cls, model: StateModel, pairs: Int[np.ndarray, "P 2"]) -> NearPairs:
        """Lists the pieces."""
        return cls(model, pairs, pieces_of(model.tables, pairs[:, 0]), pieces_of(model.tables, pairs[:, 1]))

    def near(self, view: PhysicsView, needed: Bool[Array, "W P"]) -> Bool[Array, "W P"]:
        """Whether they are near, given that their boxes are; false where `needed` is."""
        of_a, of_b = self.first.shape[1], self.second.shape[1]
        if not self.model.paper:
            return needed
        if needed.size * of_a * of_b == 0:
            return jnp.zeros(needed.shape, bool)
        worlds, count = needed.shape
        total = worlds * count
        chunk = min(total, max(1, PAIRS_OF_PIECES // (of_a * of_b)))
        mask = needed.T.reshape(-1)  # number = pair * W + world
        numbers = jnp.nonzero(mask, size=total, fill_value=total)[0]
        numbers = jnp.concatenate([numbers, jnp.full(chunk, total)])
        most = limit(view, self.pairs).T.reshape(-1)
        poses = jax.lax.stop_gradient((jnp.asarray(view.body_pos), jnp.asarray(view.body_quat)))

        def some(turn: Int[jax.Array, ""], found: Bool[jax.Array, "M"]) -> Bool[jax.Array, "M"]:
            number = jax.lax.dynamic_slice(numbers, (turn * chunk,), (chunk,))
            row = jnp.minimum(number, total - 1)
            answer = self._of_rows(poses, row % worlds, row // worlds, most[row], number < total)
            return found.at[number].set(answer, mode="drop")

        turns = (jnp.sum(mask) + chunk - 1) // chunk
        found = jax.lax.fori_loop(0, turns, some, jnp.zeros(total, bool))
        return found.reshape(count, worlds).T

    def _of_rows(
        self,
        poses: tuple[Float[Array, "W B 3"], Float[Array, "W B 4"]],
        world: Int[Array, "C"],
        pair: Int[Array, "C"],
        most: Float[Array, "C"],
        valid: Bool[Array, "C"],
    ) -> Bool[Array, "C"]:
        """Whether the closest points of chosen pairs in chosen worlds are less than `most` metres apart."""
        shapes = _Shapes.of(self.model.tables)
        first, second = jnp.asarray(self.first)[pair], jnp.asarray(self.second)[pair]  # [C, S] each
        low_a, high_a = shapes.boxes(*shapes.posed(poses, world[:, None], first), first)
        low_b, high_b = shapes.boxes(*shapes.posed(poses, world[:, None], second), second)
        gap = box_gap(low_a[:, :, None], high_a[:, :, None], low_b[:, None], high_b[:, None])
        close = (gap < most[:, None, None] + ROUNDING) & (valid[:, None] & (first >= 0))[:, :, None]
        close &= (second >= 0)[:, None]
        size = close.size
        block = int(np.clip(size // 64, *BLOCK))
        listed = jnp.nonzero(close.reshape(-1), size=size, fill_value=size)[0]
        listed = jnp.concatenate([listed, jnp.full(block, size)])

        def some(turn: Int[jax.Array, ""], found: Bool[jax.Array, "C"]) -> Bool[jax.Array, "C"]:
            number = jax.lax.dynamic_slice(listed, (turn * block,), (block,))
            row, i, j = jnp.unravel_index(jnp.minimum(number, size - 1), close.shape)
            a, b = first[row, i], second[row, j]
            # The barrier keeps XLA from repeating the gathers in everything that reads a piece.
            both = jax.lax.optimization_barrier(tuple(shapes.pieces(poses, world[row], x) for x in (a, b)))
            distance = piece_distance(*both).distance
            return found.at[jnp.where(number < size, row, len(found))].max(distance < most[row], mode="drop")

        turns = (jnp.sum(close) + block - 1) // block
        return jax.lax.fori_loop(0, turns, some, jnp.zeros(len(world), bool))


@dataclasses.dataclass(frozen=True, eq=False)
class _Shapes:
    """The scene's pieces as arrays that may be indexed while tracing; an index of -1 gives any of them."""

    tables: SceneTables
    center: Float[np.ndarray, "K 3"]
    half: Float[np.ndarray, "K 3"]

    @classmethod
    def of(cls, tables: SceneTables) -> _Shapes:
        low, high = tables.piece_vertices.min(axis=1), tables.piece_vertices.max(axis=1)
        return cls(tables, ((low + high) / 2).astype(np.float32), ((high - low) / 2).astype(np.float32))

    def posed(
        self, poses: tuple[Array, Array], world: Int[Array, "*#b"], piece: Int[Array, "*#b"]
    ) -> tuple[Float[Array, "*b 3"], Float[Array, "*b 4"]]:
        """World poses of pieces."""
        t, body = self.tables, jnp.asarray(self.tables.piece_body)[piece]
        local = [jnp.asarray(x.astype(np.float32))[piece] for x in (t.piece_pos, t.piece_quat)]
        return compose(poses[0][world, body], poses[1][world, body], *local)

    def boxes(
        self, pos: Float[Array, "*b 3"], quat: Float[Array, "*b 4"], piece: Int[Array, "*b"]
    ) -> tuple[Float[Array, "*b 3"], Float[Array, "*b 3"]]:
        """World boxes around the pieces' own boxes."""
        middle = pos + quat_rotate(quat, jnp.asarray(self.center)[piece])
        reach = jnp.sum(jnp.abs(quat_to_matrix(quat)) * jnp.asarray(self.half)[piece][..., None, :], axis=-1)
        return middle - reach, middle + reach

    def pieces(self, poses: tuple[Array, Array], world: Int[Array, "N"], piece: Int[Array, "N"]) -> PosedPieces:
        """What `piece_distance` takes."""
        t = self.tables
        pos, quat = self.posed(poses, world, piece)
        return PosedPieces(
            kind=jnp.asarray(t.piece_kind)[piece],
            size=jnp.asarray(t.piece_size.astype(np.float32))[piece],
            vertices=jnp.asarray(t.piece_vertices.astype(np.float32))[piece],
            pos=pos,
            quat=quat,
        )
