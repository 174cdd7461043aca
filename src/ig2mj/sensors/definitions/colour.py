"""`rgb`: the image of the agent's camera."""

from __future__ import annotations

import numpy as np
from jaxtyping import UInt8

from ig2mj.engine.view import Array
from ig2mj.sensors.base import Percept, Sensor, Setup, Space


def _space(setup: Setup) -> Space:
    return Space((setup.options.height, setup.options.width, 3), np.uint8, 0.0, 255.0)


def _read(setup: Setup, percept: Percept) -> UInt8[Array, "W Y X 3"]:
    assert percept.images is not None and percept.images.rgb is not None
    return percept.images.rgb[:, 0]


RGB = Sensor("rgb", "colour, row 0 on top", "camera", _space, _read, frozenset({"rgb"}))
