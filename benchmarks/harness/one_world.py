"""One world with everything on, as a `Simulation` steps it: native physics, view, all extended states, and a goal."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import jax
import mujoco
import numpy as np

from ig2mj.agents.base import Robot
from ig2mj.engine.native.engine import NativeEngine
from ig2mj.engine.view import PhysicsView
from ig2mj.predicates.compile import CompiledExpression, GoalStatus
from ig2mj.scene.scene import Scene
from ig2mj.sensors.base import SensorOptions
from ig2mj.sensors.suite import SensorSuite
from ig2mj.states.model import StateModel
from ig2mj.worlds.core import Core
from ig2mj.worlds.rules import Rules


class OneWorld:
    """A world of its own; `step` takes one control step of 1/30 s.

    Attributes:
      engine, physics, view: of physics. states: extended ones. status: the goal's, of the last step.
    """

    def __init__(self, scene: Scene, model: StateModel, goal: CompiledExpression | None = None):
        self.scene, self.model = scene, model
        self.engine = NativeEngine(scene, 1)
        self.physics: Any = self.engine.reset()
        self.view: PhysicsView = self.engine.view(self.physics)
        rules = Rules(model, goal)
        self._advance, self.states = Core(self.engine, rules).advance, rules.initial
        self.status = GoalStatus.empty(1)

    def step(self, ctrl: np.ndarray | None = None) -> None:
        """Physics, view, states and goal; ctrl [nu]. Waits for the results, as a user of one world does."""
        before = self.states
        self.physics, self.view, self.states, self.status, _ = self._advance(
            self.physics, before, None if ctrl is None else ctrl[None]
        )
        if self.states is not before:
            jax.block_until_ready((self.states.temperature, self.status))

    def engine_step(self, ctrl: np.ndarray | None = None) -> None:
        """Physics and view alone, of the same world."""
        self.physics, self.view = self.engine.step(self.physics, None if ctrl is None else ctrl[None])

    def with_images(self, robot: Robot, sensors: Sequence[str], size: int) -> Callable[[], None]:
        """A control step and readings of a robot's sensors, with square images of `size` pixels a side.

        robot: the first of the scene.
        """
        controller = robot.controller(self.scene.tables, 0)
        options = SensorOptions(width=size, height=size)
        suite = SensorSuite(self.engine, self.scene, self.model, controller, list(sensors), options)
        state = controller.initial(1)

        def step() -> None:
            self.step()
            suite.read(self.physics, self.view, self.states, state)

        return step

    @property
    def mujoco(self) -> tuple[mujoco.MjModel, mujoco.MjData]:
        """Model and live data."""
        return self.engine.to_mujoco(self.physics, 0)

    def awake(self) -> list[str]:
        """Names of the objects that are awake."""
        awake = np.asarray(self.view.awake)[0]
        return [name for name, a in zip(self.scene.object_names, awake, strict=True) if a]

    def bare(self) -> BarePhysics:
        """MuJoCo alone, from the present state on."""
        return BarePhysics(*self.mujoco)


class BarePhysics:
    """Four physics steps of MuJoCo and nothing else, on a copy."""

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData):
        self.model, self.data = model, mujoco.MjData(model)
        mujoco.mj_copyData(self.data, model, data)

    def step(self, ctrl: np.ndarray | None = None) -> None:
        """One control step; ctrl [nu]."""
        if ctrl is not None:
            self.data.ctrl[:] = ctrl
        mujoco.mj_step(self.model, self.data, nstep=4)
