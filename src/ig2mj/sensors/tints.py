"""How objects look in their states: frozen, burnt, cooked, soaked or switched on (spec/states.md section 13).

Of the states that are true the first of `TINTS` is shown. iGibson mixes the state's colour into the object's texture;
here it is mixed into the object's colour, per world. Shared by cameras and viewers.

Axes: W worlds, O objects, T tints.
"""

from __future__ import annotations

import dataclasses

import jax.numpy as jnp
import numpy as np
from flax import struct
from jaxtyping import Bool, Float

from ig2mj.engine.view import Array
from ig2mj.predicates.base import Predicate
from ig2mj.predicates.burnt import BURNT
from ig2mj.predicates.cooked import COOKED
from ig2mj.predicates.frozen import FROZEN
from ig2mj.predicates.soaked import SOAKED
from ig2mj.predicates.toggled_on import TOGGLED_ON
from ig2mj.states.model import StateModel
from ig2mj.states.world import ExtendedStates


@dataclasses.dataclass(frozen=True)
class Tint:
    """(1 - weight) x the object's colour + weight x `colour`, all times `brightness`; colour is 0..1."""

    predicate: Predicate
    weight: float
    colour: tuple[float, float, float] = (0.0, 0.0, 0.0)
    brightness: float = 1.0


TINTS = (
    Tint(FROZEN, 0.8, (1.0, 1.0, 1.0)),
    Tint(BURNT, 0.8, (0.0, 0.0, 0.0)),
    Tint(COOKED, 0.5, (139 / 255, 69 / 255, 19 / 255)),
    Tint(SOAKED, 0.5, (0.0, 0.0, 200 / 255)),
    Tint(TOGGLED_ON, 0.0, brightness=1.5),
)
"""Highest priority first (spec/states.md section 13)."""


@struct.dataclass
class ObjectTints:
    """What to do to each object's colour. `on`: anything at all; `weight`, `colour`, `brightness` as in `Tint`."""

    on: Bool[Array, "W O"]
    weight: Float[Array, "W O"]
    colour: Float[Array, "W O 3"]
    brightness: Float[Array, "W O"]

    def apply(self, rgb: Float[Array, "G 3"] | Float[np.ndarray, "G 3"], owner: np.ndarray) -> Float[Array, "W G 3"]:
        """Colours of things that belong to objects: `owner` [G], -1 where nothing is tinted."""
        at = np.maximum(owner, 0)
        weight = self.weight[:, at, None]
        mixed = ((1 - weight) * jnp.asarray(rgb) + weight * self.colour[:, at]) * self.brightness[:, at, None]
        return jnp.where((self.on[:, at] & (owner >= 0))[..., None], jnp.clip(mixed, 0.0, 1.0), jnp.asarray(rgb))


def tints(model: StateModel, states: ExtendedStates) -> ObjectTints:
    """The tint of every object in every world. Pure."""
    true: list[Bool[Array, "W O"]] = []
    for tint in TINTS:
        of_states = tint.predicate.per_object
        assert of_states is not None
        able = model.parameters.has(tint.predicate.ability or "")
        true.append(jnp.asarray(of_states(model, states)) & able)
    stacked = jnp.stack(true, axis=-1)  # W O T
    first = jnp.argmax(stacked, axis=-1)
    on = stacked.any(-1)
    return ObjectTints(
        on=on,
        weight=jnp.where(on, jnp.array([t.weight for t in TINTS], jnp.float32)[first], 0.0),
        colour=jnp.array([t.colour for t in TINTS], jnp.float32)[first],
        brightness=jnp.where(on, jnp.array([t.brightness for t in TINTS], jnp.float32)[first], 1.0),
    )
