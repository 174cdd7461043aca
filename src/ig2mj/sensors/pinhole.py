"""Between pixels and points of a pinhole camera, and rigid motion of what its pixels show.

Camera axes are MuJoCo's: x right, y up, -z forward. Axes: W worlds, Y rows, X columns.
"""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from ig2mj.engine.view import Array
from ig2mj.sensors.base import Setup


def pixel_slopes(setup: Setup) -> Float[np.ndarray, "Y X 2"]:
    """Right and up of the pixels' centres, at distance 1 along the axis."""
    height, width = setup.options.height, setup.options.width
    right = setup.slopes[0] * (2 * (np.arange(width) + 0.5) / width - 1)
    up = setup.slopes[1] * (1 - 2 * (np.arange(height) + 0.5) / height)
    return np.stack(np.broadcast_arrays(right[None, :], up[:, None]), axis=-1).astype(np.float32)


def points(setup: Setup, depth: Float[Array, "W Y X"]) -> Float[Array, "W Y X 3"]:
    """What the pixels show, in the camera's frame, m; zeros where the depth is 0."""
    depth = jnp.asarray(depth)[..., None]
    return jnp.concatenate([pixel_slopes(setup) * depth, -depth], axis=-1)


def normalized_coordinates(setup: Setup, points: Float[Array, "*b 3"]) -> Float[Array, "*b 2"]:
    """Where points of the camera's frame appear: -1 to 1 from left to right and from bottom to top of the image."""
    ahead = jnp.maximum(-points[..., 2:], 1e-6)
    return points[..., :2] / (ahead * jnp.asarray(setup.slopes, jnp.float32))
