"""What follows from temperatures: which contents are frozen, and which transition rules it is warm enough for.

Contents have the temperature of their container. Both are latches that flow and rules read, so that these read no
temperature (`ig2mj.states.update.events`).

Axes: W worlds, C containers, U substances, D objects that can be covered, Q2: rules in use, and two more: whether the
object is warm enough to melt, and whether it is cooked.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool

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
    return step.having(solid=temperature[:, found.containers.object, None] <= found.freeze, warm=warm)


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
    return {"solid": np.zeros(shape, bool), "warm": warm}


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
    fields={"solid": Bool[Array, "W C U"], "warm": Bool[Array, "W D Q2"]},
    initial=_initial,
    update=_update,
    inherit=nothing_inherited,
    from_manifest=nothing_saved,  # follows from the temperature
    part="heat",
)
