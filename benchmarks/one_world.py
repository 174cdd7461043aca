"""One world with everything on, as a `Simulation` steps it: native physics, view, all extended states, and a goal."""

from __future__ import annotations

from typing import Any

import jax
import mujoco
import numpy as np

from ig2mj.engine.base import Write
from ig2mj.engine.native.engine import NativeEngine
from ig2mj.engine.view import PhysicsView
from ig2mj.predicates.compile import CompiledExpression, GoalStatus
from ig2mj.predicates.stepper import StateProgram, StateStepper
from ig2mj.scene.scene import Scene
from ig2mj.states.initial import initial_states
from ig2mj.states.model import StateModel


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
        self._stepper = StateStepper(StateProgram(model, goal))
        self.states = initial_states(model, 1)
        self.status: GoalStatus | None = None

    def step(self, ctrl: np.ndarray | None = None) -> None:
        """Physics, view, states and goal; ctrl [nu]. Waits for the results, as a user of one world does."""
        self.engine_step(ctrl)
        before = self.states
        self.states, swap, self.status = self._stepper.step(before, self.view)
        if swap is not None:
            self._teleport(swap)
        if self.states is not before:
            jax.block_until_ready((self.states.temperature, self.status))

    def engine_step(self, ctrl: np.ndarray | None = None) -> None:
        """Physics and view alone, of the same world."""
        self.physics, self.view = self.engine.step(self.physics, None if ctrl is None else ctrl[None])

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

    def _teleport(self, swap: Any) -> None:
        objects, count = self.model.swap_objects, len(self.scene.object_names)
        mask, pos, quat = np.zeros((1, count), bool), np.zeros((1, count, 3)), np.zeros((1, count, 4))
        mask[:, objects], pos[:, objects], quat[:, objects] = swap.mask, swap.pos, swap.quat
        self.physics = self.engine.write(self.physics, Write(object_mask=mask, object_pos=pos, object_quat=quat))
        self.view = self.engine.view(self.physics)


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
