"""Making predicates true in one world: what `Simulation.set_predicate` does."""

from __future__ import annotations

import collections
import dataclasses

import jax
import numpy as np

from ig2mj.engine.base import Snapshot, Write
from ig2mj.errors import StateError
from ig2mj.sampling.budget import Budget
from ig2mj.sampling.conditions import Condition
from ig2mj.sampling.joints import JointMover
from ig2mj.sampling.query import SceneQuery
from ig2mj.sampling.row import OPENINGS, Row, RowSampler
from ig2mj.sampling.setters import Change, set_by_name
from ig2mj.scene.scene import Scene
from ig2mj.states.model import StateModel
from ig2mj.states.world import ExtendedStates
from ig2mj.worlds.random_streams import as_seed


class WorldSampler:
    """Samples changes of one world of a scene, in a world of its own on the native engine.

    Attributes:
      rejected: why candidates of the last request were turned down, and how often.
    """

    def __init__(self, scene: Scene, model: StateModel):
        """Binds a scene and the constants of its states."""
        self._scene, self._model = scene, model
        self._sampler: RowSampler | None = None
        self.rejected: collections.Counter[str] = collections.Counter()

    def sample(
        self, condition: Condition, physics: Snapshot, states: ExtendedStates, seed: int, budget: Budget
    ) -> Row | None:
        """The world changed so that the condition holds, at rest and at the same time; None where that was not found.

        Args:
          physics: the world, without the world axis. states: with one of length 1.

        Raises:
          StateError, AbilityError, UnknownNameError: it can never be made true.
        """
        self.rejected = collections.Counter()
        sampler = self._sampler_in(physics, states)
        row = sampler.sample([condition], np.random.default_rng(int(as_seed(seed))), budget, self.rejected)
        if row is None:
            return None
        return Row(dataclasses.replace(row.physics, time=physics.time), row.states)

    def write_of_joints(
        self, change: Change, physics: Snapshot, states: ExtendedStates, object_name: str, value: bool, key: jax.Array
    ) -> Write:
        """Joint positions with which an object is open, or not, that shove nothing; what rests on links goes along.

        The world need not be at rest then: a half-open lid may fall shut.

        Args:
          change: what `set_by_name` drew with this key for "open" of the object, and is taken if it will do.
          physics, states: as for `sample`. value: open or not.

        Raises:
          StateError: every drawn position shoves something.
        """
        query = self._sampler_in(physics, states).query
        query.load(physics)
        mover = JointMover(query, self._scene.object_index(object_name))
        in_the_way: dict[str, None] = {}
        for draw in range(OPENINGS):
            if draw:
                again = jax.random.fold_in(key, draw)
                change = set_by_name(self._model, states, query.view, "open", object_name, value, again)
            assert change.joints is not None
            move = mover.plan(*change.joints)
            shoved = mover.shoved_by(move)
            if not shoved:
                return move.write
            in_the_way |= dict.fromkeys(shoved)
            query.load(physics)
        requested = "opened" if value else "closed"
        raise StateError(
            f"'{object_name}' cannot be {requested} without moving {', '.join(in_the_way)} (move that first)"
        )

    def _sampler_in(self, physics: Snapshot, states: ExtendedStates) -> RowSampler:
        if self._sampler is None:
            self._sampler = RowSampler(SceneQuery(self._scene), self._model, states)
        self._sampler.start_from(physics, states)
        return self._sampler
