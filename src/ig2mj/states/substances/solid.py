"""What follows from temperatures: which contents are frozen, and which transition rules it is warm enough for.

Contents have the temperature of their container. Both are latches that flow and rules read, so that these read no
temperature (`ig2mj.states.update.events`).

Axes: W worlds, C containers, U substances, D objects that can be covered, Q2: rules in use, and two more: whether the
object is warm enough to melt, and whether it is cooked; X objects that rules make. `hatched` says which of these have
just been made: twice the number of the container, from 1, and 1 more where they were baked.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Int

from ig2mj.engine.view import Array, PhysicsView
from ig2mj.states.definitions.temperature import AMBIENT_TEMPERATURE
from ig2mj.states.model import StateModel
from ig2mj.states.spec import HeatStep, StateSpec, nothing_inherited, nothing_saved
from ig2mj.states.substances.model import SubstanceModel, of

if TYPE_CHECKING:
    from ig2mj.states.world import ExtendedStates


def _update(step: HeatStep) -> HeatStep:
    found = of(step.model)
    temperature = jnp.asarray(step.states.temperature)
    least, most = _limits(found)
    now = temperature[:, found.covered, None]
    cooked = jnp.asarray(step.states.max_temperature) >= step.model.parameters.cook_temperature
    warm = jnp.concatenate([(now >= least) & (now <= most), cooked[:, found.covered, None]], axis=-1)
    step = step.having(solid=temperature[:, found.containers.object, None] <= found.freeze, warm=warm)
    return _warmed(step) if len(found.things.object) and len(found.containers.object) else step


def _warmed(step: HeatStep) -> HeatStep:
    """Objects that a rule has made are as warm as their container, and cooked where the rule takes heat."""
    found, own = of(step.model), of(step.model).things
    hatched, at = jnp.asarray(step.states.hatched), own.object
    new, row = hatched > 0, jnp.maximum(hatched // 2 - 1, 0)
    temperature, hottest = jnp.asarray(step.states.temperature), jnp.asarray(step.states.max_temperature)
    warmth = jnp.take_along_axis(temperature[:, found.containers.object], row, axis=1)
    cook = step.model.parameters.cook_temperature[at]
    baked = jnp.where((hatched % 2 == 1) & np.isfinite(cook), np.where(np.isfinite(cook), cook, 0.0), -jnp.inf)
    highest = jnp.maximum(warmth, baked.astype(jnp.float32))
    return step.having(
        hatched=jnp.zeros_like(hatched),
        temperature=temperature.at[:, at].set(jnp.where(new, warmth, temperature[:, at])),
        max_temperature=hottest.at[:, at].set(jnp.where(new, highest, hottest[:, at])),
    )


def _limits(found: SubstanceModel) -> tuple[np.ndarray, np.ndarray]:
    """Celsius between which each rule applies [Q + 1]; the last is for objects that melt."""
    rules = found.rules
    least = [*(rule.temperature for rule in rules), found.things.melting_point]
    most = [*(rule.cold for rule in rules), np.inf]
    return np.array(least, np.float32), np.array(most, np.float32)


def _initial(model: StateModel) -> dict[str, np.ndarray]:
    shape = (1, len(of(model).containers.object), len(of(model).names))
    found = of(model)
    least, most = _limits(found)
    usual = np.array([*((least <= AMBIENT_TEMPERATURE) & (most >= AMBIENT_TEMPERATURE)), False], bool)
    warm = np.broadcast_to(usual, (1, len(found.covered), len(usual))).copy()
    hatched = np.zeros((1, len(found.things.object)), np.int32)
    return {"solid": np.zeros(shape, bool), "warm": warm, "hatched": hatched}


def _get(model: StateModel, states: ExtendedStates, view: PhysicsView, obj: int, world: int) -> bool:
    row = of(model).containers.row_of(obj)
    if row is None:
        return False
    return bool(np.any(np.asarray(states.solid)[world, row] & (np.asarray(states.volume)[world, row] > 0)))


SPEC = StateSpec(
    name="solid",
    get=_get,
    abilities=None,
    of_substances=True,
    fields={"solid": Bool[Array, "W C U"], "warm": Bool[Array, "W D Q2"], "hatched": Int[Array, "W X"]},
    initial=_initial,
    update=_update,
    inherit=nothing_inherited,
    from_manifest=nothing_saved,  # follows from the temperature
    part="heat",
    follows=lambda model: not (len(of(model).things.object) and len(of(model).containers.object)),
)
