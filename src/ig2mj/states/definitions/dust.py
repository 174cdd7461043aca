"""DustinessLevel: particles that any cleaning tool wipes off (paper table A.4, cleaning.py)."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float, Int

from ig2mj.engine.view import Array
from ig2mj.states import particles
from ig2mj.states.definitions import cleaning
from ig2mj.states.model import StateModel
from ig2mj.states.particles import Particles, particle_state
from ig2mj.states.spec import EventStep


def rows(model: StateModel) -> Int[np.ndarray, "R"]:
    """The objects that carry rows of dust."""
    return model.parameters.dust_rows


def row_of(model: StateModel, obj: int) -> int | None:
    """The object's row of dust particles, or None: it is not dustyable."""
    return particles.row_of(rows(model), obj)


def dusty(model: StateModel, dust: Particles) -> Bool[Array, "W R"]:
    """Whether each row's level is over the threshold, strictly (table A.1)."""
    return particles.exceeds(dust, model.parameters.dusty_threshold[model.parameters.dust_rows])


def set_dusty(
    model: StateModel,
    dust: Particles,
    row: int,
    body: Int[Array, "#W N"],
    pos: Float[Array, "#W N 3"],
    normal: Float[Array, "#W N 3"],
    valid: Bool[Array, "#W N"],
    worlds: Bool[Array, "W"] | None = None,
) -> tuple[Particles, Bool[Array, "W"]]:
    """Dusty(o)=True at sampled surface points, and where that succeeded (see `particles.place`)."""
    minimum = particles.MIN_PLACED[model.options.compat]
    return particles.place(dust, row, body, pos, normal, valid, minimum, worlds)


def set_not_dusty(dust: Particles, row: int, worlds: Bool[Array, "W"] | None = None) -> Particles:
    """Dusty(o)=False: all particles go (paper table A.5)."""
    return particles.remove(dust, row, worlds)


def _update(step: EventStep) -> Particles:
    able = cleaning.working(step.model, step.states.toggled_on)
    return cleaning.update(step.model, step.states.dust, rows(step.model), able, step.view)


SPEC = particle_state("dust", "dustyable", rows, _update, aliases=("dustiness_level",))
