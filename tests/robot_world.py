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
    """A robot whose grasps are assisted, in a `Simulation`, on any engine; an action is 1/10 s."""

    def __init__(
        self,
        home: str | os.PathLike,
        robot: Robot,
        mode: str = "assisted",
        targets=(),
        others: tuple[Robot, ...] = (),
        engine: str = "native",
        **options,
    ):
        self.scene = ig2mj.load_scene(home, agents=[robot, *others])
        self.grasping = Grasping(self.scene, mode, targets)
        self.simulation = ig2mj.Simulation(self.scene, engine, grasping=self.grasping, **options)
        self.controller = self.simulation.core.controllers[0]

    @property
    def state(self):
        return self.simulation.robots.controllers[0]

    @property
    def grasps(self):
        return self.simulation.robots.held

    @property
    def held(self) -> list[str | None]:
        """Object in each hand."""
        return list(self.simulation.robots.holding.values())

    def step(self) -> None:
        self.simulation.step()

    def act(self, action: np.ndarray | None = None, times: int = 1, **named: float) -> None:
        self.simulation.robots.act(action, times, **named)
