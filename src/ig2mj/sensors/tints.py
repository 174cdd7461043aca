"""The colours of states: of objects that are frozen, burnt, cooked, soaked or switched on, as iGibson tints textures,
and of dust, stains and water. Their one home; cameras and viewers take them from here.

Of the states that are true the first of `TINTS` is shown. iGibson mixes the state's colour into the object's texture;
here it is mixed into the object's colour, per world, and on decorated homes into its texture
(`ig2mj.looks.state_looks`).

Axes: W worlds, O objects, G geoms.
"""

from __future__ import annotations

import dataclasses

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float, Int

from ig2mj.engine.view import Array
from ig2mj.looks.state_looks import MIXTURES, Mixture
from ig2mj.predicates.base import Predicate
from ig2mj.predicates.definitions.burnt import BURNT
from ig2mj.predicates.definitions.cooked import COOKED
from ig2mj.predicates.definitions.frozen import FROZEN
from ig2mj.predicates.definitions.soaked import SOAKED
from ig2mj.predicates.definitions.toggled_on import TOGGLED_ON
from ig2mj.states.model import StateModel
from ig2mj.states.world import ExtendedStates


@dataclasses.dataclass(frozen=True)
class Tint(Mixture):
    """How objects look in which a predicate is true. See `ig2mj.looks.state_looks.Mixture`."""

    predicate: Predicate = dataclasses.field(kw_only=True)


TINTS = tuple(
    Tint(**dataclasses.asdict(MIXTURES[predicate.name]), predicate=predicate)
    for predicate in (FROZEN, BURNT, COOKED, SOAKED, TOGGLED_ON)
)
"""Highest priority first, as in iGibson."""

DUST_COLOUR = (0.55, 0.52, 0.47)
STAIN_COLOUR = (0.30, 0.16, 0.07)
WATER_COLOUR = (0.35, 0.60, 0.90)
"""rgb 0..1, of particles and drops."""

WATER_ALPHA = 0.7
"""Drops are a little transparent in viewers; cameras draw them opaque."""

UNTINTED = -1
"""Where no state shows."""


def tints(model: StateModel, states: ExtendedStates) -> Int[Array, "W O"]:
    """Which of `TINTS` every object has in every world, or `UNTINTED`. Pure."""
    true: list[Bool[Array, "W O"]] = []
    for tint in TINTS:
        of_states = tint.predicate.per_object
        assert of_states is not None
        able = model.parameters.has(tint.predicate.ability or "")
        true.append(jnp.asarray(of_states(model, states)) & able)
    stacked = jnp.stack(true, axis=-1)  # one column for each tint
    return jnp.where(stacked.any(-1), jnp.argmax(stacked, axis=-1), UNTINTED)


STATES = tuple(tint.predicate.name for tint in TINTS)
"""Names of the states, in the order of `TINTS`."""

SWITCHED_ON = STATES.index("toggled_on")


def tints_of_geoms(tint: Int[Array, "W O"], owner: Int[np.ndarray, "G"]) -> Int[Array, "W G"]:
    """The tints of objects' geoms; `owner` is -1 for what belongs to no object."""
    return jnp.where(owner >= 0, tint[:, np.maximum(owner, 0)], UNTINTED)


def tinted(rgb: Float[Array, "G 3"], tint: Int[Array, "W G"]) -> Float[Array, "W G 3"]:
    """Colours (0..1) in their tints."""
    weight = jnp.array([t.weight for t in TINTS], jnp.float32)[tint][..., None]
    colour = jnp.array([t.colour for t in TINTS], jnp.float32)[tint]
    brightness = jnp.array([t.brightness for t in TINTS], jnp.float32)[tint][..., None]
    mixed = jnp.clip(((1 - weight) * jnp.asarray(rgb) + weight * colour) * brightness, 0.0, 1.0)
    return jnp.where((tint == UNTINTED)[..., None], jnp.asarray(rgb), mixed)
