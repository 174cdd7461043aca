"""A robot in a scene that perceives: sensors of one agent, in some worlds of an engine, nothing stepped."""

from __future__ import annotations

import os

import jax
import numpy as np

import ig2mj
from ig2mj.agents.base import Robot
from ig2mj.engine.registry import make_engine
from ig2mj.sensors.base import SensorOptions
from ig2mj.sensors.suite import SensorSuite
from ig2mj.states.initial import initial_states
from ig2mj.states.model import StateModel


class Perceiving:
    """The scene at its start; move `physics`, `states` and `state` and read again."""

    def __init__(self, home: str | os.PathLike, robot: Robot, engine: str = "native", worlds: int = 1):
        self.scene = ig2mj.load_scene(home, agents=[robot])
        self.engine = make_engine(engine, self.scene, worlds)
        self.model = StateModel.of_manifest(self.scene.tables, self.scene.manifest)
        self.controller = robot.controller(self.scene.tables, 0)
        self.physics = self.engine.reset()
        self.states = initial_states(self.model, worlds)
        self.state = self.controller.initial(worlds)

    def suite(self, *names: str, **options) -> SensorSuite:
        return SensorSuite(self.engine, self.scene, self.model, self.controller, names, SensorOptions(**options))

    def read(self, suite: SensorSuite, memory=None, keys=None):
        view = self.engine.view(self.physics)
        readings, memory = suite.read(self.physics, view, self.states, self.state, memory, keys)
        return jax.tree.map(np.asarray, readings), memory

    def see(self, *names: str, keys=None, **options):
        """Readings of some sensors, now."""
        return self.read(self.suite(*names, **options), keys=keys)[0]

    def eye(self):
        """Pose of the camera in world 0: position, and the matrix whose columns are its axes."""
        pos, quat = self.controller.eye(self.engine.view(self.physics), self.state)
        return np.asarray(pos)[0].astype(float), matrix(np.asarray(quat)[0])


def matrix(quat) -> np.ndarray:
    import mujoco

    out = np.zeros(9)
    mujoco.mju_quat2Mat(out, np.asarray(quat, float))
    return out.reshape(3, 3)
