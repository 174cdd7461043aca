"""What a camera may see: view frusta against points and spheres.

Camera axes are MuJoCo's: -z forward, y up, x to the right. `fovy` is the vertical opening angle in radians, `aspect`
width over height; only what lies between the planes at `near` and `far` (metres, along the view) is in view. Surfaces
of the frustum belong to it. NaN is never in view.
"""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
from flax import struct
from jaxtyping import Array, Bool, Float

from ig2mj.geometry.poses import AnyArray, inverse_transform_points


@struct.dataclass
class Camera:
    """Cameras; leading axes are the batch (worlds, agents, ...).

    Attributes:
      pos, quat: pose of the eye in the world. fovy: radians. aspect: width over height. near, far: metres.
    """

    pos: Float[AnyArray, "*b 3"]
    quat: Float[AnyArray, "*b 4"]
    fovy: Float[AnyArray, "*#b"] | float
    aspect: Float[AnyArray, "*#b"] | float = 1.0
    near: Float[AnyArray, ""] | float = 0.01
    far: Float[AnyArray, ""] | float = 100.0

    @property
    def slopes(self) -> Float[Array, "*#b 2"]:
        """Half width and half height of the view at distance 1."""
        up = jnp.tan(0.5 * jnp.asarray(self.fovy))
        return jnp.stack(jnp.broadcast_arrays(up * self.aspect, up), axis=-1)


def points_in_frustum(camera: Camera, points: Float[AnyArray, "*#b n 3"]) -> Bool[Array, "*b n"]:
    """Which of `n` world points per camera are in view, hidden or not."""
    local = inverse_transform_points(camera.pos, camera.quat, points)
    depth = -local[..., 2]
    reach = camera.slopes[..., None, :] * depth[..., None]
    return (depth >= camera.near) & (depth <= camera.far) & jnp.all(jnp.abs(local[..., :2]) <= reach, axis=-1)


def spheres_in_view(
    centres: Float[np.ndarray, "*k n 3"],
    radius: Float[np.ndarray, "n"],
    left: float,
    right: float,
    down: float,
    up: float,
) -> Bool[np.ndarray, "n"]:
    """Which of `n` spheres a camera may see, in NumPy: those that are beyond none of the view's sides, nor behind.

    Args:
      centres: m, in the camera's axes. Where there are several for each sphere, it is all that lies between them.
      radius: m; 0, as of MuJoCo's planes: always in view.
      left, right, down, up: slopes of the view's sides; left and down are negative where the axis is in view.
    """
    x, y, z = np.moveaxis(centres, -1, 0)
    beyond = [
        (-x - left * z) / np.hypot(1.0, left),
        (x + right * z) / np.hypot(1.0, right),
        (-y - down * z) / np.hypot(1.0, down),
        (y + up * z) / np.hypot(1.0, up),
        z,
    ]
    nearest = np.reshape(beyond, (len(beyond), -1, centres.shape[-2])).min(1)
    return (nearest <= radius).all(0) | (np.asarray(radius) <= 0)
