"""WetnessLevel: droplets that a soakable object has absorbed (paper table A.4); Soaked is read from it.

The paper's level is a number that grows by one per droplet. iGibson's code keeps a latch only: here, with
compat="igibson", one drop on the object makes the level the soaked threshold and no more
(docs/design/rules.md#wetness). Drying is no part of either and off by default (`StateOptions.drying_rate`).
"""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float, Int

from ig2mj.engine.view import Array
from ig2mj.states.host import namespace
from ig2mj.states.model import StateModel
from ig2mj.states.spec import EventStep, StateSpec


def update(model: StateModel, wetness: Float[Array, "W O"], drops: Int[Array, "W O"]) -> Float[Array, "W O"]:
    """One step; `drops` touched each soakable object in it (water.py)."""
    if model.options.drying_rate:
        wetness = jnp.maximum(wetness - model.options.drying_rate * model.options.timestep, 0.0)
    if model.paper:
        return wetness + drops
    return jnp.where(drops > 0, jnp.maximum(wetness, model.parameters.wetness_soaked), wetness)


def soaked(model: StateModel, wetness: Float[Array, "W O"]) -> Bool[Array, "W O"]:
    """Whether each object is at or over its threshold (table A.1); false without the ability."""
    return wetness >= model.parameters.wetness_soaked


def set_soaked(
    model: StateModel, wetness: Float[Array, "W O"], objects: Bool[Array, "#W O"], value: bool
) -> Float[Array, "W O"]:
    """Makes the masked objects' wetness match the threshold, or 0 (paper table A.5)."""
    level = model.parameters.wetness_soaked if value else 0.0
    chosen = objects & model.parameters.has("soakable")
    return namespace(wetness).where(chosen, np.float32(level), wetness)


def _update(step: EventStep) -> EventStep:
    return step.having(wetness=update(step.model, step.states.wetness, step.drops))


def _idle(step: EventStep) -> Bool[Array, ""]:
    wetness = step.states.wetness
    return jnp.all(update(step.model, wetness, step.drops) == wetness)


SPEC = StateSpec.of_objects(
    "wetness", float, 0.0, _update, idle=_idle, unit="droplets", abilities=("soakable",), aliases=("wetness_level",)
)
