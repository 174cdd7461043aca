"""How a converted model looks when it is opened: sky, lights, cameras, what the free camera frames."""

from __future__ import annotations

import math

import mujoco
import numpy as np
from scipy import ndimage

from ..base.description import RoomMaps
from ..base.transforms import quat_from_rotation

TOP_CAMERA = "top"
#: Eye height (m) and view angle (degrees) of the rooms' cameras: a look from a corner, over the furniture.
ROOM_CAMERA_HEIGHT, ROOM_CAMERA_FOVY = 2.1, 80.0
_TOP_FOVY = 45.0
_CLEARANCE = 0.3  # m, of a room's camera from walls and furniture


def add_setting(
    spec: mujoco.MjSpec, low: np.ndarray, high: np.ndarray, rooms: RoomMaps | None, *, distance: float = 1.3
) -> None:
    """Sky, lights, a camera from above, one per room, and the statistics that place the viewer's free camera.

    Args:
      low, high: [3] corners of what is to be seen.
      distance: how far off the free camera starts; 1.3 cuts a house's corners, 2 shows an object with air around it.
    """
    centre, size = (low + high) / 2, np.maximum(high - low, 1e-3)
    extent = max(float(np.linalg.norm(size)) / 2, 0.03)
    spec.stat.center, spec.stat.extent = centre, distance * extent
    visual = spec.visual
    visual.headlight.ambient, visual.headlight.diffuse = (0.32, 0.32, 0.32), (0.35, 0.35, 0.35)
    visual.headlight.specular = (0.05, 0.05, 0.05)
    visual.global_.offwidth, visual.global_.offheight = 1920, 1080
    visual.global_.azimuth, visual.global_.elevation = 120, -50
    visual.quality.shadowsize = 4096
    visual.map.znear, visual.map.zfar, visual.map.shadowclip = 0.005, 8.0, 1.3  # wider ranges speckle the shadows
    visual.rgba.haze = (0.85, 0.90, 0.95, 1.0)
    sky = spec.add_texture(name="sky", type=mujoco.mjtTexture.mjTEXTURE_SKYBOX)
    sky.builtin = mujoco.mjtBuiltin.mjBUILTIN_GRADIENT
    sky.rgb1, sky.rgb2 = (0.72, 0.82, 0.93), (0.93, 0.95, 0.97)
    sky.width, sky.height = 256, 256
    _add_sun(spec, centre, extent)
    _add_camera(spec, TOP_CAMERA, _above(centre, size), np.array([1.0, 0.0, 0.0, 0.0]), _TOP_FOVY)
    if rooms is not None:
        _add_room_cameras(spec, rooms)


def add_ground(spec: mujoco.MjSpec, like: mujoco.MjsDefault) -> None:
    """A checkered ground plane at z = 0 for an object that is shown alone; contacts as class `like` has them."""
    checker = spec.add_texture(name="ground", type=mujoco.mjtTexture.mjTEXTURE_2D, width=256, height=256)
    checker.builtin = mujoco.mjtBuiltin.mjBUILTIN_CHECKER
    checker.rgb1, checker.rgb2 = (0.80, 0.82, 0.84), (0.74, 0.76, 0.79)
    material = spec.add_material(name="ground", texrepeat=(4.0, 4.0), texuniform=True)
    material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = "ground"
    plane = spec.worldbody.add_geom(like)
    plane.name, plane.type, plane.material = "ground", mujoco.mjtGeom.mjGEOM_PLANE, "ground"
    plane.size, plane.group = (0.0, 0.0, 0.05), 0


def room_view(rooms: RoomMaps, index: int) -> tuple[np.ndarray, np.ndarray] | None:
    """Eye and target [3] for a look into a room: from the free floor farthest from its middle, towards its middle.

    None where the map has no pixel of the room. Row is y, column is x, the world's origin is the map's centre,
    as in iGibson's dataset.
    """
    points = _pixel_centres(rooms.room_map == index + 1, rooms.resolution)
    if len(points) == 0:
        return None
    centroid = points.mean(axis=0)
    free = points[_is_free(rooms, points)]
    stands = free if len(free) else points
    eye = stands[np.argmax(np.linalg.norm(stands - centroid, axis=1))]
    if np.allclose(eye, centroid):
        eye = centroid + 0.1
    return np.array([*eye, ROOM_CAMERA_HEIGHT]), np.array([*centroid, 0.7])


def _pixel_centres(mask: np.ndarray, resolution: float) -> np.ndarray:
    """World x, y of the true pixels of a square map, [n, 2], m."""
    rows, columns = np.nonzero(mask)
    return (np.stack([columns, rows], axis=1) + 0.5 - np.array(mask.shape[::-1]) / 2) * resolution


def _is_free(rooms: RoomMaps, points: np.ndarray) -> np.ndarray:
    """Which of the points [n, 2] lie on floor with nothing near; all, where there is no such map."""
    if rooms.traversable is None:
        return np.ones(len(points), dtype=bool)
    clear = ndimage.binary_erosion(rooms.traversable, iterations=max(1, round(_CLEARANCE / rooms.trav_resolution)))
    side = clear.shape[0]
    cells = np.clip((points / rooms.trav_resolution + side / 2).astype(int), 0, side - 1)
    return clear[cells[:, 1], cells[:, 0]]


def _add_room_cameras(spec: mujoco.MjSpec, rooms: RoomMaps) -> None:
    for index, name in enumerate(rooms.names):
        view = room_view(rooms, index)
        if view is not None:
            _add_camera(spec, name, view[0], _look_at(*view), ROOM_CAMERA_FOVY)


def _add_camera(spec: mujoco.MjSpec, name: str, pos: np.ndarray, quat: np.ndarray, fovy: float) -> None:
    camera = spec.worldbody.add_camera(name=name)
    camera.pos, camera.quat, camera.fovy = pos, quat, fovy


def _add_sun(spec: mujoco.MjSpec, centre: np.ndarray, extent: float) -> None:
    direction = np.array([0.25, 0.35, -0.9])
    sun = spec.worldbody.add_light(name="sun")
    sun.type = mujoco.mjtLightType.mjLIGHT_DIRECTIONAL
    sun.pos, sun.dir = centre - 1.3 * extent * direction, direction
    sun.diffuse, sun.ambient, sun.specular = (0.55, 0.54, 0.50), (0.0, 0.0, 0.0), (0.1, 0.1, 0.1)
    sun.castshadow = True


def _above(centre: np.ndarray, size: np.ndarray) -> np.ndarray:
    """Where a camera looking straight down, north up, sees all of it at an aspect of 4 to 3."""
    half = max(float(size[1]) / 2, float(size[0]) / 2 * 3 / 4)
    return np.array(
        [centre[0], centre[1], centre[2] + size[2] / 2 + 1.05 * half / math.tan(math.radians(_TOP_FOVY / 2))]
    )


def _look_at(eye: np.ndarray, target: np.ndarray) -> np.ndarray:
    """Quaternion (w, x, y, z) of a camera at `eye` with `target` in its middle, z up (MuJoCo: it looks along -z)."""
    back = (eye - target) / np.linalg.norm(eye - target)
    right = np.cross([0.0, 0.0, 1.0], back)
    norm = np.linalg.norm(right)
    right = right / norm if norm > 1e-6 else np.array([1.0, 0.0, 0.0])
    axes = np.stack([right, np.cross(back, right), back], axis=1)
    return quat_from_rotation(axes)
