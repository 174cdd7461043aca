"""Drying and getting dirty: options that neither the paper nor iGibson has (`StateOptions.drying_rate`, `.soiling`).

- Drying: liquids that water or a dry cloth removes leave objects, `drying_rate` drops a second at room temperature. The
  rate doubles every `DOUBLES` degrees, as the vapour pressure of water does near room temperature. An object loses so
  much of what it has absorbed, and one covered point for each drop. Oil and paint stay.
- Getting dirty: an object that touches a covered one is covered with the same at its points near covered ones. One of
  the two must be loose. Cleaning tools neither give nor take. Robots carry on what they pass
  (`ig2mj.states.substances.tracks`).

Axes: W worlds, D objects that can be covered, N = 20 points, U substances, K pairs, O objects.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float, UInt32

from ig2mj.engine.view import Array
from ig2mj.knowledge.substances import DRY, WATER
from ig2mj.states.definitions.temperature import AMBIENT_TEMPERATURE
from ig2mj.states.model import StateModel
from ig2mj.states.spec import EventStep
from ig2mj.states.substances import coat, tracks
from ig2mj.states.substances.model import of

DOUBLES, FASTEST = 10.0, 16.0
"""Degrees in which the rate of drying doubles, and the most times that of room temperature that it becomes."""

MOST = 8
"""Pairs of objects that soil each other in a step of a world; the others do once these have."""


def is_on(model: StateModel) -> bool:
    """Whether a scene dries or gets dirty."""
    return bool(model.options.drying_rate or model.options.soiling)


def update(step: EventStep) -> EventStep:
    """One control step of both."""
    if step.model.options.soiling:
        step = tracks.update(step.having(coat=_soiled(step)))
    return _dried(step) if step.model.options.drying_rate else step


def idle(step: EventStep) -> Bool[Array, ""]:
    """Nothing is soiled; what can dry is not looked at."""
    if step.model.options.drying_rate:
        return jnp.array(False)
    return ~jnp.any(_gives(step)) & tracks.idle(step) if step.model.options.soiling else jnp.array(True)


def dries(model: StateModel) -> Bool[np.ndarray, "U"]:
    """Which substances dry."""
    return np.array(
        [s.kind == "liquid" and not {WATER, DRY}.isdisjoint(s.cleaned_by) for s in of(model).substances], bool
    )


def _dried(step: EventStep) -> EventStep:
    model, states, found = step.model, step.states, of(step.model)
    temperature = jnp.asarray(states.temperature)
    times = jnp.minimum(jnp.exp2((temperature - AMBIENT_TEMPERATURE) / DOUBLES), FASTEST)  # [W, O]
    rate = np.float32(model.options.drying_rate * model.options.timestep)
    wet = jnp.asarray(states.wetness)  # already dried as at room temperature (`ig2mj.states.definitions.wetness`)
    wet = jnp.where(wet > 0, jnp.maximum(wet - rate * (times - 1.0), 0.0), wet)
    able, drops = dries(model), rate * times[:, found.covered, None]
    absorbed = jnp.where(able, jnp.maximum(jnp.asarray(states.absorbed) - drops, 0.0), jnp.asarray(states.absorbed))
    points = jnp.asarray(states.coat)
    damp = jnp.where(able & (points > 0), jnp.asarray(states.drying) + drops, 0.0)
    gone = damp >= 1.0
    points = jnp.where(gone, points & (points - np.uint32(1)), points)  # the first of them
    return step.having(wetness=wet, absorbed=absorbed, coat=points, drying=jnp.where(gone, damp - 1.0, damp))


def _gives(step: EventStep) -> Bool[Array, "W D D"]:
    """Which object can be soiled by which that it touches."""
    model, found = step.model, of(step.model)
    tool = model.parameters.has("cleaningTool")[found.covered]
    loose = ~model.tables.object_fixed[found.covered]
    able = (loose[:, None] | loose) & ~tool[:, None] & ~tool
    points = jnp.asarray(step.states.coat)
    touching = jnp.asarray(step.view.touching)[:, found.covered][:, :, found.covered]
    return touching & able & jnp.any((points[:, None] > 0) & (points[:, :, None] != coat.ALL), axis=-1)


def _soiled(step: EventStep) -> UInt32[Array, "W D U"]:
    gives = _gives(step)
    points = jnp.asarray(step.states.coat)
    return jax.lax.cond(jnp.any(gives), lambda: _spread(step, gives), lambda: points)


def _spread(step: EventStep, gives: Bool[Array, "W D D"]) -> UInt32[Array, "W D U"]:
    points, pos = jnp.asarray(step.states.coat), coat.positions(step.model, step.view)
    worlds, count = points.shape[:2]
    left = gives.reshape(worlds, -1)
    made = points
    for _ in range(MOST):
        pair = jnp.argmax(left, axis=-1)  # [W]
        there = jnp.any(left, axis=-1)
        left = left & (np.arange(count * count) != pair[:, None])
        takes, other = pair // count, pair % count
        near = _near(_of(pos, takes), _of(pos, other))
        covered = coat.as_points(_of(points, other))  # [W, U, N]
        new = coat.as_bits(jnp.any(near[:, None] & covered[:, :, None], axis=-1))  # [W, U]
        mine = (np.arange(count) == takes[:, None]) & there[:, None]
        made = made | jnp.where(mine[..., None], new[:, None], np.uint32(0))
    return made


def _of(field: Array, row: Array) -> Array:
    """The rows of a field [W, D, ...] that each world names."""
    return jnp.take_along_axis(field, row.reshape(-1, 1, *[1] * (field.ndim - 2)), axis=1)[:, 0]


def _near(one: Float[Array, "W N 3"], other: Float[Array, "W N 3"]) -> Bool[Array, "W N N"]:
    offset = one[:, :, None] - other[:, None]
    return jnp.sum(offset * offset, axis=-1) <= coat.NEAR**2
