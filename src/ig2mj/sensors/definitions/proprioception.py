"""`proprioception`: the readings of the robot's own joints and hands (`Controller.proprioception`)."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from ig2mj.engine.view import Array
from ig2mj.sensors.base import Percept, Sensor, Setup, Space


def _space(setup: Setup) -> Space:
    return Space((len(setup.controller.proprioception_names),), np.float32, -np.inf, np.inf)


def _read(setup: Setup, percept: Percept) -> Float[Array, "W m"]:
    return setup.controller.proprioception(percept.view, percept.controller)


PROPRIOCEPTION = Sensor(
    "proprioception", "the robot of itself, by `proprioception_names`", "robot's base", _space, _read
)
