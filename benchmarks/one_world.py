"""One world with everything on, as the benchmarks step it: native physics, view, extended states, guards, a goal."""

from __future__ import annotations

import mujoco
import numpy as np

from ig2mj.engine.native import NativeEngine
from ig2mj.predicates.compile import CompiledExpression
from ig2mj.scene.scene import Scene
from ig2mj.states.model import StateModel
from ig2mj.worlds.batch import Batch, Worlds


class OneWorld:
    """A world of its own; `step` takes one control step of 1/30 s.

    Attributes:
      batch: the world's state. worlds: its functions.
    """

    def __init__(self, scene: Scene, model: StateModel, goal: CompiledExpression | None = None):
        self.scene = scene
        self.worlds = Worlds(NativeEngine(scene, 1), model, goal=goal)
        self.batch: Batch = self.worlds.start(0)

    def step(self, ctrl: np.ndarray | None = None) -> None:
        """Physics, view, states, guards and goal; ctrl [nu]."""
        self.batch, verdict = self.worlds.step(self.batch, None if ctrl is None else ctrl[None])
        if verdict is not None:
            np.asarray(verdict.fraction)  # wait for it, as a user would

    def engine_step(self) -> None:
        """Physics and view alone, of the same world."""
        self.worlds.engine.step(self.batch.world.physics)

    @property
    def mujoco(self) -> tuple[mujoco.MjModel, mujoco.MjData]:
        """Model and live data."""
        return self.worlds.engine.to_mujoco(self.batch.world.physics, 0)

    def awake(self) -> list[str]:
        """Names of the objects that are awake."""
        awake = np.asarray(self.batch.world.view.awake)[0]
        return [name for name, a in zip(self.scene.object_names, awake, strict=True) if a]

    def bare(self) -> BarePhysics:
        """MuJoCo alone, from the present state on."""
        return BarePhysics(*self.mujoco)


class BarePhysics:
    """Four physics steps of MuJoCo and nothing else, on a copy."""

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData):
        self.model, self.data = model, mujoco.MjData(model)
        mujoco.mj_copyData(self.data, model, data)

    def step(self) -> None:
        """One control step."""
        mujoco.mj_step(self.model, self.data, nstep=4)
