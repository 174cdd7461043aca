"""Inside: whether two orthogonal axes through an object's centre of mass meet a container on both sides.

Either the vertical and any horizontal axis, or both axes of one of the four planes (table A.1, Inside; spec/states.md
5.4). Nine lines against every piece of the container are dear, and few objects are near any container at all. So only
the pairs that are asked for by a mask are computed: their numbers are listed, container by container, and worked off in
chunks, as many as there are. Memory is that of one chunk, whatever the number of worlds.

Axes: W worlds, P pairs, C pairs of a chunk, R lines.
"""

from __future__ import annotations

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float, Int

from ig2mj.engine.view import Array, PhysicsView
from ig2mj.geometry.targets import RayTargets, lines_enter_targets
from ig2mj.states.model import StateModel
from ig2mj.states.relations.adjacency import (
    HORIZONTAL_LENGTH,
    HORIZONTAL_LINES,
    INFLATE,
    VERTICAL_LENGTH,
    VERTICAL_LINE,
)

LINES = np.concatenate([HORIZONTAL_LINES, VERTICAL_LINE])

SMALLEST_CHUNK = 8
"""Pairs that are computed together at least."""

CHUNKS_PER_WORLD = 1 / 4
"""Chunks grow with the number of worlds, so that their number does not."""


@dataclasses.dataclass(frozen=True, eq=False)
class Container:
    """One target: its object, its pieces laid out alone, and the bodies they ride on."""

    obj: int
    targets: RayTargets
    bodies: Int[np.ndarray, "B"]


@dataclasses.dataclass(frozen=True, eq=False)
class ContainerPairs:
    """Pairs (object, container), laid out once.

    Attributes:
      pairs: in the order asked for. containers: the distinct targets. order: pairs sorted by container. start: where
      each container's pairs begin in `order`, and the end.
    """

    model: StateModel
    pairs: Int[np.ndarray, "P 2"]
    containers: tuple[Container, ...]
    order: Int[np.ndarray, "P"]
    start: Int[np.ndarray, "K"]

    @classmethod
    def build(cls, model: StateModel, pairs: Int[np.ndarray, "P 2"]) -> ContainerPairs:
        """`pairs` are object indices."""
        found = np.unique(pairs[:, 1])
        order = np.argsort(pairs[:, 1], kind="stable")
        start = np.searchsorted(pairs[order, 1], found)
        containers = tuple(_container(model, int(obj)) for obj in found)
        return cls(model, pairs, containers, order, np.append(start, len(pairs)))

    def inside(self, view: PhysicsView, needed: Bool[Array, "W P"]) -> Bool[Array, "W P"]:
        """Whether each object is inside; false where `needed` is."""
        worlds, count = needed.shape
        chunk = min(worlds * count, max(SMALLEST_CHUNK, round(CHUNKS_PER_WORLD * worlds)))
        # Container by container, and within one world by world: number = place in `order` * W + world.
        mask = needed[:, self.order].T.reshape(-1)
        rank = jnp.cumsum(mask)
        numbers = jnp.nonzero(mask, size=worlds * count, fill_value=worlds * count)[0]
        numbers = jnp.concatenate([numbers, jnp.full(chunk, worlds * count)])
        before = jnp.concatenate([jnp.zeros(1, rank.dtype), rank])[self.start * worlds]
        found = jnp.zeros(worlds * count, bool)
        for k, container in enumerate(self.containers):
            found = self._work_off(container, view, numbers, before[k], before[k + 1], chunk, worlds, found)
        inverse = np.argsort(self.order)
        return found.reshape(count, worlds).T[:, inverse]

    def _work_off(
        self,
        container: Container,
        view: PhysicsView,
        numbers: Int[Array, "N"],
        begin: Int[Array, ""],
        end: Int[Array, ""],
        chunk: int,
        worlds: int,
        found: Bool[Array, "M"],
    ) -> Bool[Array, "M"]:
        """Answers the listed pairs of one container, from `begin` to `end` of the list."""
        com, bodies = jax.lax.stop_gradient(jnp.asarray(view.object_com)), container.bodies
        pos, quat = (jax.lax.stop_gradient(jnp.asarray(f)) for f in (view.body_pos, view.body_quat))
        subject = jnp.asarray(self.pairs[self.order, 0])

        def some(state: tuple) -> tuple:
            at, found = state
            number = jax.lax.dynamic_slice(numbers, (at,), (chunk,))
            valid = at + np.arange(chunk) < end
            place, world = number // worlds, number % worlds
            origins = com[world, subject[jnp.minimum(place, len(self.order) - 1)]]
            answer = self._lines(container, pos[world][:, bodies], quat[world][:, bodies], origins)
            return at + chunk, found.at[jnp.where(valid, number, len(found))].set(answer, mode="drop")

        return jax.lax.while_loop(lambda state: state[0] < end, some, (begin, found))[1]

    def _lines(
        self,
        container: Container,
        pos: Float[Array, "C B 3"],
        quat: Float[Array, "C B 4"],
        origins: Float[Array, "C 3"],
    ) -> Bool[Array, "C"]:
        compat = self.model.options.compat
        lengths = np.full(len(LINES), HORIZONTAL_LENGTH[compat], np.float32)
        lengths[-1] = VERTICAL_LENGTH[compat]
        positive, negative = lines_enter_targets(
            container.targets, pos, quat, origins[:, None], LINES, lengths, INFLATE[compat]
        )
        both = (positive & negative)[:, 0]
        planes = both[:, 0:4] & both[:, 4:8]
        return (both[:, 8] & jnp.any(both[:, :8], axis=-1)) | jnp.any(planes, axis=-1)


def _container(model: StateModel, obj: int) -> Container:
    t = model.tables
    pieces = np.flatnonzero(t.piece_object == obj)
    bodies, riding = np.unique(t.piece_body[pieces], return_inverse=True)
    owner = np.zeros(len(pieces), int)
    shapes = (t.piece_pos, t.piece_quat, t.piece_kind, t.piece_size, t.piece_planes)
    targets = RayTargets.from_pieces(np.zeros(1, int), owner, riding, *(shape[pieces] for shape in shapes))
    return Container(obj, targets, bodies)
