"""DustinessLevel: particles that any cleaning tool wipes off (paper table A.4, cleaning.py)."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float, Int

from ig2mj.engine.view import Array
from ig2mj.states import particles
from ig2mj.states.model import StateModel
from ig2mj.states.particles import Particles


def row_of(model: StateModel, obj: int) -> int | None:
    """The object's row of dust particles, or None: it is not dustyable."""
    rows = np.flatnonzero(model.parameters.dust_rows == obj)
    return int(rows[0]) if len(rows) else None


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
