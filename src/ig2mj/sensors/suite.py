"""`SensorSuite`: some sensors of one agent, on any engine.

    sensors = SensorSuite(engine, scene, rules.model, controller, ["rgb", "depth", "scan"])
    readings, memory = sensors.read(physics, view, states, controller_state)

A name may begin with that of a camera (`right_wrist/rgb`; `ig2mj.sensors.cameras`). Sensors of images of the same size
share one renderer, which renders what they need and nothing else. Where the engine's physics can be traced, `read_fn`
may be part of a compiled program.

Axes: W worlds.
"""

from __future__ import annotations

import dataclasses
import importlib
from collections.abc import Collection, Sequence
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, UInt32

from ig2mj.agents.base import Controller
from ig2mj.engine.base import Engine, Physics
from ig2mj.engine.view import Array, PhysicsView
from ig2mj.errors import EngineError, PluginError
from ig2mj.geometry.poses import compose
from ig2mj.process import entry_point
from ig2mj.scene.scene import Scene
from ig2mj.sensors.base import Percept, Sensor, SensorMemory, SensorOptions, Setup, Space
from ig2mj.sensors.cameras import HEAD, CameraView, check_cameras, split_name
from ig2mj.sensors.images import Camera, Images, Pose, RayPattern
from ig2mj.sensors.registry import find_sensor
from ig2mj.states.model import StateModel
from ig2mj.states.world import ExtendedStates
from ig2mj.worlds.draw import Draw

Readings = dict[str, Array]

CAMERAS = {
    "opengl": "ig2mj.sensors.native_camera:NativeCamera",
    "ray caster": "ig2mj.sensors.batch_camera:BatchCamera",
}
"""By `Engine.renderer`: module and class of what makes images. A module is imported where images are made."""


OF_CAMERAS = ("rgb", "depth", "segmentation", "geom")
"""Fields of `Images` with an axis of cameras."""


@dataclasses.dataclass(frozen=True, eq=False)
class Channel:
    """One observation: a sensor of a camera."""

    name: str
    sensor: Sensor
    setup: Setup


@dataclasses.dataclass(frozen=True, eq=False)
class Renderer:
    """What makes images of one size.

    Attributes:
      numbers: of each camera among those of `camera`, by its name in observations. views: likewise.
    """

    camera: Camera
    numbers: dict[str, int]
    views: dict[str, CameraView]


@entry_point
class SensorSuite:
    """See the module's text.

    Attributes:
      spaces: of each sensor, without the world axis. options: of all of them.
    """

    def __init__(
        self,
        engine: Engine,
        scene: Scene,
        model: StateModel,
        controller: Controller,
        names: str | Sequence[str],
        options: SensorOptions | None = None,
        agent: int = 0,
        varied: Collection[str] = (),
    ):
        """Makes the camera that the sensors need.

        Args:
          engine: whose worlds are perceived. scene: theirs. model: constants of the states.
          controller: of the agent, which is number `agent` of the scene.
          names: of sensors (`ig2mj.sensors.registry.SENSORS`), those of images with or without a camera's name
            before them; or a single one.
          varied: axes of `ig2mj.Randomize` that are on; readings then take what was drawn.

        Raises:
          UnknownNameError: no such sensor or camera. EngineError: the robot lacks what a sensor needs, or the engine
            cannot make images (only "native" and "warp" can).
        """
        self.options = options or SensorOptions()
        given = (names,) if isinstance(names, str) else names
        self._channels = [self._channel(name, scene, model, controller, agent) for name in given]
        self._setup = Setup(scene, model, controller, self.options, agent)
        self.spaces: dict[str, Space] = {c.name: c.sensor.space(c.setup) for c in self._channels}
        self._varied = frozenset(varied) & {"lights", "camera"}
        self._felt = [c for c in self._channels if not c.sensor.looks]
        self._seen = [c for c in self._channels if c.sensor.looks]
        self._patterns = {}
        for channel in self._seen:
            if channel.sensor.rays is not None:
                pattern = channel.sensor.rays(channel.setup)
                self._patterns[pattern.name] = (pattern, channel.sensor.ray_pose)
        if "scan" in self._patterns:
            _ = self._setup.laser  # raises where there is none
        self._renderers = self._make_renderers(engine) if self._seen else []
        self._remembers = any(c.sensor.remembers for c in self._seen)
        self._poses, self._finish = engine.compile(self._poses_fn), engine.compile(self._finish_fn)
        self._feel, self._remember = engine.compile(self.feel_fn), engine.compile(self._memory)
        self._whole = engine.program(self.read_fn)

    def _channel(self, name: str, scene: Scene, model: StateModel, controller: Controller, agent: int) -> Channel:
        """What an observation's name asks for. Raises UnknownNameError, EngineError."""
        camera, sensor_name = split_name(name)
        sensor = find_sensor(sensor_name)
        if name != sensor_name and not sensor.images:
            fix = f"take '{sensor_name}'"
            raise EngineError(f"observation '{name}': the sensor '{sensor_name}' has no images of a camera ({fix})")
        return Channel(name, sensor, Setup(scene, model, controller, self.options.of_camera(camera), agent, camera))

    def _make_renderers(self, engine: Engine) -> list[Renderer]:
        """One for each size of images, the first of which casts the rays, too."""
        if engine.renderer not in CAMERAS:
            raise EngineError(
                f"the {engine.name} engine neither renders images nor casts rays (take 'native' or 'warp')"
            )
        own = self._setup
        check_cameras([c.name for c in self._seen], self.options.cameras, own.scene, own.controller, own.agent)
        sizes: dict[tuple[Any, ...], list[Channel]] = {}
        for channel in self._seen:
            options = channel.setup.options
            if channel.sensor.images:
                sizes.setdefault((options.width, options.height, options.rows), []).append(channel)
        patterns = [pattern for pattern, _ in self._patterns.values()]
        rays = [patterns, *[[]] * (len(sizes) - 1)]
        groups = list(sizes.values()) or [[]]
        return [self._make_renderer(engine, group, own) for group, own in zip(groups, rays, strict=True)]

    def _make_renderer(self, engine: Engine, channels: Sequence[Channel], rays: Sequence[RayPattern]) -> Renderer:
        options = channels[0].setup.options if channels else self.options
        requested = frozenset[str]().union(*(c.sensor.images for c in channels))
        settings: dict[str, Any] = {
            "width": options.width,
            "height": options.height,
            "particles": options.particles,
            "shadows": options.shadows,
            "rows": options.rows,
            "looks": options.looks,
            "rays": list(rays),
            **{name: name in requested for name in ("rgb", "depth", "segmentation")},
        }
        if self._varied:
            settings["varied"] = self._varied
        views = {c.setup.camera_name: c.setup.camera for c in channels}
        module, kind = CAMERAS[engine.renderer].split(":")
        cameras = list(dict.fromkeys(view.camera for view in views.values()))
        made = getattr(importlib.import_module(module), kind)(engine, self._setup.model, cameras, **settings)
        return Renderer(made, {name: cameras.index(view.camera) for name, view in views.items()}, views)

    def prepare_devices(self, devices: Sequence[Any]) -> None:
        """Allocates memory of cameras on other devices of this process, before programs for them are compiled."""
        for renderer in self._renderers:
            renderer.camera.prepare_devices(devices)

    @property
    def noisy(self) -> bool:
        """Readings need keys."""
        return self.options.depth_noise_rate > 0 or self.options.scan_noise_rate > 0

    @property
    def looks(self) -> bool:
        """Some sensor needs images or rays; the others are read from the view alone (`feel_fn`)."""
        return bool(self._renderers)

    # Readings.

    def read(
        self,
        physics: Physics,
        view: PhysicsView,
        states: ExtendedStates,
        controller: Any,
        memory: SensorMemory | None = None,
        keys: UInt32[Array, "W 2"] | None = None,
        draw: Draw | None = None,
    ) -> tuple[Readings, SensorMemory | None]:
        """Readings of all sensors, compiled where that helps.

        Args:
          controller: what the agent's controller remembers.
          memory: as returned by the last call; None at the first reading of all worlds.
          keys: of the noise of this reading, of each world; only needed where there is noise.
          draw: of the worlds' episodes, where something is drawn for them.

        Returns:
          Readings by name, [W, ...] each; and what the next reading needs to know of this one.
        """
        return self._whole(physics, view, states, controller, memory, keys, draw)

    def read_fn(
        self,
        physics: Physics,
        view: PhysicsView,
        states: ExtendedStates,
        controller: Any,
        memory: SensorMemory | None = None,
        keys: UInt32[Array, "W 2"] | None = None,
        draw: Draw | None = None,
    ) -> tuple[Readings, SensorMemory | None]:
        """`read`, not compiled."""
        seen, memory = self.look_fn(physics, view, states, controller, memory, keys, draw=draw)
        felt = self._feel(view, states, controller) if self._felt else {}
        return {name: {**felt, **seen}[name] for name in self.spaces}, memory

    def feel_fn(self, view: PhysicsView, states: ExtendedStates, controller: Any) -> Readings:
        """Readings of the sensors that need the view only. Pure on every engine, not compiled."""
        percept = Percept(view, states, controller)
        return {c.name: self._read(c, percept) for c in self._felt}

    def look_fn(
        self,
        physics: Physics,
        view: PhysicsView,
        states: ExtendedStates,
        controller: Any,
        memory: SensorMemory | None = None,
        keys: UInt32[Array, "W 2"] | None = None,
        rendered: Bool[Array, "W"] | None = None,
        draw: Draw | None = None,
    ) -> tuple[Readings, SensorMemory | None]:
        """Readings of the sensors that need images or rays; see `read`.

        Args:
          rendered: the worlds whose readings matter; None: all.
        """
        if not self._renderers:
            return {}, None
        draw = draw if draw is not None and self._varied else Draw()
        eyes, poses = self._poses(view, controller, draw)
        images = [renderer.camera(physics, view, states, poses, rendered, draw) for renderer in self._renderers]
        return self._finish(view, states, controller, eyes, images, memory, keys)

    # Memory.

    def memory(self, view: PhysicsView, controller: Any) -> SensorMemory | None:
        """As after a reading of these worlds; None where no sensor needs one."""
        return self._remember(view, controller) if self._remembers else None

    def _memory(self, view: PhysicsView, controller: Any) -> SensorMemory:
        cameras = {c.setup.camera_name: c.setup.camera for c in self._seen if c.sensor.remembers}
        head = cameras.pop(HEAD, None) or next(iter(cameras.values()))
        others = {name: camera.pose(view, controller) for name, camera in cameras.items()}
        return SensorMemory(
            *head.pose(view, controller), jnp.asarray(view.body_pos), jnp.asarray(view.body_quat), others
        )

    def _poses_fn(self, view: PhysicsView, controller: Any, draw: Draw) -> tuple[dict[str, Pose], dict[str, Pose]]:
        """Of all cameras that are read, by their names in observations; and of everything that renderers are to be
        called with, by the names of the model's cameras and of patterns of rays."""
        eyes: dict[str, Pose] = {}
        poses: dict[str, Pose] = {}
        for renderer in self._renderers:
            for name, camera in renderer.views.items():
                eyes[name] = _displaced(camera.pose(view, controller), draw)
                if camera.placed or draw.camera_pos is not None:
                    poses[camera.camera] = eyes[name]
        if self._patterns and HEAD not in eyes and self._setup.scene.manifest.agents[self._setup.agent].camera:
            eyes[HEAD] = _displaced(self._setup.controller.eye(view, controller), draw)
        for name, (_, pose) in self._patterns.items():
            poses[name] = pose(self._setup, view, eyes.get(HEAD))
        return eyes, poses

    def _finish_fn(
        self,
        view: PhysicsView,
        states: ExtendedStates,
        controller: Any,
        eyes: dict[str, Pose],
        images: Sequence[Images],
        memory: SensorMemory | None,
        keys: UInt32[Array, "W 2"] | None,
    ) -> tuple[Readings, SensorMemory | None]:
        """Readings from images."""
        now = self._memory(view, controller) if self._remembers else None
        before, found = now if memory is None else memory, {}
        for channel in self._seen:
            name = channel.setup.camera_name
            seen = _of_camera(self._renderers, images, name)
            own = before
            if before is not None and name in before.others:
                pos, quat = before.others[name]
                own = dataclasses.replace(before, eye_pos=pos, eye_quat=quat)
            percept = Percept(view, states, controller, eyes.get(name), seen, own, keys)
            found[channel.name] = _finite(self._read(channel, percept))
        return found, now

    def _read(self, channel: Channel, percept: Percept) -> Array:
        """A reading. Raises PluginError: it has another shape or type than the sensor's space."""
        sensor, space = channel.sensor, self.spaces[channel.name]
        reading = sensor.read(channel.setup, percept)
        shape, dtype = tuple(np.shape(reading)), jnp.result_type(reading)
        if not shape or shape[1:] != tuple(space.shape) or dtype != space.dtype:
            requested = ", ".join(["W", *map(str, space.shape)])
            raise PluginError(
                f"sensor '{sensor.name}' gives {dtype}{list(shape)}; its space is {np.dtype(space.dtype)}[{requested}]"
            )
        return reading


def _displaced(pose: Pose, draw: Draw) -> Pose:
    """The pose of a camera with what was drawn of the worlds' cameras."""
    pos, quat = jnp.asarray(pose[0]), jnp.asarray(pose[1])
    if draw.camera_pos is None or draw.camera_quat is None:
        return pos, quat
    return compose(pos, quat, jnp.asarray(draw.camera_pos), jnp.asarray(draw.camera_quat))


def _of_camera(renderers: Sequence[Renderer], images: Sequence[Images], name: str) -> Images:
    """The images of one camera, with all rays; of the first renderer where none has the camera."""
    rays = images[0].rays
    for renderer, made in zip(renderers, images, strict=True):
        if name in renderer.numbers:
            k = renderer.numbers[name]
            one = {f: a[:, k : k + 1] for f in OF_CAMERAS if (a := getattr(made, f)) is not None}
            return dataclasses.replace(made, rays=rays, **one)
    return images[0]


def _finite(reading: Array) -> Array:
    """A reading in which numbers that are not finite, of worlds that broke, are 0."""
    reading = jnp.asarray(reading)
    if not jnp.issubdtype(reading.dtype, jnp.floating):
        return reading
    return jnp.where(jnp.isfinite(reading), reading, 0.0)
