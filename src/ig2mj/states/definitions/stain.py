"""StainLevel: particles that a soaked cleaning tool wipes off (paper table A.4, cleaning.py)."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float, Int

from ig2mj.engine.view import Array
from ig2mj.states import particles
from ig2mj.states.definitions import cleaning, wetness
from ig2mj.states.model import StateModel
from ig2mj.states.particles import Particles, particle_state
from ig2mj.states.spec import EventStep


def rows(model: StateModel) -> Int[np.ndarray, "R"]:
    """The objects that carry rows of stain."""
    return model.parameters.stain_rows


def row_of(model: StateModel, obj: int) -> int | None:
    """The object's row of stain particles, or None: it is not stainable."""
    return particles.row_of(rows(model), obj)


def stained(model: StateModel, stain: Particles) -> Bool[Array, "W R"]:
    """Whether each row's level is over the threshold, strictly (table A.1)."""
    return particles.exceeds(stain, model.parameters.stained_threshold[model.parameters.stain_rows])


def set_stained(
    model: StateModel,
    stain: Particles,
    row: int,
    body: Int[Array, "#W N"],
    pos: Float[Array, "#W N 3"],
    normal: Float[Array, "#W N 3"],
    valid: Bool[Array, "#W N"],
    worlds: Bool[Array, "W"] | None = None,
) -> tuple[Particles, Bool[Array, "W"]]:
    """Stained(o)=True at sampled surface points, and where that succeeded (see `particles.place`)."""
    minimum = particles.MIN_PLACED[model.options.compat]
    return particles.place(stain, row, body, pos, normal, valid, minimum, worlds)


def set_not_stained(stain: Particles, row: int, worlds: Bool[Array, "W"] | None = None) -> Particles:
    """Stained(o)=False: all particles go (paper table A.5)."""
    return particles.remove(stain, row, worlds)


def _update(step: EventStep) -> Particles:
    soaked = wetness.soaked(step.model, step.states.wetness)[:, step.model.parameters.tool_object]
    able = cleaning.working(step.model, step.states.toggled_on) & soaked
    return cleaning.update(step.model, step.states.stain, rows(step.model), able, step.view)


SPEC = particle_state("stain", "stainable", rows, _update, aliases=("stain_level",))
