"""`occupancy_grid`: the laser scan as a map about the robot.

iGibson draws it: discs of obstacles at the ends of the rays, over them the polygon of what the rays passed through,
over that the robot. The same rules are applied here to every cell. (iGibson draws obstacles at the ends of rays that
hit nothing, too.)
"""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float

from ig2mj.engine.view import Array
from ig2mj.sensors.base import Percept, Sensor, Setup, Space
from ig2mj.sensors.definitions import scan

OBSTACLE, UNKNOWN, FREE = 0.0, 0.5, 1.0
OBSTACLE_RADIUS = 2
"""Cells."""


def _space(setup: Setup) -> Space:
    return Space((setup.options.grid_size, setup.options.grid_size, 1), np.float32, OBSTACLE, FREE)


def cell_centres(setup: Setup) -> Float[np.ndarray, "G G 2"]:
    """Of each row and column, in the robot's frame, m: x forward is to the right, y left is up."""
    size, edge = setup.options.grid_size, setup.options.grid_range
    along = ((np.arange(size) + 0.5) / size - 0.5) * edge
    return np.stack(np.broadcast_arrays(along[None, :], -along[:, None]), axis=-1)


def _read(setup: Setup, percept: Percept) -> Float[Array, "W G G 1"]:
    options = setup.options
    distance = scan.distances(setup, percept)
    angle = scan.angles(setup)
    directions = np.stack([np.cos(angle), np.sin(angle)], axis=-1).astype(np.float32)
    reach = jnp.where(jnp.isfinite(distance), distance, options.scan_far)
    ends = reach[..., None] * directions  # in the laser's frame, as everything that follows
    cells = (cell_centres(setup) - np.array(setup.laser[:2])).astype(np.float32)
    grid = jnp.where(_near_hit(setup, distance, ends), OBSTACLE, UNKNOWN)
    grid = jnp.where(_passed(setup, cells, ends), FREE, grid)
    own = np.linalg.norm(cell_centres(setup), axis=-1) <= options.footprint
    return jnp.where(own, FREE, grid).astype(jnp.float32)[..., None]


def _near_hit(setup: Setup, distance: Float[Array, "W n"], ends: Float[Array, "W n 2"]) -> Bool[Array, "W G G"]:
    """Cells within `OBSTACLE_RADIUS` of the cell of an end that hit something."""
    size, edge = setup.options.grid_size, setup.options.grid_range
    spot = (ends + jnp.asarray(setup.laser[:2], jnp.float32)) / edge * size
    column = jnp.floor(size / 2 + spot[..., 0]).astype(jnp.int32)
    row = jnp.floor(size / 2 - spot[..., 1]).astype(jnp.int32)
    around = np.arange(-OBSTACLE_RADIUS, OBSTACLE_RADIUS + 1)
    disc = np.argwhere(np.add.outer(around**2, around**2) <= OBSTACLE_RADIUS**2) - OBSTACLE_RADIUS
    rows, columns = row[..., None] + disc[:, 0], column[..., None] + disc[:, 1]
    hit = jnp.isfinite(distance)[..., None] & (rows >= 0) & (columns >= 0)
    rows = jnp.where(hit, rows, size)  # out of range: dropped
    world = jnp.arange(len(ends))[:, None, None]
    return jnp.zeros((len(ends), size, size), bool).at[world, rows, columns].set(True, mode="drop")


def _passed(setup: Setup, cells: Float[np.ndarray, "G G 2"], ends: Float[Array, "W n 2"]) -> Bool[Array, "W G G"]:
    """Cells inside the polygon from the laser over the ends of all rays: each in the triangle of its two rays."""
    step = np.deg2rad(setup.options.scan_angle / setup.options.scan_rays)
    angle = np.arctan2(cells[..., 1], cells[..., 0])
    first = np.floor((angle + np.deg2rad(setup.options.scan_angle / 2)) / step).astype(int)
    between = (first >= 0) & (first < setup.options.scan_rays - 1)
    first = np.clip(first, 0, max(setup.options.scan_rays - 2, 0))
    here, there = ends[:, first], ends[:, np.minimum(first + 1, setup.options.scan_rays - 1)]
    edge, cell = there - here, cells - here
    return between & (edge[..., 0] * cell[..., 1] - edge[..., 1] * cell[..., 0] >= 0)


OCCUPANCY_GRID = Sensor(
    "occupancy_grid", "0 obstacle, 0.5 unknown, 1 free", "robot's base in the middle (x to the right, y up)",
    _space, _read, rays=scan.pattern, ray_pose=scan.pose,
)  # fmt: skip
