"""Controls looked at before they reach physics: their shape, and numbers that no actuator can mean."""

from __future__ import annotations

from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float

from ig2mj.engine.view import Array
from ig2mj.errors import EngineError

LARGEST = 1e6
"""Controls beyond this (m, rad, N, N m or their rates) are clipped. MuJoCo itself gives up all controls at 1e10."""


def check_shape(ctrl: Any, num_worlds: int, num_actuators: int) -> None:
    """Raises EngineError where controls are not [W, nu]; works while tracing."""
    found = tuple(np.shape(ctrl))
    if found != (num_worlds, num_actuators):
        worlds, actuators = ("" if n == 1 else "s" for n in (num_worlds, num_actuators))
        raise EngineError(
            f"controls have shape {found}, this engine takes ({num_worlds}, {num_actuators}): "
            f"{num_worlds} world{worlds} of {num_actuators} actuator{actuators}"
        )


def clip(ctrl: Float[Array, "W nu"], before: Float[Array, "W nu"]) -> tuple[Float[Array, "W nu"], Bool[Array, "W"]]:
    """Controls within `LARGEST`, and the worlds in which some were not. What is not a number stays as it was before."""
    xp: Any = np if isinstance(ctrl, np.ndarray) and isinstance(before, np.ndarray) else jnp
    fine = xp.abs(ctrl) <= LARGEST  # false for NaN, too
    kept = xp.where(xp.isnan(ctrl), before, xp.clip(ctrl, -LARGEST, LARGEST))
    return xp.where(fine, ctrl, kept), ~fine.all(-1)
