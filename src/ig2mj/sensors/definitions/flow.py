"""`optical_flow` and `scene_flow`: how what is seen moved since the last reading.

Each pixel's point is carried back to where its body was, and seen by the camera where that was. At the first reading of
an episode, and where nothing is seen, flow is 0; drops of water count as at rest.
"""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from ig2mj.engine.view import Array
from ig2mj.geometry.poses import inverse_transform_points, quat_rotate, quat_rotate_inverse, transform_points
from ig2mj.sensors.base import Percept, Sensor, Setup, Space
from ig2mj.sensors.labels import looked_up
from ig2mj.sensors.pinhole import normalized_coordinates, points

MOST = 2.0
"""Range of optical flow: from one edge of the image to the other."""


def _points(setup: Setup, percept: Percept) -> tuple[Float[Array, "W Y X 3"], Float[Array, "W Y X 3"]]:
    """What is seen in the camera's frame: now, and at the last reading in that camera's frame."""
    images, before, view = percept.images, percept.before, percept.view
    assert images is not None and images.depth is not None and images.geom is not None and images.slots is not None
    assert before is not None and percept.eye is not None
    now = points(setup, images.depth[:, 0])
    worlds, shape = now.shape[0], now.shape
    body = looked_up(images.geom[:, 0], np.asarray(setup.scene.model.geom_bodyid), images.slots.body, 0)
    body = body.reshape(worlds, -1, 1)
    world = transform_points(*percept.eye, now.reshape(worlds, -1, 3))

    def of(field: Array) -> Array:
        return jnp.take_along_axis(jnp.asarray(field), body, axis=1)

    own = quat_rotate_inverse(of(view.body_quat), world - of(view.body_pos))
    earlier = quat_rotate(of(before.body_quat), own) + of(before.body_pos)
    return now, inverse_transform_points(before.eye_pos, before.eye_quat, earlier).reshape(shape)


def _where_seen(percept: Percept, flow: Float[Array, "W Y X d"]) -> Float[Array, "W Y X d"]:
    assert percept.images is not None and percept.images.depth is not None
    return jnp.where((jnp.asarray(percept.images.depth[:, 0]) > 0)[..., None], flow, 0.0)


def _optical(setup: Setup, percept: Percept) -> Float[Array, "W Y X 2"]:
    """Change of the normalized coordinates: (1, 0) is half the image's width to the right, (0, 1) half up."""
    now, earlier = _points(setup, percept)
    flow = normalized_coordinates(setup, now) - normalized_coordinates(setup, earlier)
    return jnp.clip(_where_seen(percept, flow), -MOST, MOST)


def _scene(setup: Setup, percept: Percept) -> Float[Array, "W Y X 3"]:
    """Change of the point in the camera's frame, m."""
    now, earlier = _points(setup, percept)
    return _where_seen(percept, now - earlier)


def _space(channels: int, most: float):
    return lambda setup: Space((setup.options.height, setup.options.width, channels), np.float32, -most, most)


_NEEDS = frozenset({"depth", "segmentation"})
OPTICAL_FLOW = Sensor(
    "optical_flow", "motion since the last reading, halves of the image", "image (x right, y up)",
    _space(2, MOST), _optical, _NEEDS, remembers=True,
)  # fmt: skip
SCENE_FLOW = Sensor(
    "scene_flow", "motion since the last reading, m", "camera (x right, y up, -z ahead)",
    _space(3, np.inf), _scene, _NEEDS, remembers=True,
)  # fmt: skip
