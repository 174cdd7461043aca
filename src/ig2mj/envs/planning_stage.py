"""`EnvironmentStage`: lets the physics rung act in an environment's worlds, through the task's own actions.

Axes: W worlds, n numbers of the task's action, m of the robot's.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Collection, Sequence

import jax
import numpy as np
from jaxtyping import Float, Int

from ig2mj.agents.base import Controller
from ig2mj.engine.base import Write
from ig2mj.engine.snapshot import Snapshot
from ig2mj.engine.view import Array, PhysicsView
from ig2mj.envs.environment import Environment, EnvState
from ig2mj.envs.registry import make
from ig2mj.errors import EngineError
from ig2mj.planning.problem import Problem
from ig2mj.planning.starts import open_doors
from ig2mj.scene.scene import Scene
from ig2mj.states.model import StateModel
from ig2mj.states.world import ExtendedStates
from ig2mj.worlds.guards import Flag

DOORS_SETTLE = 0.5
"""s that pass after doors were opened, before an episode begins."""


class EnvironmentStage:
    """See the module's text and `ig2mj.planning.stage.Stage`.

    Attributes:
      env: the environment. agent: number of the robot that acts.
    """

    agent = 0

    def __init__(self, env: Environment, step: Callable[[EnvState, Array], EnvState] | None = None, ends: bool = True):
        """
        Args:
          env: its action has every number of the robot's (`whole_actions`). step: in place of `env.step`.
          ends: an episode is over where the environment's own goal holds.

        Raises:
          EngineError: the action lacks some.
        """
        rules = env.core.rules
        assert rules is not None
        self.env, self._model = env, rules.model
        self.controller: Controller = env.core.controllers[0]
        lacking = [n for n in self.controller.action_names if n not in env.action_names]
        if lacking:
            few = ", ".join(lacking[:3])
            raise EngineError(f"{env.task.name}: its action lacks {few} (ig2mj.make(..., whole_actions=True))")
        self._step, self._own_end = step or env.step, ends
        self._state: EnvState | None = None

    @property
    def state(self) -> EnvState:
        """Of the environment. Raises EngineError: no episode has begun."""
        if self._state is None:
            raise EngineError("no episode has begun: start(rows) first")
        return self._state

    @property
    def scene(self) -> Scene:
        return self.env.scene

    @property
    def model(self) -> StateModel:
        return self._model

    @property
    def num_worlds(self) -> int:
        return self.env.num_worlds

    @property
    def by_friction(self) -> bool:
        return self.env.core.grasping is None

    @property
    def view(self) -> PhysicsView:
        return self.state.batch.world.view

    @property
    def states(self) -> ExtendedStates:
        return self.state.batch.world.states

    def snapshot(self, world: int) -> Snapshot:
        return self.env.core.engine.export(self.state.batch.world.physics, world)

    def start(self, rows: Sequence[int] | Int[np.ndarray, "W"], closed: Collection[str] | None = None) -> None:
        """Begins an episode in every world.

        Args:
          rows: of the environment's start states. closed: doors between rooms that are left as the rows have them; all
            others stand open. None: all are left.
        """
        rows = np.asarray(rows, np.int32)
        state = self.env.start_from(rows)
        write = None if closed is None else open_doors(self.scene, closed)
        if write is not None:
            count = self.num_worlds
            whole = jax.tree.map(lambda a: np.broadcast_to(a, (count, *np.shape(a)[1:])), write)
            state = self.env.resume(self.env.core.write(state.batch, whole), rows)
            for _ in range(math.ceil(DOORS_SETTLE / self.env.period)):
                state = self.env.step(state, np.zeros((count, *self.env.action_space.shape), np.float32))
            state = self.env.resume(state.batch, rows)
        self._state = state

    def observe(self, state: EnvState) -> None:
        """Continues from a state of the environment that was made outside of the stage."""
        self._state = state

    def write(self, write: Write) -> None:
        """Changes the physics of the worlds between two steps. `write` has a row for each world."""
        self._state = dataclasses.replace(self.state, batch=self.env.core.write(self.state.batch, write))

    def act(self, action: Float[np.ndarray, "W m"]) -> None:
        """See `Stage.act`."""
        own = self.env.action_map
        given = np.clip(np.asarray(action, np.float32)[:, own.places] / own.scale, -1.0, 1.0)
        self._state = self._step(self.state, given)

    def ended(self, world: int) -> str | None:
        """See `Stage.ended`."""
        if self._own_end and bool(np.asarray(self.state.terminated)[world]):
            return ""
        if bool(np.asarray(self.state.truncated)[world]):
            if int(np.asarray(self.state.info["steps"])[world]) < self.env.task.horizon:
                flags = Flag(int(np.asarray(self.state.info["flags"])[world]))
                return f"physics went wrong: {', '.join(f.name.lower() for f in flags if f.name) or 'unknown'}"
            return f"the horizon of {self.env.task.horizon * self.env.period:.0f} s passed"
        return None


def problem_env(
    problem: Problem,
    robot: str = "humanoid",
    worlds: int = 1,
    *,
    rows: int = 1,
    split: str = "held_out",
    horizon: int | None = None,
    grasping: str = "assisted",
    engine: str = "native",
) -> Environment:
    """The environment of a planning problem, whose actions move all of the robot.

    Args:
      rows: start states of the split that it has, if as many can be sampled. horizon: agent steps; None: the task's.

    Raises:
      As `ig2mj.make`.
    """
    objects = problem.objects if problem.own_goal else ()
    return make(
        problem.task,
        robot=robot,
        worlds=worlds,
        engine=engine,
        grasping=grasping,
        whole_actions=True,
        split=split,
        pool_size=1 if problem.own_goal else rows,
        horizon=horizon,
        objects=objects,
    )
