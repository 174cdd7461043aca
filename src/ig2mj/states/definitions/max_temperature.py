"""MaxTemperature, Celsius: the highest temperature so far. Cooked and Burnt are read from it."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float

from ig2mj.engine.view import Array
from ig2mj.states.definitions.temperature import THERMAL
from ig2mj.states.host import namespace
from ig2mj.states.model import StateModel
from ig2mj.states.spec import HeatStep, StateSpec

UNKNOWN = -float("inf")
"""Celsius, before the first update (iGibson's max_temperature.py)."""


def update(
    model: StateModel,
    max_temperature: Float[Array, "W O"],
    temperature: Float[Array, "W O"],
    in_use: Bool[Array, "W O"],
) -> Float[Array, "W O"]:
    """Takes this step's temperature into account; parked objects (`in_use` false) keep theirs, halves -inf."""
    counts = in_use & model.parameters.thermal
    return jnp.where(counts, jnp.maximum(max_temperature, temperature), max_temperature)


def set_cooked(
    model: StateModel, max_temperature: Float[Array, "W O"], objects: Bool[Array, "#W O"], value: bool
) -> Float[Array, "W O"]:
    """Makes the masked objects Cooked, max(T_max, T_cook), or not, min(T_max, T_cook - 1) (paper table A.5).

    The temperature stays: an object that is hotter than T_cook now is cooked again after the next update. In the
    paper's rules an object that is burnt already does not become Cooked by this.
    """
    return _set(max_temperature, model.parameters.cook_temperature, objects, value)


def set_burnt(
    model: StateModel, max_temperature: Float[Array, "W O"], objects: Bool[Array, "#W O"], value: bool
) -> Float[Array, "W O"]:
    """Makes the masked objects Burnt, max(T_max, T_burn), or not, min(T_max, T_burn - 1) (paper table A.5)."""
    return _set(max_temperature, model.parameters.burn_temperature, objects, value)


def _set(
    max_temperature: Float[Array, "W O"], threshold: Float[Array, "O"], objects: Bool[Array, "#W O"], value: bool
) -> Float[Array, "W O"]:
    xp = namespace(max_temperature)
    if value:
        changed = xp.maximum(max_temperature, threshold)
    else:
        changed = xp.minimum(max_temperature, threshold - 1.0)
    return xp.where(objects & np.isfinite(threshold), changed, max_temperature).astype(np.float32)


def _update(step: HeatStep) -> HeatStep:
    hottest = update(step.model, step.states.max_temperature, step.states.temperature, step.in_use)
    return step.having(max_temperature=hottest)


SPEC = StateSpec.of_objects("max_temperature", float, UNKNOWN, _update, unit="C", abilities=THERMAL, part="heat")
