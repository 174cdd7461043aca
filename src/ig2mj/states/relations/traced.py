"""Relations of pairs that are not known before tracing, for queries of the host.

A goal's pairs are laid out before tracing (`plan.py`), which is fastest to run and slow to compile. Here a pair is two
numbers, and the pieces that it needs are slices of tables of the whole scene, so that one compiled program serves every
pair. Pairs that the boxes rule out cost next to nothing.

Axes: W worlds, O objects, P pairs.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Int

from ig2mj.engine.view import Array, PhysicsView
from ig2mj.geometry.poses import AnyArray
from ig2mj.geometry.target_table import TargetTable
from ig2mj.process.gc_pause import GC_PAUSED
from ig2mj.states.model import StateModel
from ig2mj.states.relations.adjacency import AdjacencyPairs
from ig2mj.states.relations.containment import surrounded
from ig2mj.states.relations.nearness import NearPairs, pieces_of
from ig2mj.states.relations.plan import gate
from ig2mj.states.relations.relations import ANSWERS, Kind, Relations

PLANES_AT_ONCE = 8
"""Half-spaces in each turn of a loop (`ig2mj.geometry.rays.clip_line`): one pair is little work."""


SCENES = 8
"""Scenes whose program of `neighbours` is kept: those used last."""


@dataclasses.dataclass(frozen=True, eq=False)
class PieceTables:
    """The pieces of all objects of a scene, to be chosen from by number. Built once per scene."""

    model: StateModel

    @functools.cached_property
    def targets(self) -> TargetTable:
        """For rays."""
        return TargetTable.build(self.model.tables, np.arange(self.model.tables.num_objects))

    @functools.cached_property
    def pieces(self) -> Int[np.ndarray, "O S"]:
        """For distances."""
        return pieces_of(self.model.tables, np.arange(self.model.tables.num_objects))


@dataclasses.dataclass(frozen=True, eq=False)
class TracedRelations(Relations):
    """Relations of pairs that may be traced; everything is computed where it is asked for."""

    tables: PieceTables
    view: PhysicsView
    _done: dict[tuple[Kind, int], tuple[Array, Array]] = dataclasses.field(default_factory=dict)  # with the pairs

    def answer(self, relation: str, pairs: Int[AnyArray, "P 2"]) -> Bool[Array, "W P"]:
        """See `Relations.answer`."""
        kind, number = ANSWERS[relation]
        return self._each(kind, pairs)[..., number]

    def _each(self, kind: Kind, pairs: Int[AnyArray, "P 2"]) -> Bool[Array, "W P 2"]:
        """One or two answers of each pair, one pair after the other."""
        if not len(pairs):
            return jnp.zeros((self.view.object_com.shape[0], 0, 2), bool)
        key = (kind, id(pairs))
        if key not in self._done:
            found = jax.lax.map(lambda pair: self._one(kind, pair[None]), jnp.asarray(pairs))
            self._done[key] = pairs, jnp.moveaxis(found, 0, 1)
        return self._done[key][1]

    def _one(self, kind: Kind, pair: Int[Array, "1 2"]) -> Bool[Array, "W 2"]:
        possible = gate(kind, self.view, pair)

        def compute() -> Bool[Array, "W 2"]:
            return possible & self._computed(kind, pair, possible)

        return jax.lax.cond(jnp.any(possible), compute, lambda: jnp.zeros((len(possible), 2), bool))

    def _computed(self, kind: Kind, pair: Int[Array, "1 2"], needed: Bool[Array, "W 1"]) -> Bool[Array, "W 2"]:
        """One or two answers of one pair, which count where they are needed."""
        model, view = self.tables.model, self.view
        if kind == "near":
            pieces = jnp.asarray(self.tables.pieces)
            near = NearPairs(model, pair, pieces[pair[:, 0]], pieces[pair[:, 1]]).near(view, needed)
            return jnp.broadcast_to(near, (len(near), 2))
        bodies, targets = self.tables.targets.of(pair[0, 1], PLANES_AT_ONCE)
        pos, quat = (jnp.asarray(field)[:, bodies] for field in (view.body_pos, view.body_quat))
        if kind == "inside":
            held = surrounded(model, targets, pos, quat, jnp.asarray(view.object_com)[:, pair[0, 0]])
            return jnp.stack([held, held], axis=-1)
        rays = AdjacencyPairs(model, pair, targets)
        if kind == "vertical":
            return jnp.concatenate(rays.vertical(view, (pos, quat)), axis=-1)
        positive, negative = rays.horizontal(view, (pos, quat))
        beside = jnp.any(positive | negative, axis=-1)
        return jnp.broadcast_to(beside, (len(beside), 2))


def neighbours(model: StateModel, view: PhysicsView, obj: int, world: int = 0) -> dict[str, list[str]]:
    """Names of all objects that the rays of one object enter, by "above", "below" and "beside" (table A.4).

    On the host. The first call compiles a program, which serves all objects of the scene.
    """
    with GC_PAUSED:
        found = _neighbours(model)(jax.tree.map(lambda a: np.asarray(a[world : world + 1]), view), obj)
    names = model.tables.object_names
    return {relation: [names[o] for o in np.flatnonzero(found[relation])] for relation in found}


@functools.lru_cache(maxsize=SCENES)
def _neighbours(model: StateModel) -> Callable[[PhysicsView, int], dict[str, Bool[Array, "O"]]]:
    """The compiled part of `neighbours`: relations of an object to all others, in a view of one world."""
    tables, count = PieceTables(model), model.tables.num_objects

    @jax.jit
    def neighbours_of(view: PhysicsView, obj: Int[Array, ""]) -> dict[str, Bool[Array, "O"]]:
        pairs = jnp.stack([jnp.full(count, obj), jnp.arange(count)], axis=-1)
        relations = TracedRelations(tables, view)
        return {name: relations.answer(name, pairs)[0] for name in ("above", "below", "beside")}

    return neighbours_of
