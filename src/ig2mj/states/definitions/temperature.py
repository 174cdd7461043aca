"""Temperature, Celsius: heat sources and sinks act on the objects within their reach, the room on all others.

Newton's law, explicit Euler, as in iGibson's temperature.py:

    T' = T + dt sum_j r_j (T_j - T)      over the sources j that act on the object
    T' = T + dt 0.02 (23 - T)            where none does

The paper prints a multiplicative rule, T' = T (1 + dt r (T_j - T)), under which a fridge freezes nothing; both sets of
rules use Newton's here (iGibson's temperature.py). Differentiable in temperatures, rates and source temperatures.
"""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float

from ig2mj.engine.view import Array
from ig2mj.states.host import Randomness, namespace, uniform
from ig2mj.states.model import StateModel
from ig2mj.states.spec import HeatStep, StateSpec

AMBIENT_TEMPERATURE = 23.0
"""Celsius; also where every object starts (iGibson's temperature.py)."""

AMBIENT_RATE = 0.02
"""1/s (iGibson's temperature.py)."""

FROZEN_RANGE = (50.0, 10.0)
"""Celsius below the freezing temperature between which Frozen(o)=True is sampled (paper table A.5)."""


HOT = 40.0
"""Celsius from which an object is hot (OmniGibson's heated.py)."""

HOT_RANGE = (10.0, 20.0)
"""Celsius above `HOT` between which Hot(o)=True is sampled (OmniGibson's heated.py)."""

THERMAL = ("cookable", "burnable", "freezable")
"""Any of these gives an object a temperature (table A.2)."""


def update(
    model: StateModel,
    temperature: Float[Array, "W O"],
    acts: Bool[Array, "W O S"],
    in_use: Bool[Array, "W O"],
    touching: Bool[Array, "W O O"],
) -> Float[Array, "W O"]:
    """One step.

    Args:
      model: constants.
      temperature: before.
      acts: source j acts on object i (heat_source.py).
      in_use: false for parked objects, which keep their temperature.
      touching: read only where heat passes by contact (`StateOptions.contact_heat_rate`).
    """
    parameters = model.parameters
    rate = acts * parameters.heat_rate
    change = jnp.sum(rate * (parameters.heat_temperature - temperature[..., None]), axis=-1)
    change = jnp.where(jnp.any(acts, axis=-1), change, AMBIENT_RATE * (AMBIENT_TEMPERATURE - temperature))
    if model.options.contact_heat_rate:
        touching = touching & np.outer(parameters.thermal, parameters.thermal)
        difference = temperature[:, None, :] - temperature[:, :, None]
        change += model.options.contact_heat_rate * jnp.sum(touching * difference, axis=-1)
    return jnp.where(in_use & parameters.thermal, temperature + model.options.timestep * change, temperature)


def set_frozen(
    model: StateModel,
    temperature: Float[Array, "W O"],
    objects: Bool[Array, "#W O"],
    value: bool,
    key: Randomness,
) -> Float[Array, "W O"]:
    """Makes the masked objects Frozen or not (paper table A.5).

    True: uniformly 10 to 50 degrees below the freezing temperature. False: one degree above it, even for an object that
    is warmer, as in iGibson.
    """
    freeze = model.parameters.freeze_temperature
    if value:
        target = freeze - uniform(key, temperature.shape, FROZEN_RANGE[1], FROZEN_RANGE[0])
    else:
        target = freeze + 1.0
    chosen = objects & model.parameters.has("freezable")
    return namespace(temperature).where(chosen, target, temperature).astype(np.float32)


def set_hot(
    model: StateModel,
    temperature: Float[Array, "W O"],
    objects: Bool[Array, "#W O"],
    value: bool,
    key: Randomness,
) -> Float[Array, "W O"]:
    """Makes the masked objects Hot, uniformly 10 to 20 degrees above `HOT`, or not, one degree below it."""
    target = HOT + uniform(key, temperature.shape, *HOT_RANGE) if value else np.float32(HOT - 1.0)
    chosen = objects & model.parameters.thermal
    return namespace(temperature).where(chosen, target, temperature).astype(np.float32)


def _update(step: HeatStep) -> HeatStep:
    now = update(step.model, step.states.temperature, step.acts, step.in_use, step.view.touching)
    return step.having(temperature=now)


SPEC = StateSpec.of_objects(
    "temperature", float, AMBIENT_TEMPERATURE, _update, unit="C", abilities=THERMAL, part="heat"
)
