"""Observations of an agent, by name: those of sensors, and those of the task.

| name | content | shape |
|---|---|---|
| `rgb`, `depth`, `scan`, ... | any sensor of `ig2mj.sensors.registry.SENSORS` (docs/guide/sensors.md) | the sensor's |
| `right_wrist/rgb`, ... | a sensor of images of another camera (`ig2mj.sensors.cameras`) | the sensor's |
| `privileged_state` | ground truth, in the frame of the robot's base (`Objective.vectors`) | [p] |
| a function's name | what the function gives (`ig2mj.tasks.custom`) | [n] |
| others of the task | such as iGibson's `task_obs` of navigation (`Objective.vectors`) | [n] |

Every array begins with the world axis W.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float, Int, UInt

from ig2mj.agents.base import Controller
from ig2mj.engine.view import Array
from ig2mj.envs.state import StepContext
from ig2mj.errors import PluginError, UnknownNameError
from ig2mj.predicates.compile import GoalStatus
from ig2mj.scene.scene import Scene
from ig2mj.sensors.base import SensorMemory, SensorOptions, Space
from ig2mj.sensors.cameras import check_cameras, split_name
from ig2mj.sensors.noise import noisy
from ig2mj.sensors.registry import OWN, SENSORS
from ig2mj.sensors.suite import SensorSuite
from ig2mj.states.world import WorldState
from ig2mj.tasks.objective import Measures, Objective
from ig2mj.worlds.batch import select_worlds
from ig2mj.worlds.draw import Draw
from ig2mj.worlds.random_streams import step_keys
from ig2mj.worlds.randomize import SensorNoise

__all__ = ["Observer", "Space", "check_names"]


def check_names(
    names: Sequence[str], objective: Objective, settings: SensorOptions, scene: Scene, controller: Controller
) -> list[str]:
    """The sensors among the names of observations.

    Args:
      settings: of the sensors. controller: of the agent, the first of the scene.

    Raises:
      UnknownNameError: there is no such observation or camera; with near matches. EngineError: the robot has no such
        camera. PluginError: a sensor of a plug-in has the name of an observation of the task.
    """
    known = (*objective.vectors, *SENSORS)  # without cameras' names
    added = SENSORS.sources()
    for name in names:
        if name in objective.vectors and name in added:
            what = f"sensor '{name}' of {added[name]}"
            raise PluginError(f"{what}: the task has an observation of this name; rename the sensor")
        _, sensor = split_name(name)
        if name not in known and (sensor == name or sensor not in SENSORS):
            prefix = name.removesuffix(sensor)
            of_camera = [f"{prefix}{image}" for image, one in OWN.items() if one.images]
            raise UnknownNameError("observation", name, of_camera if prefix else known)
    found = [name for name in names if name not in objective.vectors]
    check_cameras(found, settings.cameras, scene, controller)
    return found


class Observer:
    """Makes the observations of a task.

    Attributes:
      spaces: of each observation. sensor_options: settings of the sensors.
    """

    def __init__(
        self, names: Sequence[str], objective: Objective, sensors: SensorSuite, noise: SensorNoise | None = None
    ):
        """
        Args:
          names: of sensors and of the objective's vectors. sensors: those of `check_names`.
          noise: of observations, where it differs between episodes; None: there is none.
        """
        vectors = {name: len(numbers) for name, numbers in objective.vectors.items()}
        self._names, self._objective, self._sensors = tuple(names), objective, sensors
        every = {name: Space((count,), np.float32, -np.inf, np.inf) for name, count in vectors.items()} | sensors.spaces
        self.spaces, self.sensor_options = {name: every[name] for name in names}, sensors.options
        self._keys, self._noise = jax.jit(step_keys), noise
        self._noisy = jax.jit(self._noisy_fn)

    def _noisy_fn(
        self, readings: Mapping[str, Array], strength: Array, key: UInt[Array, "W 2"], step: Int[Array, "W"]
    ) -> dict[str, Array]:
        assert self._noise is not None
        return noisy(readings, self.spaces, self._noise, strength, step_keys(key, step))

    def prepare_devices(self, devices: Sequence[Any]) -> None:
        """See `SensorSuite.prepare_devices`."""
        self._sensors.prepare_devices(devices)

    def vectors(
        self,
        context: StepContext,
        measures: Measures,
        status: GoalStatus,
        time_left: Float[Array, "W"],
    ) -> dict[str, Array]:
        """The observations that need neither images nor rays; non-finite numbers are 0. Pure. See
        `Objective.observe`."""
        view, states = context.view, context.states
        found = self._sensors.feel_fn(view, states, context.controllers[0])
        made = self._objective.observe(view, states, measures, status, time_left)
        found |= {name: array for name, array in made.items() if name in self._names}
        if self._noise is not None and context.draw.noise is not None and context.key is not None:
            felt = {name: found[name] for name in found if name in self.spaces}
            found |= noisy(
                felt, self.spaces, self._noise, context.draw.noise, step_keys(context.key, context.control_steps)
            )
        return {name: jnp.nan_to_num(jnp.asarray(a, jnp.float32), posinf=0.0, neginf=0.0) for name, a in found.items()}

    def images(
        self,
        world: WorldState,
        controller_state: Any,
        last: tuple[Mapping[str, Array], SensorMemory | None] | None,
        begun: Bool[Array, "W"] | None = None,
        draw: Draw | None = None,
    ) -> tuple[dict[str, Array], SensorMemory | None]:
        """Readings of cameras and lasers, and what those of the next step need to know (`SensorSuite.look_fn`).

        Args:
          last: observations and memory of the last step, or of before a reset; None at the start.
          begun: worlds that have just been reset; the others keep the readings of `last`. None: there was no reset.
          draw: what was drawn for the worlds' episodes.
        """
        if not self._sensors.looks:
            return {}, None
        memory = None if last is None else last[1]
        if begun is not None:
            memory = select_worlds(begun, self._sensors.memory(world.view, controller_state), memory)
        keys = self._keys(world.key, world.step) if self._sensors.noisy else None
        before = None if begun is None or last is None else last[0]
        rendered = None if before is None else begun
        found, memory = self._sensors.look_fn(
            world.physics, world.view, world.states, controller_state, memory, keys, rendered, draw
        )
        if self._noise is not None and draw is not None and draw.noise is not None:
            found = self._noisy(found, draw.noise, world.key, world.step)
        if begun is not None and before is not None:
            found = select_worlds(begun, found, {name: before[name] for name in found})
        return found, memory
