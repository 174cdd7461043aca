"""OnFire(o): it burns, at 1000 degrees, sets fire to what is near, and burns out (OmniGibson's on_fire.py).

A flammable object of at least 250 degrees catches fire. While it burns, its temperature is that of the fire, and
objects whose boxes are at most 0.2 m away are heated by it as by a stove. It burns out after two minutes, and does not
catch fire again. OmniGibson's fires never end.

Axes: W worlds, O objects.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float

from ig2mj.engine.view import Array, PhysicsView
from ig2mj.scene.extras import ON_FIRE
from ig2mj.scene.manifest import BUILDING
from ig2mj.states.spec import Cut, HeatStep, Saved, StateSpec

if TYPE_CHECKING:
    from ig2mj.states.model import StateModel
    from ig2mj.states.world import ExtendedStates

IGNITION, FIRE = 250.0, 1000.0
"""Celsius (OmniGibson's on_fire.py)."""

NEAR, RATE = 0.2, 0.04
"""m between boxes within which a fire heats, and 1/s at which it does (OmniGibson's on_fire.py)."""

FUEL = 120.0
"""s for which an object burns."""

FLAMMABLE = frozenset(
    [
        "basket",
        "book",
        "bench",
        "bow",
        "broom",
        "candle",
        "carton",
        "chair",
        "christmas_tree",
        "coat",
        "dinner_napkin",
        "dishtowel",
        "document",
        "dress",
        "envelope",
        "firewood",
        "folder",
        "folding_chair",
        "guitar",
        "hand_towel",
        "bath_towel",
        "hardback",
        "hat",
        "jeans",
        "log",
        "magazine",
        "mail",
        "newspaper",
        "notebook",
        "package",
        "pajamas",
        "paper_bag",
        "paper_towel",
        "pencil",
        "pillow",
        "plywood",
        "poster",
        "rag",
        "ribbon",
        "rocking_chair",
        "scarf",
        "sheet",
        "shelf",
        "shirt",
        "sock",
        "sticky_note",
        "stocking",
        "straight_chair",
        "straw",
        "sweater",
        "t-shirt",
        "tinsel",
        "toothpick",
        "underwear",
        "wrapped_gift",
        "wreath",
    ]
)
"""Categories of paper, cloth, wood and wax."""


def flammable(model: StateModel) -> Bool[np.ndarray, "O"]:
    """Objects that can burn."""
    return np.array([c in FLAMMABLE and c not in BUILDING for c in model.tables.object_categories], bool)


def _heated(states: ExtendedStates, view: PhysicsView, dt: float) -> Float[Array, "W O"]:
    """Temperatures after fires have heated what is near."""
    burning, temperature = jnp.asarray(states.on_fire), jnp.asarray(states.temperature)

    def near() -> Array:
        low, high = jnp.asarray(view.aabb_low), jnp.asarray(view.aabb_high)
        gap = jnp.maximum(jnp.maximum(low[:, :, None] - high[:, None], low[:, None] - high[:, :, None]), 0.0)
        reaches = (jnp.sum(gap * gap, axis=-1) <= NEAR**2) & burning[:, None]  # [W, O, O]: heated, fire
        fires = jnp.sum(reaches & ~jnp.eye(reaches.shape[-1], dtype=bool), axis=-1)
        return temperature + np.float32(dt * RATE) * fires * (FIRE - temperature)

    return jax.lax.cond(jnp.any(burning), near, lambda: temperature)


def _update(step: HeatStep) -> HeatStep:
    model, states, dt = step.model, step.states, step.model.options.timestep
    warm = jnp.where(step.in_use & model.parameters.thermal, _heated(states, step.view, dt), states.temperature)
    fuel = jnp.asarray(states.fuel)
    catches = flammable(model) & step.in_use & (warm >= IGNITION) & (fuel > 0)
    burning = (jnp.asarray(states.on_fire) | catches) & (fuel > 0)
    left = jnp.where(burning, jnp.maximum(fuel - np.float32(dt), 0.0), fuel)
    temperature = jnp.where(burning, FIRE, warm).astype(jnp.float32)
    hottest = jnp.maximum(jnp.asarray(states.max_temperature), jnp.where(burning, FIRE, -jnp.inf))
    return step.having(on_fire=burning & (left > 0), fuel=left, temperature=temperature, max_temperature=hottest)


def _initial(model: StateModel) -> dict[str, np.ndarray]:
    shape = (1, model.tables.num_objects)
    return {"on_fire": np.zeros(shape, bool), "fuel": np.full(shape, FUEL, np.float32)}


def _inherit(states: ExtendedStates, cut: Cut) -> dict[str, Array]:
    return {"on_fire": cut.of_whole(jnp.asarray(states.on_fire)), "fuel": cut.of_whole(jnp.asarray(states.fuel))}


def _from_manifest(saved: Saved) -> None:
    """From "on_fire", true or false."""
    if saved.values.get("on_fire"):
        saved.states.on_fire[0, saved.obj] = True
        saved.states.temperature[0, saved.obj] = FIRE


def _set(states: ExtendedStates, mask: Bool[Array, "#W O"], value: object) -> dict[str, Array]:
    xp = np if isinstance(states.on_fire, np.ndarray) else jnp
    colder = xp.where(states.on_fire, np.float32(IGNITION - 1.0), states.temperature)
    temperature = xp.where(mask, np.float32(FIRE) if value else colder, states.temperature)
    return {
        "on_fire": xp.where(mask, bool(value), states.on_fire),
        "fuel": xp.where(mask & bool(value), np.float32(FUEL), states.fuel).astype(np.float32),
        "temperature": temperature.astype(np.float32),
    }


def _get(model: StateModel, states: ExtendedStates, view: PhysicsView, obj: int, world: int) -> bool:
    return bool(np.asarray(states.on_fire)[world, obj])


SPEC = StateSpec(
    name="on_fire",
    get=_get,
    abilities=None,
    extra=ON_FIRE,
    fields={"on_fire": Bool[Array, "W O"], "fuel": Float[Array, "W O"]},
    initial=_initial,
    update=_update,
    inherit=_inherit,
    from_manifest=_from_manifest,
    set=_set,
    part="heat",
)
