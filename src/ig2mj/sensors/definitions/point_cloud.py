"""`pc`: the points that the camera's pixels show."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from ig2mj.engine.view import Array
from ig2mj.sensors.base import Percept, Sensor, Setup, Space
from ig2mj.sensors.pinhole import points


def _space(setup: Setup) -> Space:
    return Space((setup.options.height, setup.options.width, 3), np.float32, -np.inf, np.inf)


def _read(setup: Setup, percept: Percept) -> Float[Array, "W Y X 3"]:
    assert percept.images is not None and percept.images.depth is not None
    return points(setup, percept.images.depth[:, 0])


POINT_CLOUD = Sensor(
    "pc", "point seen at each pixel, m; zeros for none", "camera (x right, y up, -z ahead)", _space, _read,
    frozenset({"depth"}),
)  # fmt: skip
