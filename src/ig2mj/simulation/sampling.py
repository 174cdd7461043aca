"""Making predicates true in one world: what `Simulation.set_predicate` does."""

from __future__ import annotations

import collections
import dataclasses

import numpy as np

from ig2mj.engine.base import Snapshot
from ig2mj.sampling.conditions import Condition
from ig2mj.sampling.placement import Budget
from ig2mj.sampling.query import SceneQuery
from ig2mj.sampling.row import Row, RowSampler
from ig2mj.scene.scene import Scene
from ig2mj.states.model import StateModel
from ig2mj.states.world import ExtendedStates


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
        if self._sampler is None:
            self._sampler = RowSampler(SceneQuery(self._scene), self._model, states)
        self._sampler.start_from(physics, states)
        row = self._sampler.sample([condition], np.random.default_rng(seed), budget, self.rejected)
        if row is None:
            return None
        return Row(dataclasses.replace(row.physics, time=physics.time), row.states)
