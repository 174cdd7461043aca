"""What pages can look at: worlds of a home, an environment with someone who acts in it.

A source belongs to the thread that simulates; no other thread calls it.

Axes: W worlds.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol, runtime_checkable

import jax
import mujoco
import numpy as np

from ig2mj.engine.base import Engine
from ig2mj.envs.environment import Environment, EnvState
from ig2mj.errors import Ig2mjError
from ig2mj.predicates.compile import CompiledExpression
from ig2mj.scene.scene import Scene
from ig2mj.states.model import StateModel
from ig2mj.web.shots import Shot, shot_of
from ig2mj.worlds.batch import Batch
from ig2mj.worlds.core import Core


@runtime_checkable
class Source(Protocol):
    """What the viewer asks of a source.

    Attributes:
      scene: the household, with its robots. model: constants of its states. goal: None where there is none.
      num_worlds: W. rows: of the pool that episodes start from, 0 where there is no pool.
      period: simulated seconds of a step.
    """

    scene: Scene
    model: StateModel
    goal: CompiledExpression | None
    num_worlds: int
    rows: int
    period: float

    def step(self) -> None:
        """Lets time pass in all worlds. Raises Ig2mjError."""
        ...

    def reset(self, world: int, row: int | None = None) -> None:
        """Puts a world back to its start, or to the start that a row of the pool is."""
        ...

    def shot(self, world: int, jump: bool = False) -> Shot:
        """A world as it is now."""
        ...

    def mujoco(self, world: int) -> tuple[mujoco.MjModel, mujoco.MjData] | None:
        """Live structures of a world, so that forces put there act in the next step; None: there are none."""
        ...


@runtime_checkable
class Timeline(Protocol):
    """A source that was recorded: every frame can be gone to.

    Attributes: runs: names. run: the one that is shown. frame: the one that is shown. frames: of that run.
    """

    runs: list[str]
    run: int
    frame: int
    frames: int

    def seek(self, frame: int, run: int | None = None) -> None:
        """Goes to a frame, of another run where that is named; beyond the ends the nearest."""
        ...


def rules_of(core: Core) -> Any:
    """The rules of a core that is shown. Raises Ig2mjError: it steps physics only."""
    if core.rules is None:
        raise Ig2mjError("worlds without states cannot be shown in the browser")
    return core.rules


def live(engine: Engine, physics: Any, world: int) -> tuple[mujoco.MjModel, mujoco.MjData] | None:
    """See `Source.mujoco`."""
    return engine.to_mujoco(physics, world) if engine.live else None


class Home:
    """Worlds of a home without actions. See `Source`."""

    def __init__(
        self,
        scene: Scene,
        core: Core,
        goal: CompiledExpression | None = None,
        begin: Callable[[Core, Batch], Batch] | None = None,
    ):
        """Starts all worlds.

        Args:
          begin: changes the batch at its start; None: the scene's start, or rows of the core's pool.
        """
        self.scene, self._core, self.model, self.goal = scene, core, rules_of(core).model, goal
        self.num_worlds, self.period = core.engine.num_worlds, core.engine.substeps * core.engine.timestep
        size = core.starts.pool.size
        self.rows = size if size > 1 else 0
        self._batch = core.start(0)
        if begin is not None:
            self._batch = begin(core, self._batch)
        world = self._batch.world
        states = jax.tree.map(np.array, world.states)  # copies: a step may use up what it was given
        self._first = core.engine.snapshot(world.physics), states
        core.prepare(world.physics, world.states)

    def step(self) -> None:
        self._batch, _ = self._core.step(self._batch)

    def reset(self, world: int, row: int | None = None) -> None:
        if row is None:
            physics, states = self._first
        else:
            chosen = self._core.starts.pool.rows(np.full(self.num_worlds, row))
            physics, states = chosen.physics, chosen.states
        mask = np.arange(self.num_worlds) == world
        self._batch = self._core.load(self._batch, physics, states, mask)

    def shot(self, world: int, jump: bool = False) -> Shot:
        now, engine = self._batch.world, self._core.engine
        time = float(np.asarray(engine.time(now.physics))[world])
        return shot_of(engine, now.view, now.states, world, time, jump=jump, period=self.period)

    def mujoco(self, world: int) -> tuple[mujoco.MjModel, mujoco.MjData] | None:
        return live(self._core.engine, self._batch.world.physics, world)


class Acting:
    """An environment with an agent; a new episode begins after each end. See `Source`."""

    def __init__(self, env: Environment, act: Callable[[EnvState], Any], seed: int = 0):
        """`act`: actions [W, n] of a state."""
        rules = rules_of(env.core)
        self.scene, self.env, self._act, self.model, self.goal = env.scene, env, act, rules.model, rules.goal
        self.num_worlds = env.num_worlds
        size = env.core.starts.pool.size
        self.rows, self.period = size if size > 1 else 0, env.period
        self._state = env.reset(seed)
        self._began = np.zeros(self.num_worlds, bool)
        self._rewards = np.zeros(self.num_worlds)

    def step(self) -> None:
        self._began = np.asarray(self._state.done).copy()
        if self._began.any():
            self._state = self.env.reset(self._state, self._began)
            self._rewards[self._began] = 0
            return
        self._state = self.env.step(self._state, np.asarray(self._act(self._state)))
        self._rewards += np.asarray(self._state.reward)

    def reset(self, world: int, row: int | None = None) -> None:
        mask = np.arange(self.num_worlds) == world
        self._state = self.env.reset(self._state, mask)
        self._rewards[world] = 0
        if row is None:
            return
        core, batch = self.env.core, self._state.batch
        chosen = core.starts.pool.rows(np.full(self.num_worlds, row))
        batch = core.load(batch, chosen.physics, chosen.states, mask)
        self._state = self.env.resume(batch, np.full(self.num_worlds, row), mask, self._state)

    def shot(self, world: int, jump: bool = False) -> Shot:
        state, now = self._state, self._state.batch.world
        facts = [("agent step", str(int(np.asarray(state.info["steps"])[world])))]
        facts.append(("reward so far", f"{self._rewards[world]:.3g}"))
        if bool(np.asarray(state.info["success"])[world]):
            facts.append(("episode", "success"))
        elif bool(np.asarray(state.truncated)[world]) or bool(np.asarray(state.terminated)[world]):
            facts.append(("episode", "over"))
        time = float(np.asarray(now.time)[world])
        jump, engine = jump or bool(self._began[world]), self.env.core.engine
        return shot_of(engine, now.view, now.states, world, time, facts=tuple(facts), jump=jump, period=self.period)

    def mujoco(self, world: int) -> tuple[mujoco.MjModel, mujoco.MjData] | None:
        return live(self.env.core.engine, self._state.batch.world.physics, world)
