"""The free view from which a whole home is seen, without what is parked outside it."""

from __future__ import annotations

import mujoco
import numpy as np

from ig2mj.scene.scene import Scene
from ig2mj.viewer.offscreen import FreeView

#: Distance of the camera in radii of the home: what just fills an image with MuJoCo's vertical field of view of 45
#: degrees is 2.6; a home is flat and wider than high, and fills a wide image from nearer.
DISTANCE_IN_RADII = 1.8

ELEVATION = -68.0
"""Degrees: steep enough that a wall of 2.5 m hides one metre of the floor behind it."""


def home_overview(scene: Scene, data: mujoco.MjData, azimuth: float = 90.0, elevation: float = ELEVATION) -> FreeView:
    """A view that holds all collision geoms of objects in use; of the whole model where there are none.

    Args:
      data: state with up-to-date positions.
      azimuth, elevation: degrees, as in FreeView.
    """
    tables = scene.tables
    owner = tables.geom_object
    used = (owner >= 0) & (scene.model.geom_type != mujoco.mjtGeom.mjGEOM_PLANE)
    used[used] &= ~tables.object_parked[owner[used]]
    if not used.any():
        return FreeView.around(scene.model, azimuth, elevation)
    radius = scene.model.geom_rbound[used, None]
    low = np.min(data.geom_xpos[used] - radius, axis=0)
    high = np.max(data.geom_xpos[used] + radius, axis=0)
    if np.any(tables.object_is_floor):  # bounding spheres of floors and walls reach far out; floors tell the outline
        floors = np.flatnonzero(used & (owner >= 0) & tables.object_is_floor[np.maximum(owner, 0)])
        half = np.array([_world_half_size(scene.model, data, g) for g in floors.tolist()])
        low[:2] = np.min(data.geom_xpos[floors] - half, axis=0)[:2]
        high[:2] = np.max(data.geom_xpos[floors] + half, axis=0)[:2]
        low[2] = float(np.min((data.geom_xpos[floors] + half)[:, 2]))  # the surface of the lowest
        high[2] = min(high[2], low[2] + 3.0)  # one storey
    x, y, z = ((low + high) / 2).tolist()
    return FreeView((x, y, z), DISTANCE_IN_RADII * float(np.linalg.norm(high - low)) / 2, azimuth, elevation)


def _world_half_size(model: mujoco.MjModel, data: mujoco.MjData, geom: int) -> np.ndarray:
    """Half extent [3], world axes, of a geom's own box (MuJoCo's geom_aabb), turned with it."""
    rotation = data.geom_xmat[geom].reshape(3, 3)
    return np.abs(rotation) @ model.geom_aabb[geom, 3:] + np.abs(rotation @ model.geom_aabb[geom, :3])
