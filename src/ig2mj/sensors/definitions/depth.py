"""`depth`: metres along the camera's axis (not along the ray, as in iGibson)."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from ig2mj.engine.view import Array
from ig2mj.sensors.base import Percept, Sensor, Setup, Space
from ig2mj.sensors.dropout import dropout


def _space(setup: Setup) -> Space:
    return Space((setup.options.height, setup.options.width, 1), np.float32, 0.0, setup.options.depth_high)


def _read(setup: Setup, percept: Percept) -> Float[Array, "W Y X 1"]:
    """0 where nothing is seen between `depth_low` and `depth_high`, and where a reading drops out."""
    assert percept.images is not None and percept.images.depth is not None
    options, depth = setup.options, jnp.asarray(percept.images.depth[:, 0])
    depth = jnp.where((depth >= options.depth_low) & (depth <= options.depth_high), depth, 0.0)
    return dropout(percept.keys, "depth", depth, options.depth_noise_rate, 0.0)[..., None]


DEPTH = Sensor("depth", "metres along the optical axis, 0 for none", "camera", _space, _read, frozenset({"depth"}))
