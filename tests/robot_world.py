"""A robot in a scene, driven by its own controller: one world of the native engine."""

from __future__ import annotations

import os
import weakref
from collections.abc import Callable
from typing import Any

import jax
import numpy as np
from scipy.spatial.transform import Rotation

import ig2mj
from ig2mj.agents import Humanoid
from ig2mj.agents.base import Robot
from ig2mj.agents.grasping import Grasping

FACING_TABLE = {"pos": (0.3, 0.62, 0.62), "quat": (np.sqrt(0.5), 0, 0, -np.sqrt(0.5))}
"""Where the humanoid stands before the tiny home's can."""


_MOST_KEPT = 4
_KEPT: dict[Any, list[Any]] = {}
"""What worlds of earlier tests were made of, by what they were made for: programs of the same world are the same."""


def _kept_for(world: object, key: Any, make: Callable[[], Any]) -> Any:
    """What an earlier world of this key, which nobody has any more, was made of; else what `make` gives."""
    free = _KEPT.pop(key, [])
    _KEPT[key] = free  # the latest one used
    for old in list(_KEPT)[:-_MOST_KEPT]:
        del _KEPT[old]
    made = free.pop() if free else make()
    weakref.finalize(world, free.append, made).atexit = False
    return made


class RobotWorld:
    """One world without states, whose first agent is the robot; `act` is one action of `period` seconds."""

    def __init__(self, home: str | os.PathLike, robot: Robot, period: float = 0.1, others: tuple[Robot, ...] = ()):
        def make() -> tuple[Any, ...]:
            scene = ig2mj.load_scene(home, agents=[robot, *others])
            controller = robot.controller(scene.tables, 0, period)
            programs = jax.jit(controller.control), jax.jit(controller.proprioception)
            return scene, ig2mj.Simulation(scene, states=None), controller, programs

        made = _kept_for(self, (str(home), robot, period, others), make)
        self.scene, self.simulation, self.controller, (self._control, self._sense) = made
        self.simulation.reset()
        self.state = self.controller.initial(1)
        self.steps = round(period * 30)
        self._own = self.scene.tables.actuator_agent == 0
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
        values = np.asarray(self._sense(self.view, self.state))[0]
        return dict(zip(self.controller.proprioception_names, values.tolist(), strict=True))


class GraspingWorld(RobotWorld):
    """A robot whose grasps are assisted, in a `Simulation`, on any engine; an action is 1/10 s.

    `home`: a scene that is loaded has its robots already.
    """

    def __init__(
        self,
        home: str | os.PathLike | ig2mj.Scene,
        robot: Robot | None = None,
        mode: str = "assisted",
        targets=(),
        others: tuple[Robot, ...] = (),
        engine: str = "native",
        **options,
    ):
        def make() -> tuple[Any, ...]:
            scene = home if isinstance(home, ig2mj.Scene) else ig2mj.load_scene(home, agents=[robot, *others])
            grasping = Grasping(scene, mode, targets)
            simulation = ig2mj.Simulation(scene, engine, grasping=grasping, **options)
            return scene, grasping, simulation, jax.jit(simulation.core.controllers[0].proprioception)

        if isinstance(home, ig2mj.Scene) or options:
            made = make()
        else:
            made = _kept_for(self, (str(home), robot, mode, tuple(targets), others, engine), make)
        self.scene, self.grasping, self.simulation, self._sense = made
        self.simulation.reset()
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

    def gripper_to(self, place: np.ndarray, times: int, **named: float) -> None:
        """Actions of Fetch that bring its gripper's frame to a place in the world."""
        for _ in range(times):
            local = Rotation.from_quat(np.roll(self.quat("fetch"), -1)).inv()
            left = local.apply(np.asarray(place) - self.body("fetch_gripper_link"))
            moves = np.clip(left / 0.04, -1, 1)
            self.act(eef_x=float(moves[0]), eef_y=float(moves[1]), eef_z=float(moves[2]), **named)

    def act(self, action: np.ndarray | None = None, times: int = 1, **named: float) -> None:
        self.simulation.robots.act(action, times, **named)


def can(world: RobotWorld) -> np.ndarray:
    """Position of the tiny home's can."""
    return np.array(world.simulation.object_pose("can")[0])


def reach(world: GraspingWorld, place: np.ndarray, offset: tuple, times: int, hand: int = 1) -> None:
    """Actions of at most 8 cm that bring a hand to a place in the world, or beside it."""
    place = np.array(place) + offset
    name = ("left_hand", "right_hand")[hand]
    for _ in range(times):
        turned = Rotation.from_quat(np.roll(world.quat("humanoid"), -1)).inv()
        local = turned.apply(place - world.body("humanoid")) - np.asarray(world.state.hand_pos)[0, hand]
        world.act(**{f"{name}_{axis}": d for axis, d in zip("xyz", np.clip(local, -0.08, 0.08), strict=True)})


def over_the_can(home: pathlib.Path, **options) -> GraspingWorld:
    """The right palm lies over the can, fingers before it."""
    world = GraspingWorld(home, Humanoid(**FACING_TABLE), **options)
    world.act(times=2)
    reach(world, can(world), (0, 0.045, 0.2), 5)
    reach(world, can(world), (0, 0.045, 0.085), 3)
    return world
