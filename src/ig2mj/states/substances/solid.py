"""What follows from temperatures: which contents are frozen, and which transition rules it is warm enough for.

Contents have the temperature of their container. Both are latches that flow and rules read, so that these read no
temperature (`ig2mj.states.update.events`).

Axes: W worlds, C containers, U substances, D objects that can be covered, Q rules in use.
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
from ig2mj.states.substances.model import of

if TYPE_CHECKING:
    from ig2mj.states.world import ExtendedStates


def _update(step: HeatStep) -> HeatStep:
    found = of(step.model)
    temperature = jnp.asarray(step.states.temperature)
    least = np.array([rule.temperature for rule in found.rules], np.float32)
    return step.having(
        solid=temperature[:, found.containers.object, None] <= found.freeze,
        warm=temperature[:, found.covered, None] >= least,
    )


def _initial(model: StateModel) -> dict[str, np.ndarray]:
    shape = (1, len(of(model).containers.object), len(of(model).names))
    found = of(model)
    usual = np.array([rule.temperature <= AMBIENT_TEMPERATURE for rule in found.rules], bool)
    warm = np.broadcast_to(usual, (1, len(found.covered), len(found.rules))).copy()
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
    fields={"solid": Bool[Array, "W C U"], "warm": Bool[Array, "W D Q"]},
    initial=_initial,
    update=_update,
    inherit=nothing_inherited,
    from_manifest=nothing_saved,  # follows from the temperature
    part="heat",
)
