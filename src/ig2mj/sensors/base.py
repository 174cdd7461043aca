"""What a sensor is: a name, the space of its readings, and a pure function that makes them.

Axes: W worlds, B bodies, N rays of a pattern.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from flax import struct
from jaxtyping import Float, UInt32

from ig2mj.agents.base import Controller
from ig2mj.engine.view import Array, PhysicsView
from ig2mj.errors import EngineError, UnknownNameError
from ig2mj.process.deprecation import warn_renamed
from ig2mj.scene.scene import LOOKS, PLAIN, Scene, check_looks
from ig2mj.sensors.cameras import HEAD, CameraView, camera_view
from ig2mj.sensors.images import Images, Pose, RayPattern
from ig2mj.states.model import StateModel
from ig2mj.states.world import ExtendedStates


@dataclasses.dataclass(frozen=True)
class Space:
    """Shape (without the world axis), type and range of an observation or an action."""

    shape: tuple[int, ...]
    dtype: type
    low: float
    high: float


CAMERA_LOOKS = PLAIN
"""How robots' cameras see homes unless asked otherwise: what the policies that ship were trained with."""


@dataclasses.dataclass(frozen=True)
class SensorOptions:
    """Settings of all sensors; the defaults are the paper's camera and iGibson's laser.

    Attributes:
      width, height: pixels of all images.
      depth_low, depth_high: m; depths outside read 0.
      depth_noise_rate, scan_noise_rate: probability that a reading drops out: depths become 0, a scan's rays 1.
      scan_rays: of the laser scan, over `scan_angle` degrees. scan_near, scan_far: m, its range.
      grid_size: cells of the occupancy grid along an edge, which is `grid_range` metres long.
      footprint: m, radius of the robot in the occupancy grid.
      lidar_beams: of the lidar, from 15 degrees below its horizon to 15 above. lidar_columns: rays of a beam in a
        quarter turn. lidar_near, lidar_far: m, its range; nearer is the robot's own head.
      particles: the most particles of dust, stains and water that an image shows, and the most spots of substances
        besides; 0: images show none of these, no contents, streams and flames.
      rows: the first row of images that is rendered, and the first below those; pixels of other rows read as if
        nothing were there, and cost nothing on a GPU. None: all rows.
      shadows: whether images have them; they cost six times the rest on the native engine, twice on a GPU.
      looks: how images show the home: one of `ig2mj.scene.scene.LOOKS`. Policies that see images were trained with
        `CAMERA_LOOKS`.
      cameras: width and height, or one number for both, of the images of cameras that have another size, by the
        camera's name (`ig2mj.sensors.cameras`); `rows` are of the camera `head` only.
    """

    width: int = 128
    height: int = 128
    depth_low: float | int = 0.0
    depth_high: float | int = 10.0
    depth_noise_rate: float | int = 0.0
    scan_noise_rate: float | int = 0.0
    scan_rays: int = 128
    scan_angle: float | int = 180.0
    scan_near: float | int = 0.05
    scan_far: float | int = 10.0
    grid_size: int = 128
    grid_range: float | int = 5.0
    footprint: float | int = 0.32
    lidar_beams: int = 16
    lidar_columns: int = 468
    lidar_near: float | int = 0.25
    lidar_far: float | int = 100.0
    particles: int = 64
    shadows: bool = False
    rows: tuple[int, int] | None = None
    looks: str = CAMERA_LOOKS
    cameras: Mapping[str, int | Sequence[int]] = dataclasses.field(default_factory=dict, hash=False)

    @classmethod
    def of(cls, values: Mapping[str, Any]) -> SensorOptions:
        """From the settings by name, as JSON has them. Raises EngineError: no such setting, or one of another type."""
        default = dataclasses.asdict(cls())
        for name, value in values.items():
            if name not in default:
                raise UnknownNameError("setting of sensors", name, default)
            kinds = _KINDS.get(name, (int, float))
            if not isinstance(value, kinds) or (isinstance(value, bool) and kinds is not bool):
                raise EngineError(f"sensors: {name} = {value!r}: {_TAKES.get(name, 'a number')} is needed")
        check_looks(values.get("looks", CAMERA_LOOKS))
        rows = values.get("rows")
        return cls(**{**values, "rows": rows if rows is None else tuple(rows)})

    def __post_init__(self) -> None:
        """Raises EngineError where a setting is out of range."""
        counts = ("width", "height", "scan_rays", "grid_size", "lidar_beams", "lidar_columns")
        small = [name for name in counts if getattr(self, name) < 1]
        if small:
            raise EngineError(f"{small[0]} = {getattr(self, small[0])}: at least 1 is needed")
        if self.particles < 0:
            raise EngineError(f"particles = {self.particles}: at least 0 is needed")
        for low, high in (("depth_low", "depth_high"), ("scan_near", "scan_far"), ("lidar_near", "lidar_far")):
            if not 0 <= getattr(self, low) < getattr(self, high):
                raise EngineError(f"{low} must be 0 or more, and less than {high}")
        for name in ("depth_noise_rate", "scan_noise_rate"):
            if not 0 <= getattr(self, name) <= 1:
                raise EngineError(f"{name} = {getattr(self, name)}: a probability is between 0 and 1")
        if not 0 < self.scan_angle <= 360:
            raise EngineError(f"scan_angle = {self.scan_angle}: between 0 and 360 degrees")
        object.__setattr__(self, "cameras", {name: _size(name, size) for name, size in self.cameras.items()})

    def of_camera(self, name: str) -> SensorOptions:
        """With `width` and `height` of a camera's images, and `rows` where they are its rows."""
        width, height = _size(name, self.cameras.get(name, (self.width, self.height)))
        return dataclasses.replace(self, width=width, height=height, rows=self.rows if name == HEAD else None)


_KINDS: dict[str, Any] = {"rows": (list, tuple, type(None)), "shadows": bool, "looks": str, "cameras": Mapping}
"""Of the values of settings that are no numbers."""

_TAKES = {
    "rows": "the first row and the first below the last",
    "shadows": "True or False",
    "looks": f"a look ({', '.join(LOOKS)})",
    "cameras": "a mapping of cameras to sizes of images",
}
"""What these settings take, for messages."""


def _size(camera: str, given: Any) -> tuple[int, int]:
    """Width and height of a camera's images. Raises EngineError: these are none."""
    size = (given, given) if isinstance(given, int) else given
    whole = isinstance(size, list | tuple) and len(size) == 2 and all(type(n) is int and n > 0 for n in size)
    if not whole:
        raise EngineError(f"cameras: '{camera}' = {given!r}: width and height in pixels, such as [320, 240]")
    return size[0], size[1]


@dataclasses.dataclass(frozen=True, eq=False)
class Setup:
    """Constants of an agent's sensors.

    Attributes:
      scene: with the agent. model: constants of the states. controller: of the agent, whose number is `agent`.
      options: of the camera `camera_name` (`SensorOptions.of_camera`), which is one of `ig2mj.sensors.cameras`.
    """

    scene: Scene
    model: StateModel
    controller: Controller
    options: SensorOptions
    agent: int = 0
    camera_name: str = HEAD

    @functools.cached_property
    def camera(self) -> CameraView:
        """The camera that is read. Raises as `camera_view`."""
        return camera_view(self.scene, self.controller, self.agent, self.camera_name)

    @property
    def laser(self) -> tuple[float, float, float]:
        """Where the agent's laser is in the frame of its base, m. Raises EngineError where it has none."""
        entry = self.scene.manifest.agents[self.agent]
        if entry.laser is None:
            raise EngineError(f"the robot '{entry.name}' has no laser scanner")
        return entry.laser

    @functools.cached_property
    def slopes(self) -> tuple[float, float]:
        """Half width and half height of the camera's view at distance 1."""
        up = float(np.tan(self.camera.fovy / 2))
        return up * self.options.width / self.options.height, up


@struct.dataclass
class SensorMemory:
    """Poses at the last reading, from which flow is computed. World frame, m and w-x-y-z.

    Attributes:
      eye_pos, eye_quat: of the camera. body_pos, body_quat: of all bodies.
      others: poses of further cameras whose flow is read, by name; those of one camera are what its sensors get.
    """

    eye_pos: Float[Array, "W 3"]
    eye_quat: Float[Array, "W 4"]
    body_pos: Float[Array, "W B 3"]
    body_quat: Float[Array, "W B 4"]
    others: dict[str, Pose] = dataclasses.field(default_factory=dict)


@struct.dataclass
class Percept:
    """What a reading is made of.

    Attributes:
      view, states, controller: of the present (the last is what the controller remembers).
      eye: pose of the camera that is read. images: of this camera alone; None where no sensor asked for any.
      before: None where no sensor asked for it. keys: of the randomness of each world's reading.
    """

    view: PhysicsView
    states: ExtendedStates
    controller: Any
    eye: Pose | None = None
    images: Images | None = None
    before: SensorMemory | None = None
    keys: UInt32[Array, "W 2"] | None = None


Read = Callable[[Setup, Percept], Array]


@dataclasses.dataclass(frozen=True)
class Sensor:
    """One kind of reading; made by the sensor's own file in `definitions`, listed in `registry`.

    Attributes:
      name: of the observation. summary: one line. frame: that its numbers are in.
      space: of its readings. read: makes them, [W, ...]; pure.
      images: what it needs of "rgb", "depth" and "segmentation".
      rays: the pattern it needs, if any. ray_pose: where that pattern is.
      remembers: it needs `Percept.before`.
    """

    name: str
    summary: str
    frame: str
    space: Callable[[Setup], Space]
    read: Read
    images: frozenset[str] = frozenset()
    rays: Callable[[Setup], RayPattern] | None = None
    ray_pose: Callable[[Setup, PhysicsView, Pose | None], Pose] | None = None
    remembers: bool = False

    @property
    def pictures(self) -> frozenset[str]:
        """Deprecated: `images`."""
        warn_renamed("Sensor.pictures", "Sensor.images")
        return self.images

    @property
    def looks(self) -> bool:
        """It needs the engine itself, not only the view: images or rays."""
        return bool(self.images) or self.rays is not None
