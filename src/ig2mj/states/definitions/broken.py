"""Broken(o): an impact has broken it; it stays broken until the state is set.

An impact is a change of velocity within a control step that gravity does not explain, of an object that touches
something: the impulse of the contact over the object's mass. Objects whose category is breakable break.

Axes: W worlds, O objects.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float

from ig2mj.engine.view import Array, PhysicsView
from ig2mj.errors import UnknownNameError
from ig2mj.knowledge import abilities
from ig2mj.scene.extras import BROKEN
from ig2mj.states.spec import Cut, EventStep, Saved, StateSpec

if TYPE_CHECKING:
    from ig2mj.states.model import StateModel
    from ig2mj.states.world import ExtendedStates

BLOW = 2.5
"""N s for each kilogram that break an object: a fall from 0.32 m that ends within a control step."""

GRAVITY = np.array([0.0, 0.0, -9.81], np.float32)
"""m/s^2."""


def breakable(model: StateModel) -> Bool[np.ndarray, "O"]:
    """Objects that a blow can break: loose, and of a category that can break."""
    return of_breakable_category(model) & ~model.tables.object_fixed


def of_breakable_category(model: StateModel) -> Bool[np.ndarray, "O"]:
    """Objects whose category can break, by the taxonomy."""
    categories = model.tables.object_categories
    known = {category: _can_break(category) for category in set(categories)}
    return np.array([known[c] for c in categories], bool)


def _can_break(category: str) -> bool:
    try:
        return "breakable" in abilities(category)
    except UnknownNameError:
        return False


def _blow(step: EventStep) -> Float[Array, "W O"]:
    """N s for each kilogram that hit each object in this step; 0 of what touches nothing."""
    now, dt = jnp.asarray(step.view.object_linvel), step.model.options.timestep
    change = now - jnp.asarray(step.states.last_velocity) - GRAVITY * np.float32(dt)
    hit = jnp.any(jnp.asarray(step.view.touching), axis=-1)
    return jnp.where(hit, jnp.sqrt(jnp.sum(change * change, axis=-1)), 0.0)


def _update(step: EventStep) -> EventStep:
    broken = jnp.asarray(step.states.broken) | (breakable(step.model) & (_blow(step) > BLOW))
    return step.having(broken=broken, last_velocity=jnp.asarray(step.view.object_linvel))


def _idle(step: EventStep) -> Bool[Array, ""]:
    return jnp.all(jnp.asarray(step.view.object_linvel) == jnp.asarray(step.states.last_velocity))


def _initial(model: StateModel) -> dict[str, np.ndarray]:
    count = model.tables.num_objects
    return {"broken": np.zeros((1, count), bool), "last_velocity": np.zeros((1, count, 3), np.float32)}


def _inherit(states: ExtendedStates, cut: Cut) -> dict[str, Array]:
    return {"broken": cut.of_whole(jnp.asarray(states.broken))}


def _from_manifest(saved: Saved) -> None:
    """From "broken", true or false."""
    if "broken" in saved.values:
        saved.states.broken[0, saved.obj] = saved.values["broken"]


def _set(states: ExtendedStates, mask: Bool[Array, "#W O"], value: object) -> dict[str, Array]:
    xp = np if isinstance(states.broken, np.ndarray) else jnp
    return {"broken": xp.where(mask, bool(value), states.broken)}


def _get(model: StateModel, states: ExtendedStates, view: PhysicsView, obj: int, world: int) -> bool:
    return bool(np.asarray(states.broken)[world, obj])


SPEC = StateSpec(
    name="broken",
    get=_get,
    abilities=None,
    extra=BROKEN,
    fields={"broken": Bool[Array, "W O"], "last_velocity": Float[Array, "W O 3"]},
    initial=_initial,
    update=_update,
    idle=_idle,
    inherit=_inherit,
    from_manifest=_from_manifest,
    set=_set,
)
