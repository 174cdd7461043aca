"""`scan`: a laser that turns about the vertical of the robot's base."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from ig2mj.engine.view import Array, PhysicsView
from ig2mj.geometry.poses import quat_rotate
from ig2mj.sensors.base import Percept, Sensor, Setup, Space
from ig2mj.sensors.dropout import dropout
from ig2mj.sensors.images import Pose, RayPattern

NAME = "scan"


def angles(setup: Setup) -> Float[np.ndarray, "n"]:
    """rad from straight ahead, to the left: from minus half the angle on, the other end not reached."""
    options = setup.options
    return np.deg2rad(-options.scan_angle / 2 + options.scan_angle / options.scan_rays * np.arange(options.scan_rays))


def pattern(setup: Setup) -> RayPattern:
    """Of the scan, in the frame of the laser."""
    at = angles(setup)
    directions = np.stack([np.cos(at), np.sin(at), np.zeros_like(at)], axis=-1)
    return RayPattern(NAME, directions, setup.options.scan_near, setup.options.scan_far)


def pose(setup: Setup, view: PhysicsView, eye: Pose | None) -> Pose:
    """Of the laser: on the base, turned as the base is."""
    pos, quat = (jnp.asarray(a)[:, setup.agent] for a in (view.agent.base_pos, view.agent.base_quat))
    return pos + quat_rotate(quat, jnp.asarray(setup.laser, jnp.float32)), quat


def distances(setup: Setup, percept: Percept) -> Float[Array, "W n"]:
    """m from the laser; infinite where nothing is in range."""
    assert percept.images is not None
    return jnp.asarray(percept.images.rays[NAME])


def _space(setup: Setup) -> Space:
    return Space((setup.options.scan_rays, 1), np.float32, 0.0, 1.0)


def _read(setup: Setup, percept: Percept) -> Float[Array, "W n 1"]:
    """Share of the way from nearest to farthest range; 1 where nothing is hit, and where a reading drops out."""
    options = setup.options
    share = (distances(setup, percept) - options.scan_near) / (options.scan_far - options.scan_near)
    return dropout(percept.keys, NAME, jnp.clip(share, 0.0, 1.0), options.scan_noise_rate, 1.0)[..., None]


SCAN = Sensor(
    NAME, "share of the range to what each ray hits, 1 for none; from right to left", "laser", _space, _read,
    rays=pattern, ray_pose=pose,
)  # fmt: skip
