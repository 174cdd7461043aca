"""How a converted model looks when it is opened: sky, lights, cameras, what the free camera frames."""

from __future__ import annotations

import math

import mujoco
import numpy as np

from .description import RoomMaps
from .poses import quat_from_rotation

TOP_CAMERA = "top"
#: Eye height (m) and view angle (degrees) of the rooms' cameras: a look from a corner, over the furniture.
ROOM_CAMERA_HEIGHT, ROOM_CAMERA_FOVY = 2.1, 80.0
_TOP_FOVY = 45.0


def add_setting(spec: mujoco.MjSpec, low: np.ndarray, high: np.ndarray, rooms: RoomMaps | None) -> None:
    """Sky, lights, a camera from above, one per room, and the statistics that place the viewer's free camera.

    Args:
      low, high: [3] corners of what is to be seen.
    """
    centre, size = (low + high) / 2, np.maximum(high - low, 1e-3)
    extent = float(np.linalg.norm(size[:2])) / 2
    spec.stat.center, spec.stat.extent = centre, max(extent, 0.05)
    visual = spec.visual
    visual.headlight.ambient, visual.headlight.diffuse = (0.32, 0.32, 0.32), (0.35, 0.35, 0.35)
    visual.headlight.specular = (0.05, 0.05, 0.05)
    visual.global_.offwidth, visual.global_.offheight = 1920, 1080
    visual.global_.azimuth, visual.global_.elevation = 120, -50
    visual.quality.shadowsize = 4096
    visual.map.znear, visual.map.zfar = 0.005, 40.0
    visual.rgba.haze = (0.85, 0.90, 0.95, 1.0)
    sky = spec.add_texture(name="sky", type=mujoco.mjtTexture.mjTEXTURE_SKYBOX)
    sky.builtin = mujoco.mjtBuiltin.mjBUILTIN_GRADIENT
    sky.rgb1, sky.rgb2 = (0.72, 0.82, 0.93), (0.93, 0.95, 0.97)
    sky.width, sky.height = 256, 256
    _add_sun(spec, centre, high)
    _add_camera(spec, TOP_CAMERA, _above(centre, size), np.array([1.0, 0.0, 0.0, 0.0]), _TOP_FOVY)
    if rooms is not None:
        _add_room_cameras(spec, rooms)


def room_view(rooms: RoomMaps, index: int) -> tuple[np.ndarray, np.ndarray] | None:
    """Eye and target [3] for a look into a room from its farthest corner; None where the map has no pixel of it.

    Row is y, column is x, the world's origin is the map's centre (dataset_format.md 2.5).
    """
    rows, columns = np.nonzero(rooms.room_map == index + 1)
    if len(rows) == 0:
        return None
    middle = np.array(rooms.room_map.shape[::-1]) / 2
    points = (np.stack([columns, rows], axis=1) + 0.5 - middle) * rooms.resolution
    centroid = points.mean(axis=0)
    corner = points[np.argmax(np.linalg.norm(points - centroid, axis=1))]
    inward = centroid - corner
    step = min(0.35, float(np.linalg.norm(inward)) / 2) / max(float(np.linalg.norm(inward)), 1e-9)
    wanted = corner + step * inward
    eye = points[np.argmin(np.linalg.norm(points - wanted, axis=1))]
    return np.array([*eye, ROOM_CAMERA_HEIGHT]), np.array([*centroid, 0.7])


def _add_room_cameras(spec: mujoco.MjSpec, rooms: RoomMaps) -> None:
    for index, name in enumerate(rooms.names):
        view = room_view(rooms, index)
        if view is not None:
            _add_camera(spec, name, view[0], _look_at(*view), ROOM_CAMERA_FOVY)


def _add_camera(spec: mujoco.MjSpec, name: str, pos: np.ndarray, quat: np.ndarray, fovy: float) -> None:
    camera = spec.worldbody.add_camera(name=name)
    camera.pos, camera.quat, camera.fovy = pos, quat, fovy


def _add_sun(spec: mujoco.MjSpec, centre: np.ndarray, high: np.ndarray) -> None:
    sun = spec.worldbody.add_light(name="sun")
    sun.type = mujoco.mjtLightType.mjLIGHT_DIRECTIONAL
    sun.pos = (centre[0], centre[1], high[2] + 5.0)
    sun.dir = (0.25, 0.35, -0.9)
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
