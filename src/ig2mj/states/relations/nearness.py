"""How near two objects are: what NextTo rests on (iGibson's next_to.py, paper table A.1).

The limit is a sixth of the sum of the two boxes' mean edge lengths. In the paper's rules the distance is that of the
closest points of the two collision meshes and must be under the limit; in iGibson's code it is the gap of the world
boxes and may equal it (docs/design/rules.md#next-to).

Closest points are expensive (`ig2mj.geometry.gjk`), and two cluttered objects have thousands of pairs of pieces. They
are computed only for object pairs that a mask names, some at a time, and of their pieces only for those whose boxes are
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
from ig2mj.geometry.gjk import PosedPieces, pair_distance
from ig2mj.geometry.poses import AnyArray, compose, quat_rotate, quat_to_matrix
from ig2mj.scene.tables import SceneTables
from ig2mj.states.model import StateModel
from ig2mj.states.relations.worklist import Worklist, or_at

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
        listed = Worklist.of(mask, chunk)
        most = limit(view, self.pairs).T.reshape(-1)
        poses = jnp.concatenate([jnp.asarray(view.body_pos), jnp.asarray(view.body_quat)], axis=-1)
        poses = jax.lax.stop_gradient(poses)

        def some(turn: Int[jax.Array, ""], answers: Bool[jax.Array, "M"]) -> Bool[jax.Array, "M"]:
            number = listed.places(turn * chunk)
            row = jnp.minimum(number, total - 1)
            answer = self._of_rows(poses, row % worlds, row // worlds, most[row], number < total)
            return listed.noted(answers, turn * chunk, answer)

        turns = (jnp.sum(mask) + chunk - 1) // chunk
        answers = jax.lax.fori_loop(0, turns, some, listed.no_answers())
        return listed.in_place(answers).reshape(count, worlds).T

    def _of_rows(
        self,
        poses: Float[Array, "W B 7"],
        world: Int[Array, "C"],
        pair: Int[Array, "C"],
        most: Float[Array, "C"],
        valid: Bool[Array, "C"],
    ) -> Bool[Array, "C"]:
        """Whether the closest points of chosen pairs in chosen worlds are less than `most` metres apart."""
        shapes = _Shapes.of(self.model.tables)
        of_a = self.first.shape[1]
        pieces = jnp.concatenate([jnp.asarray(self.first), jnp.asarray(self.second)], axis=1)[pair]  # [C, S + T]
        first, second = pieces[:, :of_a], pieces[:, of_a:]
        # One call for both would be read through slices, and XLA would compute it again for every pair of pieces.
        low_a, high_a = shapes.boxes(poses, world[:, None], first)
        low_b, high_b = shapes.boxes(poses, world[:, None], second)
        gap = box_gap(low_a[:, :, None], high_a[:, :, None], low_b[:, None], high_b[:, None])
        close = (gap < most[:, None, None] + ROUNDING) & (valid[:, None] & (first >= 0))[:, :, None]
        close &= (second >= 0)[:, None]
        size = close.size
        block = int(np.clip(size // 64, *BLOCK))
        listed = Worklist.of(close.reshape(-1), block)

        def some(turn: Int[jax.Array, ""], found: Bool[jax.Array, "C"]) -> Bool[jax.Array, "C"]:
            number = listed.places(turn * block)
            row, i, j = jnp.unravel_index(jnp.minimum(number, size - 1), close.shape)
            both = pieces[row[:, None], jnp.stack([i, of_a + j], axis=-1)]
            # The barrier keeps XLA from repeating the gathers in everything that reads a piece.
            chosen = jax.lax.optimization_barrier(shapes.pieces(poses, world[row][:, None], both))
            distance = pair_distance(chosen).distance
            return or_at(found, jnp.where(number < size, row, len(found)), distance < most[row])

        turns = (jnp.sum(close) + block - 1) // block
        return jax.lax.fori_loop(0, turns, some, jnp.zeros(len(world), bool))


@dataclasses.dataclass(frozen=True, eq=False)
class _Shapes:
    """The scene's pieces as arrays that may be indexed while tracing; an index of -1 gives any of them.

    Few arrays: each gather is a kernel to compile.

    Attributes:
      numbers: pose in the body (7), middle and half extents of the piece's own box (3, 3), size (3). names: body, kind.
    """

    numbers: Float[np.ndarray, "K 16"]
    names: Int[np.ndarray, "K 2"]
    vertices: Float[np.ndarray, "K V 3"]

    @classmethod
    def of(cls, tables: SceneTables) -> _Shapes:
        low, high = tables.piece_vertices.min(axis=1), tables.piece_vertices.max(axis=1)
        numbers = [tables.piece_pos, tables.piece_quat, (low + high) / 2, (high - low) / 2, tables.piece_size]
        names = np.stack([tables.piece_body, tables.piece_kind], axis=-1).astype(np.int32)
        return cls(np.concatenate(numbers, axis=-1).astype(np.float32), names, tables.piece_vertices.astype(np.float32))

    def _posed(
        self, poses: Float[Array, "W B 7"], world: Int[Array, "*#b"], piece: Int[Array, "*b"]
    ) -> tuple[Float[Array, "*b 16"], Int[Array, "*b 2"], Float[Array, "*b 3"], Float[Array, "*b 4"]]:
        """Rows of `numbers` and `names`, and world poses."""
        numbers, names = jnp.asarray(self.numbers)[piece], jnp.asarray(self.names)[piece]
        body = poses[world, names[..., 0]]
        pos, quat = compose(body[..., :3], body[..., 3:], numbers[..., :3], numbers[..., 3:7])
        return numbers, names, pos, quat

    def boxes(
        self, poses: Float[Array, "W B 7"], world: Int[Array, "*#b"], piece: Int[Array, "*b"]
    ) -> tuple[Float[Array, "*b 3"], Float[Array, "*b 3"]]:
        """World boxes around the pieces' own boxes."""
        numbers, _, pos, quat = self._posed(poses, world, piece)
        middle = pos + quat_rotate(quat, numbers[..., 7:10])
        reach = jnp.sum(jnp.abs(quat_to_matrix(quat)) * numbers[..., None, 10:13], axis=-1)
        return middle - reach, middle + reach

    def pieces(self, poses: Float[Array, "W B 7"], world: Int[Array, "*#b"], piece: Int[Array, "*b"]) -> PosedPieces:
        """What `pair_distance` takes."""
        numbers, names, pos, quat = self._posed(poses, world, piece)
        return PosedPieces(
            kind=names[..., 1], size=numbers[..., 13:16], vertices=jnp.asarray(self.vertices)[piece], pos=pos, quat=quat
        )
