"""`normal`: orientations of the surfaces that are seen.

On a plane the inverse of depth is an affine function of the pixel's place, so that its differences between pixels give
the normal exactly. Differences are taken between pixels of one geom only, and on the side where they change less, which
keeps them off the edges of boxes. Both engines' images give the same normals; those are of faces, not smoothed.
"""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float, Int

from ig2mj.engine.view import Array
from ig2mj.geometry.poses import normalize
from ig2mj.sensors.base import Percept, Sensor, Setup, Space
from ig2mj.sensors.pinhole import pixel_slopes


def _space(setup: Setup) -> Space:
    return Space((setup.options.height, setup.options.width, 3), np.float32, 0.0, 1.0)


def _read(setup: Setup, percept: Percept) -> Float[Array, "W Y X 3"]:
    """(n + 1) / 2 of unit normals that point to the viewer's side; zeros where nothing is seen."""
    images = percept.images
    assert images is not None and images.depth is not None and images.geom is not None
    depth = jnp.asarray(images.depth[:, 0])
    normal = camera_normals(pixel_slopes(setup), depth, jnp.asarray(images.geom[:, 0]))
    return jnp.where((depth > 0)[..., None], jnp.clip((normal + 1) / 2, 0.0, 1.0), 0.0)


def camera_normals(
    slopes: Float[np.ndarray, "Y X 2"], depth: Float[Array, "W Y X"], geom: Int[Array, "W Y X"]
) -> Float[Array, "W Y X 3"]:
    """Unit normals in the camera's frame."""
    seen = depth > 0
    inverse = jnp.where(seen, 1.0 / jnp.where(seen, depth, 1.0), 0.0)
    step_x = float(slopes[0, 1, 0] - slopes[0, 0, 0]) if slopes.shape[1] > 1 else 1.0
    step_y = float(slopes[1, 0, 1] - slopes[0, 0, 1]) if slopes.shape[0] > 1 else 1.0
    along_x, found_x = _slope(inverse, geom, 2)
    along_y, found_y = _slope(inverse, geom, 1)
    x, y = along_x / step_x, along_y / step_y
    z = slopes[..., 0] * x + slopes[..., 1] * y - inverse
    normal = -jnp.stack([x, y, z], axis=-1)
    to_viewer = jnp.broadcast_to(jnp.concatenate([-slopes, np.ones_like(slopes[..., :1])], axis=-1), normal.shape)
    return normalize(jnp.where((found_x & found_y)[..., None], normal, to_viewer))


def _slope(
    values: Float[Array, "W Y X"], geom: Int[Array, "W Y X"], axis: int
) -> tuple[Float[Array, "W Y X"], Bool[Array, "W Y X"]]:
    """Difference to the next pixel along an axis, from the side on which it changes less; and whether there is one."""

    def shifted(array: Array, by: int) -> Array:
        """array[i + by]; what comes in from beyond the edge is never of the same geom."""
        return jnp.roll(array, -by, axis)

    size = values.shape[axis]
    place = jnp.arange(size).reshape([-1 if a == axis else 1 for a in range(3)])

    def same(by: int) -> Array:
        return (shifted(geom, by) == geom) & (place + by >= 0) & (place + by < size)

    ahead, behind = same(1), same(-1)
    forward, backward = shifted(values, 1) - values, values - shifted(values, -1)
    straight = 1e9  # stands for a side without a second pixel
    bend_ahead = jnp.where(same(2), jnp.abs(shifted(values, 2) - shifted(values, 1) - forward), straight)
    bend_behind = jnp.where(same(-2), jnp.abs(shifted(values, -1) - shifted(values, -2) - backward), straight)
    take_ahead = ahead & (~behind | (bend_ahead <= bend_behind))
    return jnp.where(take_ahead, forward, backward), ahead | behind


NORMAL = Sensor(
    "normal", "(n + 1) / 2 of unit normals, zeros for none", "camera (x right, y up, -z ahead)", _space, _read,
    frozenset({"depth", "segmentation"}),
)  # fmt: skip
