"""A robot in a scene, driven by its own controller: one world of the native engine."""

from __future__ import annotations

import os

import jax
import numpy as np

import ig2mj
from ig2mj.agents.base import Robot
from ig2mj.agents.grasping import Grasping


class RobotWorld:
    """One world whose first agent is the robot; `act` is one action of `period` seconds."""

    def __init__(self, home: str | os.PathLike, robot: Robot, period: float = 0.1, others: tuple[Robot, ...] = ()):
        self.scene = ig2mj.load_scene(home, agents=[robot, *others])
        self.simulation = ig2mj.Simulation(self.scene)
        self.controller = robot.controller(self.scene.tables, 0, period)
        self.state = self.controller.initial(1)
        self.steps = round(period * 30)
        self._own = self.scene.tables.actuator_agent == 0
        self._control = jax.jit(self.controller.control)
        self._ctrl = np.zeros(self.scene.model.nu)

    @property
    def view(self):
        return self.simulation.view

    def body(self, name: str) -> np.ndarray:
        return np.asarray(self.view.body_pos)[0, self.scene.model.body(name).id]

    def quat(self, name: str) -> np.ndarray:
        return np.asarray(self.view.body_quat)[0, self.scene.model.body(name).id]

    def act(self, action: np.ndarray | None = None, times: int = 1, **named: float) -> None:
        """Acts so many times: the whole action, or numbers by name and zeros."""
        if action is None:
            action = np.zeros(self.controller.action_size)
            for name, value in named.items():
                action[self.controller.action_names.index(name)] = value
        for _ in range(times):
            ctrl, self.state = self._control(np.asarray(action, np.float32)[None], self.view, self.state)
            self._ctrl[self._own] = np.asarray(ctrl)[0]
            self.simulation.step(self._ctrl, count=self.steps)

    def proprioception(self) -> dict[str, float]:
        values = np.asarray(self.controller.proprioception(self.view, self.state))[0]
        return dict(zip(self.controller.proprioception_names, values.tolist(), strict=True))


class GraspingWorld(RobotWorld):
    """A robot whose grasps are assisted; one control step after the other, as the core does it."""

    def __init__(self, home: str | os.PathLike, robot: Robot, mode: str = "assisted", targets=(), period: float = 0.1):
        super().__init__(home, robot, period)
        self.grasping = Grasping(self.scene, mode, targets)
        self.grasps = self.grasping.initial(1)
        self._update = jax.jit(self.grasping.update)
        self._lag, self._write = jax.jit(self.controller.lag), jax.jit(self.grasping.write)

    @property
    def held(self) -> list[str | None]:
        """Object in each hand."""
        bodies, tables = np.asarray(self.grasps.body)[0], self.scene.tables
        held = np.asarray(self.grasps.held)[0]
        return [
            tables.object_names[tables.graspable_object[b]] if on else None for b, on in zip(bodies, held, strict=True)
        ]

    def step(self) -> None:
        self.simulation.step(self._ctrl)
        grip, lag = self.controller.grip(self.state), self._lag(self.view, self.state)
        after = self._update(self.view, self.grasps, grip, lag)
        if np.asarray(self.grasping.changed(self.grasps, after)).any():
            engine = self.simulation.engine
            engine.write(self.simulation.physics, jax.tree.map(np.asarray, self._write(after)))
        self.grasps = after

    def act(self, action: np.ndarray | None = None, times: int = 1, **named: float) -> None:
        if action is None:
            action = np.zeros(self.controller.action_size)
            for name, value in named.items():
                action[self.controller.action_names.index(name)] = value
        for _ in range(times):
            ctrl, self.state = self._control(np.asarray(action, np.float32)[None], self.view, self.state)
            self._ctrl[self._own] = np.asarray(ctrl)[0]
            for _ in range(self.steps):
                self.step()
