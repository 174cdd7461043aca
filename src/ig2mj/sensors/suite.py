"""`SensorSuite`: some sensors of one agent, on any engine.

    sensors = SensorSuite(engine, scene, rules.model, controller, ["rgb", "depth", "scan"])
    readings, memory = sensors.read(physics, view, states, controller_state)

All of them share one camera, which renders what they need and nothing else. Where the engine's physics can be traced,
`read_fn` may be part of a compiled program.

Axes: W worlds.
"""

from __future__ import annotations

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
from ig2mj.sensors.base import Memory, Percept, Sensor, SensorOptions, Setup, Space
from ig2mj.sensors.images import Camera, Images, Pose
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
          names: of sensors (`ig2mj.sensors.registry.SENSORS`), or a single one.
          varied: axes of `ig2mj.Randomize` that are on; readings then take what was drawn.

        Raises:
          UnknownNameError: no such sensor. EngineError: the robot lacks what a sensor needs, or the engine cannot make
            images (only "native" and "warp" can).
        """
        self._sensors = [find_sensor(name) for name in ((names,) if isinstance(names, str) else names)]
        self.options = options or SensorOptions()
        self._setup = Setup(scene, model, controller, self.options, agent)
        self.spaces: dict[str, Space] = {s.name: s.space(self._setup) for s in self._sensors}
        self._varied = frozenset(varied) & {"lights", "camera"}
        self._felt = [s for s in self._sensors if not s.looks]
        self._seen = [s for s in self._sensors if s.looks]
        self._patterns = {}
        for sensor in self._seen:
            if sensor.rays is not None:
                pattern = sensor.rays(self._setup)
                self._patterns[pattern.name] = (pattern, sensor.ray_pose)
        if "scan" in self._patterns:
            _ = self._setup.laser  # raises where there is none
        self._camera = self._make_camera(engine) if self._seen else None
        self._remembers = any(s.remembers for s in self._seen)
        self._poses, self._finish = engine.compile(self._poses_fn), engine.compile(self._finish_fn)
        self._feel, self._remember = engine.compile(self.feel_fn), engine.compile(self._memory)
        self._whole = engine.program(self.read_fn)

    def _make_camera(self, engine: Engine) -> Camera:
        requested = frozenset().union(*(s.images for s in self._seen))
        options = self._setup.options
        settings: dict[str, Any] = {
            "width": options.width,
            "height": options.height,
            "particles": options.particles,
            "shadows": options.shadows,
            "rows": options.rows,
            "looks": options.looks,
            "rays": [pattern for pattern, _ in self._patterns.values()],
            **{name: name in requested for name in ("rgb", "depth", "segmentation")},
        }
        cameras = [self._setup.camera] if requested else []
        if engine.renderer not in CAMERAS:
            raise EngineError(
                f"the {engine.name} engine neither renders images nor casts rays (take 'native' or 'warp')"
            )
        if self._varied:
            settings["varied"] = self._varied
        module, kind = CAMERAS[engine.renderer].split(":")
        return getattr(importlib.import_module(module), kind)(engine, self._setup.model, cameras, **settings)

    def prepare_devices(self, devices: Sequence[Any]) -> None:
        """Allocates memory of cameras on other devices of this process, before programs for them are compiled."""
        if self._camera is not None:
            self._camera.prepare_devices(devices)

    @property
    def noisy(self) -> bool:
        """Readings need keys."""
        return self._setup.options.depth_noise_rate > 0 or self._setup.options.scan_noise_rate > 0

    @property
    def looks(self) -> bool:
        """Some sensor needs images or rays; the others are read from the view alone (`feel_fn`)."""
        return self._camera is not None

    # Readings.

    def read(
        self,
        physics: Physics,
        view: PhysicsView,
        states: ExtendedStates,
        controller: Any,
        memory: Memory | None = None,
        keys: UInt32[Array, "W 2"] | None = None,
        draw: Draw | None = None,
    ) -> tuple[Readings, Memory | None]:
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
        memory: Memory | None = None,
        keys: UInt32[Array, "W 2"] | None = None,
        draw: Draw | None = None,
    ) -> tuple[Readings, Memory | None]:
        """`read`, not compiled."""
        seen, memory = self.look_fn(physics, view, states, controller, memory, keys, draw=draw)
        felt = self._feel(view, states, controller) if self._felt else {}
        return {name: {**felt, **seen}[name] for name in self.spaces}, memory

    def feel_fn(self, view: PhysicsView, states: ExtendedStates, controller: Any) -> Readings:
        """Readings of the sensors that need the view only. Pure on every engine, not compiled."""
        percept = Percept(view, states, controller)
        return {s.name: self._read(s, percept) for s in self._felt}

    def look_fn(
        self,
        physics: Physics,
        view: PhysicsView,
        states: ExtendedStates,
        controller: Any,
        memory: Memory | None = None,
        keys: UInt32[Array, "W 2"] | None = None,
        rendered: Bool[Array, "W"] | None = None,
        draw: Draw | None = None,
    ) -> tuple[Readings, Memory | None]:
        """Readings of the sensors that need images or rays; see `read`.

        Args:
          rendered: the worlds whose readings matter; None: all.
        """
        if self._camera is None:
            return {}, None
        draw = draw if draw is not None and self._varied else Draw()
        eye, poses = self._poses(view, controller, draw)
        images = self._camera(physics, view, states, poses, rendered, draw)
        return self._finish(view, states, controller, eye, images, memory, keys)

    # Memory.

    def memory(self, view: PhysicsView, controller: Any) -> Memory | None:
        """As after a reading of these worlds; None where no sensor needs one."""
        return self._remember(view, controller) if self._remembers else None

    def _memory(self, view: PhysicsView, controller: Any) -> Memory:
        pos, quat = self._setup.controller.eye(view, controller)
        return Memory(pos, quat, jnp.asarray(view.body_pos), jnp.asarray(view.body_quat))

    def _poses_fn(self, view: PhysicsView, controller: Any, draw: Draw) -> tuple[Pose | None, dict[str, Pose]]:
        """Of the eye, and of everything that the camera is to be called with."""
        eye, poses = None, {}
        if self._setup.scene.manifest.agents[self._setup.agent].camera:
            pos, quat = self._setup.controller.eye(view, controller)
            eye = (jnp.asarray(pos), jnp.asarray(quat))
            if draw.camera_pos is not None and draw.camera_quat is not None:
                eye = compose(*eye, jnp.asarray(draw.camera_pos), jnp.asarray(draw.camera_quat))
            if any(s.images for s in self._seen):
                poses[self._setup.camera] = eye
        for name, (_, pose) in self._patterns.items():
            poses[name] = pose(self._setup, view, eye)
        return eye, poses

    def _finish_fn(
        self,
        view: PhysicsView,
        states: ExtendedStates,
        controller: Any,
        eye: Pose | None,
        images: Images,
        memory: Memory | None,
        keys: UInt32[Array, "W 2"] | None,
    ) -> tuple[Readings, Memory | None]:
        """Readings from images."""
        now = self._memory(view, controller) if self._remembers else None
        before = now if memory is None else memory
        percept = Percept(view, states, controller, eye, images, before, keys)
        return {s.name: _finite(self._read(s, percept)) for s in self._seen}, now

    def _read(self, sensor: Sensor, percept: Percept) -> Array:
        """A reading. Raises PluginError: it has another shape or type than the sensor's space."""
        reading, space = sensor.read(self._setup, percept), self.spaces[sensor.name]
        shape, dtype = tuple(np.shape(reading)), jnp.result_type(reading)
        if not shape or shape[1:] != tuple(space.shape) or dtype != space.dtype:
            requested = ", ".join(["W", *map(str, space.shape)])
            raise PluginError(
                f"sensor '{sensor.name}' gives {dtype}{list(shape)}; its space is {np.dtype(space.dtype)}[{requested}]"
            )
        return reading


def _finite(reading: Array) -> Array:
    """A reading in which numbers that are not finite, of worlds that broke, are 0."""
    reading = jnp.asarray(reading)
    if not jnp.issubdtype(reading.dtype, jnp.floating):
        return reading
    return jnp.where(jnp.isfinite(reading), reading, 0.0)
