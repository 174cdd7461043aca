"""One world of an environment with an agent that acts, as the interactive viewer takes it (`viewer.interactive.World`).

An agent step lasts three of the viewer's steps; between two agent steps positions are interpolated, so that what is
seen is a tenth of a second old and moves smoothly. When an episode ends, the next begins at the pool's next row.
"""

from __future__ import annotations

import mujoco
import numpy as np

from ig2mj.envs.environment import Environment, EnvState
from ig2mj.envs.rollout import Act
from ig2mj.errors import EngineError
from ig2mj.process import entry_point

BETWEEN = 3
"""Images of an agent step."""

PAUSE = 10
"""The viewer's steps for which the end of an episode is shown."""

JUMP = 0.3
"""m or rad of an agent step beyond which nothing is interpolated: what slicing moves."""


@entry_point
class ActingWorld:
    """See the module's text.

    Attributes:
      scene, data: what is drawn. state: of the environment. successes, episodes: of those that are over.
    """

    def __init__(self, env: Environment, act: Act, first: int = 0):
        """
        Args:
          env: with one world, on the native engine. act: who acts. first: row of the pool to begin with.

        Raises:
          EngineError: the environment has several worlds or another engine.
        """
        if env.num_worlds != 1 or not env.core.engine.live:
            raise EngineError("the viewer shows one world of the native engine")
        self.scene, self._env, self._act = env.scene, env, act
        self._row, self.successes, self.episodes = first, 0, 0
        self.data = mujoco.MjData(env.scene.model)
        self._begin()
        self._show(1.0)

    def prepare(self) -> None:
        """Compiles who acts and what a step needs; `data` stays as it is."""
        self._env.step(self.state, self._act(self.state))
        self._begin()

    def step(self) -> None:
        """A third of an agent step."""
        if self._part == 0:
            if bool(np.asarray(self.state.done)[0]):
                self._pause += 1
                if self._pause < PAUSE:
                    return
                self.episodes += 1
                self.successes += bool(np.asarray(self.state.info["success"])[0])
                self.reset()
                return
            self._before = self._qpos()
            self.state = self._env.step(self.state, self._act(self.state))
        self._part = (self._part + 1) % BETWEEN
        self._show(self._part / BETWEEN if self._part else 1.0)

    def reset(self) -> None:
        """The next episode begins."""
        self._row = (self._row + 1) % self._env.core.starts.pool.size
        self._begin()
        self._show(1.0)

    def _begin(self) -> None:
        self.state: EnvState = self._env.start_from(np.array([self._row]))
        self._part = self._pause = 0
        self._before = self._qpos()

    def _qpos(self) -> np.ndarray:
        return self._env.core.engine.to_mujoco(self.state.batch.world.physics, 0)[1].qpos.copy()

    def _show(self, share: float) -> None:
        """Draws the world as it was at this share of the last agent step."""
        model, now = self._env.core.engine.to_mujoco(self.state.batch.world.physics, 0)
        change = np.zeros(model.nv)
        mujoco.mj_differentiatePos(model, change, 1.0, self._before, now.qpos)
        self.data.qpos[:] = now.qpos
        if share < 1.0 and np.abs(change).max(initial=0.0) < JUMP:
            self.data.qpos[:] = self._before
            mujoco.mj_integratePos(model, self.data.qpos, change, share)
        mujoco.mj_forward(model, self.data)
