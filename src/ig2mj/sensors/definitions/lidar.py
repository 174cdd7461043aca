"""`lidar`: sixteen beams all around the agent's camera.

iGibson takes the nearest pixels of four rendered images; here the rays themselves are cast. It drops points that are
not there; here they are zeros, so that all worlds have the same shape.
"""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from ig2mj.engine.view import Array, PhysicsView
from ig2mj.geometry.poses import quat_multiply
from ig2mj.sensors.base import Percept, Sensor, Setup, Space
from ig2mj.sensors.images import Pose, RayPattern

NAME = "lidar"

HIGHEST = 15.0
"""Degrees above and below the horizon of the highest and the lowest beam."""

FROM_CAMERA = (0.5, -0.5, 0.5, 0.5)
"""w-x-y-z: orientation of the lidar (x forward, z up) in the camera's frame (-z forward, y up)."""


def pattern(setup: Setup) -> RayPattern:
    """Beam after beam from the lowest on; in each to the left all around, from 45 degrees right of straight ahead."""
    options = setup.options
    elevation = np.deg2rad(np.linspace(-HIGHEST, HIGHEST, options.lidar_beams))[:, None]
    count = 4 * options.lidar_columns
    azimuth = np.deg2rad(-45.0 + 360.0 / count * np.arange(count))[None]
    level = np.cos(elevation)
    directions = np.stack(
        np.broadcast_arrays(level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)), axis=-1
    )
    return RayPattern(NAME, directions.reshape(-1, 3), options.lidar_near, options.lidar_far)


def pose(setup: Setup, view: PhysicsView, eye: Pose | None) -> Pose:
    """The camera's; the beams turn about its upward axis."""
    assert eye is not None
    return eye[0], quat_multiply(jnp.asarray(eye[1]), jnp.asarray(FROM_CAMERA, jnp.float32))


def _space(setup: Setup) -> Space:
    far = setup.options.lidar_far
    return Space((4 * setup.options.lidar_columns * setup.options.lidar_beams, 3), np.float32, -far, far)


def _read(setup: Setup, percept: Percept) -> Float[Array, "W N 3"]:
    """Points in m, x right, y forward, z up; zeros where nothing is hit."""
    assert percept.images is not None
    distance = jnp.asarray(percept.images.rays[NAME])[..., None]
    x, y, z = pattern(setup).directions.astype(np.float32).T
    return jnp.where(jnp.isfinite(distance), distance, 0.0) * np.stack([-y, x, z], axis=-1)


LIDAR = Sensor(
    NAME, "points around the camera, m; zeros for none", "camera (x right, y forward, z up)", _space, _read,
    rays=pattern, ray_pose=pose,
)  # fmt: skip
