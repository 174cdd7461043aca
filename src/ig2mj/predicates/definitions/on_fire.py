"""OnFire(o): it burns (OmniGibson's on_fire.py)."""

from __future__ import annotations

import jax.numpy as jnp
from jaxtyping import Bool

from ig2mj.engine.view import Array
from ig2mj.predicates.base import Context, Predicate, celsius
from ig2mj.scene.extras import ON_FIRE
from ig2mj.states.definitions.on_fire import IGNITION
from ig2mj.states.model import StateModel
from ig2mj.states.world import ExtendedStates


def _on_fire(model: StateModel, states: ExtendedStates) -> Bool[Array, "W O"]:
    return states.on_fire if ON_FIRE in model.extras else jnp.zeros(states.sliced.shape, bool)


def _why(context: Context, arguments: tuple[int, ...], world: int) -> str:
    if ON_FIRE not in context.model.extras:
        return "the scene is loaded without fire (with:on_fire)"
    return (
        f"temperature {celsius(float(context.states.temperature[world, arguments[0]]))}, it burns from {IGNITION:g} C"
    )


ON_FIRE_PREDICATE = Predicate.of_states(_on_fire, name="on_fire", why=_why)
