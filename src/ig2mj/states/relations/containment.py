"""Inside: whether two orthogonal axes through an object's centre of mass meet a container on both sides.

Either the vertical and any horizontal axis, or both axes of one of the four planes (table A.1, Inside).
Nine lines against every piece of the container are expensive, and few objects are near any container at all. So only
the pairs that are asked for by a mask are computed: their numbers are listed, container by container, and worked off in
chunks, as many as there are. Memory is that of one chunk, whatever the number of worlds. Containers of similar size
share one loop, in which each chunk takes its container's pieces from a table: the compiled program does not grow with
their number.

Axes: W worlds, P pairs, K containers, C pairs of a chunk, R lines.
"""

from __future__ import annotations

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float, Int

from ig2mj.engine.view import Array, PhysicsView
from ig2mj.geometry.target_table import TargetTable
from ig2mj.geometry.targets import RayTargets, lines_enter_targets
from ig2mj.states.model import StateModel
from ig2mj.states.relations.adjacency import (
    HORIZONTAL_LENGTH,
    HORIZONTAL_LINES,
    INFLATE,
    VERTICAL_LENGTH,
    VERTICAL_LINE,
)
from ig2mj.states.relations.worklist import Worklist

LINES = np.concatenate([HORIZONTAL_LINES, VERTICAL_LINE])

SMALLEST_CHUNK = 8
"""Pairs that are computed together at least."""

CHUNKS_PER_WORLD = {"cpu": 1 / 4}
"""Chunks grow with the number of worlds, so that their number does not. Elsewhere one for each world: on a GPU a turn
is sixteen small kernels and a wait for the host, 90 us for a quarter of 8,192 worlds, and one container took four."""

ALIKE = 4
"""Containers whose pieces differ less than this in number share a loop, in which all cost as much as the largest."""


@dataclasses.dataclass(frozen=True, eq=False)
class ContainerPairs:
    """Pairs (object, container), laid out once.

    Attributes:
      pairs: in the order given. order: pairs sorted by loop and container. start: where each container's pairs begin in
        `order`, and the end. tables: pieces of the containers of each loop, in the same order.
    """

    model: StateModel
    pairs: Int[np.ndarray, "P 2"]
    order: Int[np.ndarray, "P"]
    start: Int[np.ndarray, "K"]
    tables: tuple[TargetTable, ...]

    @classmethod
    def build(cls, model: StateModel, pairs: Int[np.ndarray, "P 2"]) -> ContainerPairs:
        """`pairs` are object indices."""
        owner = model.tables.piece_object
        pieces = np.bincount(owner[owner >= 0], minlength=model.tables.num_objects)
        found, place = np.unique(pairs[:, 1], return_inverse=True)
        sizes = np.floor(np.log(np.maximum(pieces[found], 1)) / np.log(ALIKE)).astype(int)
        by_size = np.argsort(sizes, kind="stable")
        rank = np.argsort(by_size)[place]
        order = np.argsort(rank, kind="stable")
        start = np.append(np.searchsorted(rank[order], np.arange(len(found))), len(pairs))
        loops = [found[by_size[sizes[by_size] == size]] for size in np.unique(sizes)]
        return cls(model, pairs, order, start, tuple(TargetTable.build(model.tables, loop) for loop in loops))

    def inside(self, view: PhysicsView, needed: Bool[Array, "W P"]) -> Bool[Array, "W P"]:
        """Whether each object is inside; false where `needed` is."""
        worlds, count = needed.shape
        share = CHUNKS_PER_WORLD.get(jax.default_backend(), 1)
        chunk = min(worlds * count, max(SMALLEST_CHUNK, round(share * worlds)))
        # Container by container, and within one world by world: number = place in `order` * W + world.
        listed = Worklist.of(needed[:, self.order].T.reshape(-1), chunk)
        before = jnp.concatenate([jnp.zeros(1, listed.until.dtype), listed.until])[self.start * worlds]
        answers, first = listed.no_answers(), 0
        for table in self.tables:
            limits = before[first : first + len(table.bodies) + 1]
            answers = self._work_off(table, view, listed, limits, chunk, worlds, answers)
            first += len(table.bodies)
        found = listed.in_place(answers)
        inverse = np.argsort(self.order)
        return found.reshape(count, worlds).T[:, inverse]

    def _work_off(
        self,
        table: TargetTable,
        view: PhysicsView,
        listed: Worklist,
        limits: Int[Array, "K"],
        chunk: int,
        worlds: int,
        answers: Bool[jax.Array, "M"],
    ) -> Bool[jax.Array, "M"]:
        """Answers the listed pairs of some containers: number k's stand in the list from limits[k] to limits[k + 1]."""
        com = jax.lax.stop_gradient(jnp.asarray(view.object_com))
        pos, quat = (jax.lax.stop_gradient(jnp.asarray(f)) for f in (view.body_pos, view.body_quat))
        subject = jnp.asarray(self.pairs[self.order, 0])
        chunks = (limits[1:] - limits[:-1] + chunk - 1) // chunk
        until = jnp.cumsum(chunks)

        def some(turn: Int[jax.Array, ""], answers: Bool[jax.Array, "M"]) -> Bool[jax.Array, "M"]:
            k = jnp.sum(until <= turn)
            at = limits[k] + (turn - until[k] + chunks[k]) * chunk
            number = listed.places(at)
            place, world = number // worlds, number % worlds
            origins = com[world, subject[jnp.minimum(place, len(self.order) - 1)]]
            bodies, targets = table.of(k)
            answer = surrounded(self.model, targets, pos[world][:, bodies], quat[world][:, bodies], origins)
            return listed.noted(answers, at, answer)  # what reaches into the next container's is overwritten later

        return jax.lax.fori_loop(0, until[-1], some, answers)


def surrounded(
    model: StateModel,
    targets: RayTargets,
    body_pos: Float[Array, "C B 3"],
    body_quat: Float[Array, "C B 4"],
    origins: Float[Array, "C 3"],
) -> Bool[Array, "C"]:
    """Whether orthogonal axes through points meet a container on both sides, `targets` being its pieces."""
    compat = model.options.compat
    lengths = np.full(len(LINES), HORIZONTAL_LENGTH[compat], np.float32)
    lengths[-1] = VERTICAL_LENGTH[compat]
    positive, negative = lines_enter_targets(
        targets, body_pos, body_quat, origins[:, None], LINES, lengths, INFLATE[compat]
    )
    both = (positive & negative)[:, 0]
    planes = both[:, 0:4] & both[:, 4:8]
    return (both[:, 8] & jnp.any(both[:, :8], axis=-1)) | jnp.any(planes, axis=-1)
