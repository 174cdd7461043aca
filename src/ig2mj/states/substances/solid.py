"""Which contents of containers are frozen. Contents have the temperature of their container.

Axes: W worlds, C containers, U substances.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool

from ig2mj.engine.view import Array, PhysicsView
from ig2mj.states.model import StateModel
from ig2mj.states.spec import HeatStep, StateSpec, nothing_inherited, nothing_saved
from ig2mj.states.substances.model import of

if TYPE_CHECKING:
    from ig2mj.states.world import ExtendedStates


def _update(step: HeatStep) -> HeatStep:
    found = of(step.model)
    temperature = jnp.asarray(step.states.temperature)[:, found.containers.object]
    return step.having(solid=temperature[..., None] <= found.freeze)


def _initial(model: StateModel) -> dict[str, np.ndarray]:
    shape = (1, len(of(model).containers.object), len(of(model).names))
    return {"solid": np.zeros(shape, bool)}


def _get(model: StateModel, states: ExtendedStates, view: PhysicsView, obj: int, world: int) -> bool:
    row = of(model).containers.row_of(obj)
    if row is None:
        return False
    return bool(np.any(np.asarray(states.solid)[world, row] & (np.asarray(states.volume)[world, row] > 0)))


SPEC = StateSpec(
    name="solid",
    get=_get,
    abilities=None,
    fields={"solid": Bool[Array, "W C U"]},
    initial=_initial,
    update=_update,
    inherit=nothing_inherited,
    from_manifest=nothing_saved,  # follows from the temperature
    part="heat",
)
