"""Rays in any direction from cameras of the ray caster: a pattern is cut into sectors of a quarter turn, and each
sector is a camera one pixel high whose rays are those of the pattern.

So all rays, and the images, are cast by one program over one hierarchy of boxes. MuJoCo Warp keeps the rays of its
cameras in an array of the render context and reports depths along the optical axis; within a sector the cosine between
ray and axis is known and is at least 0.5 for rays up to 45 degrees above or below the horizon.

Axes: N rays of a pattern, M rays of a sector.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

import jax.numpy as jnp
import mujoco
import numpy as np
import warp as wp
from jaxtyping import Float, Int
from mujoco.mjx.third_party.mujoco_warp._src import render_util

from ig2mj.engine.view import Array
from ig2mj.geometry.poses import quat_multiply
from ig2mj.sensors.images import Pose, RayPattern

QUARTERS = 4

TO_CAMERA = (0.5, 0.5, -0.5, -0.5)
"""w-x-y-z: orientation of a camera (-z forward, y up) in the frame of a sensor that looks along x, z up."""


@dataclasses.dataclass(frozen=True, eq=False)
class Sector:
    """The rays of a pattern within 45 degrees of one of the directions forward, left, back, right.

    Attributes:
      camera: name in the render model. pattern: name. turn: w-x-y-z, of the camera in the pattern's frame.
      rays: their places in the pattern. directions: unit, in the camera's frame. near, far: of the pattern, m.
    """

    camera: str
    pattern: str
    turn: Float[np.ndarray, "4"]
    rays: Int[np.ndarray, "M"]
    directions: Float[np.ndarray, "M 3"]
    near: float
    far: float

    def pose(self, eyes: dict[str, Pose]) -> Pose:
        """Of its camera, where its pattern has the pose that `eyes` gives."""
        pos, quat = eyes[self.pattern]
        return pos, quat_multiply(jnp.asarray(quat), jnp.asarray(self.turn, jnp.float32))

    def distances(self, depth: Float[Array, "W M"]) -> Float[Array, "W M"]:
        """m from the pattern's point, of depths along the camera's axis; infinite where nothing is hit in range."""
        distance = self.near + depth / jnp.asarray(-self.directions[:, 2], jnp.float32)
        return jnp.where((depth > 0.0) & (distance <= self.far), distance, jnp.inf)


def sectors_of(patterns: Sequence[RayPattern]) -> list[Sector]:
    """The sectors of some patterns that have rays, in their order."""
    found = []
    for pattern in patterns:
        x, y, z = pattern.directions.T
        quarter = np.round(np.arctan2(y, x) / (np.pi / 2)).astype(int) % QUARTERS
        for k in range(QUARTERS):
            rays = np.flatnonzero(quarter == k)
            if not len(rays):
                continue
            sin, cos = (0, 1, 0, -1)[k], (1, 0, -1, 0)[k]
            forward, left = cos * x[rays] + sin * y[rays], cos * y[rays] - sin * x[rays]
            half = k * np.pi / 4
            turn = np.asarray(quat_multiply(np.array([np.cos(half), 0, 0, np.sin(half)]), np.array(TO_CAMERA)))
            directions = np.stack([-left, z[rays], -forward], axis=-1)
            found.append(
                Sector(f"ig2mj/{pattern.name}_{k}", pattern.name, turn, rays, directions, pattern.near, pattern.far)
            )
    return found


def set_rays(context: Any, sectors: Sequence[Sector], first: int) -> None:
    """Puts the rays of the sectors into a render context (of `mjx.create_render_context`).

    Rays begin at their patterns' `near`; the context can displace their origins because it does so for orthographic
    cameras.

    Args:
      first: how many rays the images have, which come before them.
    """
    for own in context._contexts.values():
        rays, offsets = own.ray.numpy(), own.ray_offset.numpy()
        at = first
        for sector in sectors:
            rows = slice(at, at + len(sector.rays))
            rays[rows] = sector.directions
            offsets[rows] = sector.directions * sector.near
            at = rows.stop
        assert at == len(rays)
        own.ray.assign(rays)
        own.ray_offset.assign(offsets)
        own.has_orthographic_camera = True


def set_rows(
    context: Any, host: mujoco.MjModel, cameras: Sequence[int], size: tuple[int, int], rows: tuple[int, int]
) -> None:
    """Lets the cameras of a render context, made with so few lines, show these rows of a larger image.

    Args:
      cameras: ids in the model, in the order of the context, which has their rays first.
      size: width and height of the whole image, pixels. rows: the first, and the first below those.
    """
    (width, height), znear = size, float(host.vis.map.znear * host.stat.extent)
    for own in context._contexts.values():
        rays = own.ray.numpy()
        for at, camera in enumerate(cameras):
            with wp.ScopedDevice(own.ray.device):
                whole, offsets = (wp.zeros(width * height, dtype=wp.vec3) for _ in range(2))
                lens = int(host.cam_projection[camera]), float(host.cam_fovy[camera])
                sensor, intrinsic = wp.vec2(*host.cam_sensorsize[camera]), wp.vec4(*host.cam_intrinsic[camera])
                inputs = [0, width, height, *lens, sensor, intrinsic, znear, 1, 0, 0]
                wp.launch(render_util._build_rays, dim=(width, height), inputs=inputs, outputs=[whole, offsets])
            shown = whole.numpy().reshape(height, width, 3)[slice(*rows)].reshape(-1, 3)
            rays[at * len(shown) : (at + 1) * len(shown)] = shown
        own.ray.assign(rays)
