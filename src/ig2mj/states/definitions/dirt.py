"""`Dirt`: one kind of particles that cleaning tools wipe off; dust and stains are two.

Axes: W worlds, O objects, R rows of particles, N particles, T tools.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float, Int

from ig2mj.engine.view import Array
from ig2mj.states import particles
from ig2mj.states.definitions import cleaning
from ig2mj.states.model import StateModel
from ig2mj.states.particles import Particles, particle_state
from ig2mj.states.spec import EventStep, StateSpec


@dataclasses.dataclass(frozen=True)
class Dirt:
    """A kind of dirt.

    Attributes:
      name: of the state and of its field of `ExtendedStates`. ability: of objects that can be dirty this way.
      alias: iGibson's name of the state. rows: objects of the rows of particles [R]. threshold: share of the placed
        particles above which each object is dirty [O]. can_clean: tools that take it now [W, T].
    """

    name: str
    ability: str
    alias: str
    rows: Callable[[StateModel], Int[np.ndarray, "R"]]
    threshold: Callable[[StateModel], Float[np.ndarray, "O"]]
    can_clean: Callable[[EventStep], Bool[Array, "W T"]]

    def row_of(self, model: StateModel, obj: int) -> int | None:
        """The object's row of particles, or None: it lacks the ability."""
        return particles.row_of(self.rows(model), obj)

    def is_dirty(self, model: StateModel, rows: Particles) -> Bool[Array, "W R"]:
        """Whether each row's level is over the threshold, strictly (table A.1)."""
        return particles.exceeds(rows, self.threshold(model)[self.rows(model)])

    def place(
        self,
        model: StateModel,
        rows: Particles,
        row: int,
        body: Int[Array, "#W N"],
        pos: Float[Array, "#W N 3"],
        normal: Float[Array, "#W N 3"],
        valid: Bool[Array, "#W N"],
        worlds: Bool[Array, "W"] | None = None,
    ) -> tuple[Particles, Bool[Array, "W"]]:
        """Dirties an object at sampled surface points, and says where that succeeded (see `particles.place`)."""
        minimum = particles.MIN_PLACED[model.options.compat]
        return particles.place(rows, row, body, pos, normal, valid, minimum, worlds)

    def spec(self) -> StateSpec:
        """The state."""
        return particle_state(self.name, self.ability, self.rows, self._update, self._idle, aliases=(self.alias,))

    def _update(self, step: EventStep) -> Particles:
        rows = getattr(step.states, self.name)
        return cleaning.update(step.model, rows, self.rows(step.model), self.can_clean(step), step.view)

    def _idle(self, step: EventStep) -> Bool[Array, ""]:
        rows = getattr(step.states, self.name)
        return ~jnp.any(cleaning.meeting(step.model, rows, self.rows(step.model), self.can_clean(step), step.view))
