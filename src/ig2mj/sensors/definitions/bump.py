"""`bump`: whether the robot touches anything but floors."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from ig2mj.engine.view import Array
from ig2mj.sensors.base import Percept, Sensor, Setup, Space


def _read(setup: Setup, percept: Percept) -> Float[Array, "W 1"]:
    """1 while any part of it touches an object that is not a floor; what its hands hold counts, too."""
    touching = jnp.asarray(percept.view.agent.touching)[:, setup.agent]
    return (touching & ~setup.scene.tables.object_is_floor).any(-1, keepdims=True).astype(jnp.float32)


BUMP = Sensor(
    "bump", "1 while the robot touches anything but floors", "", lambda _: Space((1,), np.float32, 0.0, 1.0), _read
)
