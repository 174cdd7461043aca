"""Cameras of an agent and its scene: their names in observations, and where each is.

    rgb                  the sensor `rgb` of the camera `head`
    right_wrist/depth    the sensor `depth` of the right hand's camera
    room/rgb             of the camera of the room that the robot's base is in
    top/rgb              of the scene's camera with this name in MJCF

| camera | what it is on |
|---|---|
| `head` | the robot's own camera (`AgentEntry.camera`); also the one without a name |
| `right_wrist`, `left_wrist` | hands (`AgentEntry.wrist_cameras`); that of a single hand is `right_wrist` |
| `room` | the ceiling: each room of a converted home has a camera of the room's name |

Axes: W worlds, N rooms with a camera.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float, Int

from ig2mj.agents.base import Controller
from ig2mj.agents.wrist_cameras import WRISTS
from ig2mj.engine.view import Array, PhysicsView
from ig2mj.errors import EngineError, UnknownNameError
from ig2mj.geometry.poses import compose
from ig2mj.scene.scene import Scene
from ig2mj.sensors.images import Pose

HEAD, ROOM = "head", "room"

PARTED = "/"
"""Between the names of a camera and of a sensor."""


def split_name(name: str) -> tuple[str, str]:
    """Camera and sensor of an observation's name; the camera is `HEAD` where it names none."""
    camera, parted, sensor = name.rpartition(PARTED)
    return (camera, sensor) if parted else (HEAD, name)


def camera_names(scene: Scene, agent: int = 0) -> tuple[str, ...]:
    """Cameras that observations of an agent can name: those of the module's text, then all of the scene's MJCF."""
    entry = scene.manifest.agents[agent]
    own = (HEAD,) * (entry.camera is not None) + tuple(entry.wrist_cameras)
    room = (ROOM,) * bool(_room_cameras(scene)[0])
    return (*own, *room, *(scene.model.camera(k).name for k in range(scene.model.ncam)))


@dataclasses.dataclass(frozen=True, eq=False)
class CameraView:
    """One camera of an agent or its scene.

    Attributes:
      name: in observations. camera: in the model. fovy: rad, vertical field of view.
      pose: in the world, from the view and what the agent's controller remembers; pure.
      placed: that pose is given to what makes images; otherwise the camera rides on its body.
    """

    name: str
    camera: str
    fovy: float
    pose: Callable[[PhysicsView, Any], Pose]
    placed: bool


def camera_view(scene: Scene, controller: Controller, agent: int, name: str) -> CameraView:
    """The camera of a name.

    Raises:
      EngineError: the robot has no such camera, or the scene no cameras of rooms. UnknownNameError: the scene has no
        camera of this name.
    """
    entry = scene.manifest.agents[agent]
    if name == HEAD:
        if not entry.camera:
            raise EngineError(f"the robot '{entry.name}' has no camera")
        return CameraView(name, entry.camera, _fovy(scene, entry.camera), controller.eye, True)
    if name in WRISTS:
        if name not in entry.wrist_cameras:
            known = ", ".join(entry.wrist_cameras) or "none on a hand"
            raise EngineError(f"the robot '{entry.name}' has no camera '{name}' (it has {known})")
        return _riding(scene, name, entry.wrist_cameras[name])
    if name == ROOM:
        cameras, cells = _room_cameras(scene)
        if not cameras:
            raise EngineError(f"scene '{scene.name}' has no cameras of rooms: it has no map of rooms, or none is named")
        return CameraView(name, cameras[0], _fovy(scene, cameras[0]), _of_rooms(scene, agent, cameras, cells), True)
    known = camera_names(scene, agent)
    if name not in known:
        raise UnknownNameError("camera", name, known)
    return _riding(scene, name, name)


def check_cameras(
    observations: Sequence[str], sized: Iterable[str], scene: Scene, controller: Controller, agent: int = 0
) -> None:
    """Whether an agent and its scene have the cameras that observations name, and those of `sized`.

    Raises:
      EngineError, UnknownNameError: as of `camera_view`.
    """
    named = [name.rpartition(PARTED)[0] for name in observations if PARTED in name]
    for name in dict.fromkeys((*named, *sized)):
        camera_view(scene, controller, agent, name)


def _fovy(scene: Scene, camera: str) -> float:
    return float(np.deg2rad(scene.model.cam_fovy[scene.model.camera(camera).id]))


def _riding(scene: Scene, name: str, camera: str) -> CameraView:
    """A camera at its compiled pose on its body."""
    model = scene.model
    number = model.camera(camera).id
    body = int(model.cam_bodyid[number])
    pos, quat = (jnp.asarray(a[number], jnp.float32) for a in (model.cam_pos, model.cam_quat))

    def pose(view: PhysicsView, remembered: Any) -> Pose:
        at, turn = jnp.asarray(view.body_pos)[:, body], jnp.asarray(view.body_quat)[:, body]
        return compose(at, turn, jnp.broadcast_to(pos, at.shape), jnp.broadcast_to(quat, turn.shape))

    return CameraView(name, camera, _fovy(scene, camera), pose, False)


def _room_cameras(scene: Scene) -> tuple[tuple[str, ...], Int[np.ndarray, "n n"]]:
    """Names of cameras on the world that have the name of a room, and for each cell of the map of rooms the number of
    the one that shows it: its room's, or in walls and rooms without one that of the nearest room with one."""
    rooms, model = scene.rooms, scene.model
    known = {model.camera(k).name for k in range(model.ncam) if model.cam_bodyid[k] == 0}
    names = () if rooms is None else tuple(name for name in rooms.names if name in known)
    if rooms is None or not names:
        return (), np.zeros((1, 1), np.int32)
    number = np.array([-1, *(names.index(name) if name in names else -1 for name in rooms.names)], np.int32)
    return names, _spread(number[rooms.room_map])


def _spread(cells: Int[np.ndarray, "n n"]) -> Int[np.ndarray, "n n"]:
    """Numbers of cells, -1 replaced by that of the nearest cell with one, by steps along the axes."""
    found = cells.copy()
    while (found < 0).any() and (found >= 0).any():
        before = found.copy()
        for axis in (0, 1):
            for way in (1, -1):
                near = np.roll(before, way, axis)
                edge = (slice(None),) * axis + (0 if way == 1 else -1,)
                near[edge] = -1
                found = np.where(found < 0, near, found)
    return found


def _of_rooms(
    scene: Scene, agent: int, cameras: tuple[str, ...], cells: Int[np.ndarray, "n n"]
) -> Callable[[PhysicsView, Any], tuple[Float[Array, "W 3"], Float[Array, "W 4"]]]:
    """The pose of the camera of the room that the agent's base is in."""
    model, rooms = scene.model, scene.rooms
    assert rooms is not None
    numbers = [model.camera(name).id for name in cameras]
    pos, quat = (jnp.asarray(a[numbers], jnp.float32) for a in (model.cam_pos, model.cam_quat))
    side, table = len(cells), jnp.asarray(cells)

    def pose(view: PhysicsView, remembered: Any) -> Pose:
        base = jnp.nan_to_num(jnp.asarray(view.agent.base_pos)[:, agent, :2])
        cell = jnp.clip(base / rooms.resolution + side / 2, 0, side - 1).astype(jnp.int32)
        room = table[cell[:, 1], cell[:, 0]]
        return pos[room], quat[room]

    return pose
