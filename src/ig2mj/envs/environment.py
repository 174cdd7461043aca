"""`Environment`: a task in a batch of worlds, functional and batch-first.

    env = ig2mj.make("CookingMeat", robot="humanoid", worlds=16)
    state = env.reset(0)
    state = env.step(state, action)              # action: [W, n], -1..1
    state = env.reset(state, state.terminated | state.truncated)

An agent step is 1/10 s unless `make` is given another period: three control steps of the core with one action. Where
`pure` is true, `step_fn` and `reset_fn` may be part of a compiled program of yours. `step` and `reset` consume the
state they are given: continue with the one that is returned. A consumed state raises StaleStateError on every engine;
`fork` copies a state, to branch. Inside a compiled program of yours states are values and may be used again.

Success ends an episode, and so does what a task calls failure (`terminated`). The horizon truncates it, and so do
guards, since the results of a world with non-finite numbers are meaningless (`ig2mj.worlds.guards`).

Axes: W worlds, n numbers of an action.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from jaxtyping import Bool, Float, Int, UInt

from ig2mj.agents.base import ACTION_PERIOD
from ig2mj.engine.base import Physics
from ig2mj.engine.view import Array
from ig2mj.envs.checks import checked_action, checked_state
from ig2mj.envs.config import Configured, EnvConfig
from ig2mj.envs.copies import StateCopies
from ig2mj.envs.images import StateImages
from ig2mj.envs.instructed import Instructed
from ig2mj.envs.observations import Observer, Space
from ig2mj.envs.state import EnvState, SeenState, StepContext
from ig2mj.errors import EngineError
from ig2mj.predicates.compile import GoalStatus
from ig2mj.process import entry_point
from ig2mj.process.gc_pause import GC_PAUSED, Traced, compile_together
from ig2mj.scene.scene import Scene
from ig2mj.tasks.actions import ActionMap
from ig2mj.tasks.custom.objective import CustomObjective
from ig2mj.tasks.objective import Measures, Objective
from ig2mj.tasks.task import TaskLike
from ig2mj.worlds.batch import Batch, select_worlds
from ig2mj.worlds.core import Core
from ig2mj.worlds.draw import Draw
from ig2mj.worlds.pool import Pool
from ig2mj.worlds.random_streams import Seed, Seeds, as_seed, pick_rows
from ig2mj.worlds.starts import checked_mask

__all__ = ["Companions", "EnvState", "Environment", "Seed", "as_seed"]

Companions = Callable[[UInt[Array, "W 2"], Int[Array, "W"]], Float[Array, "W m"]]
"""Actions of the other robots, from the episode's key and the number of the agent step. Pure."""


@entry_point
class Environment(StateCopies, StateImages, Instructed, Configured):
    """A task in a batch of worlds; `ig2mj.make` makes one.

        state = env.reset(0)
        state = env.step(state, action)              # action: [W, n], -1..1
        state = env.reset(state, state.terminated | state.truncated)

    `step` and `reset` consume the state that they are given: continue with the one that is returned. `fork` copies one.

    Attributes:
      task, robot, grasping: what is done by whom, and how hands hold (`ig2mj.agents.grasping.MODES`).
      scene, core: the household with its robot, and what steps it. objective: what is measured, rewarded and observed.
      num_worlds: W. action_names: [n]. observation_spaces: of each, without the world axis. sensor_options: settings.
      privileged_names, proprioception_names: what each number of these observations means.
      period: seconds of an agent step.
      following: programs that step the state with which episodes begin, traced from its shapes; None: they are compiled
        when they are called. `start_from` and `start_with` compile them together with their own.
    """

    following: Callable[[Any], Sequence[Traced]] | None = None

    def __init__(
        self,
        task: TaskLike,
        robot: str,
        scene: Scene,
        core: Core,
        action_map: ActionMap,
        objective: Objective,
        observer: Observer,
        grasping: str,
        companions: Companions | None = None,
        period: float = ACTION_PERIOD,
        config: EnvConfig | None = None,
    ):
        """Binds a core, whose rules have the task's goal if it has one, to rewards and observations.

        Args:
          companions: what the scene's other robots do; None: there are none.
          period: seconds of an agent step.
          config: what it was made with; None: not by `ig2mj.make`.

        Raises:
          EngineError: the core has no rules, or `period` is not a whole number of its control steps.
        """
        if core.rules is None:
            raise EngineError("an environment needs a core with rules")
        self.task, self.robot, self.grasping = task, robot, grasping
        self.scene, self.core = scene, core
        self.num_worlds = core.engine.num_worlds
        self.objective = objective
        self._own = objective if isinstance(objective, CustomObjective) else None
        self._goal = core.rules.goal
        self._map = action_map
        self._observer = observer
        self._companions = companions
        self.config = config or EnvConfig(period=period)
        self.action_names = action_map.names
        self.observation_spaces, self.sensor_options = observer.spaces, observer.sensor_options
        self.privileged_names = objective.vectors["privileged_state"]
        self.proprioception_names = core.controllers[0].proprioception_names
        step = core.engine.substeps * core.engine.timestep
        self.period = period
        self._substeps = round(period / step)
        if self._substeps < 1 or abs(self._substeps * step - period) > 1e-6:
            raise EngineError(f"an agent step of {period:g} s is not a whole number of control steps of {step:g} s")
        engine = core.engine
        self._clean = engine.compile(self._clean_fn)
        self._rows = engine.compile(self._rows_fn)
        self._evaluate = engine.compile(self._evaluate_fn)
        self._evaluate_first = engine.compile(self._evaluate_first_fn)
        self._step = engine.program(self.step_fn, self.check, donate_argnums=0)
        self._reset = engine.program(self.reset_fn, self.check, donate_argnums=0)
        self._autoreset = engine.program(self.step_autoreset_fn, self.check, donate_argnums=0)
        self._start = engine.program(self._start_fn, donate_argnums=0)
        self._load = engine.program(self._load_fn, donate_argnums=0)
        self._resume = engine.program(self._begun, core.check)

    def __repr__(self) -> str:
        count = f"{self.num_worlds} world{'s' * (self.num_worlds != 1)}"
        return f"Environment('{self.task.name}', robot '{self.robot}', {count}, engine '{self.core.engine.name}')"

    @property
    def pure(self) -> bool:
        """`step_fn`, `step_autoreset_fn` and `reset_fn` may be part of a compiled program of the caller's."""
        return self.core.engine.pure

    @property
    def mj_model(self) -> mujoco.MjModel:
        """The compiled model of the home with its robots, as MuJoCo and MJX-based libraries take it."""
        return self.scene.model

    def prepare_devices(self, devices: Sequence[Any]) -> None:
        """Allocates memory on other devices of this process, before programs for them are compiled."""
        self.core.engine.prepare_devices(devices)
        self._observer.prepare_devices(devices)

    @property
    def action_space(self) -> Space:
        """Of one world."""
        return Space((self._map.size,), np.float32, -1.0, 1.0)

    @property
    def action_map(self) -> ActionMap:
        """From the environment's actions to those of the task's robot."""
        return self._map

    def with_horizon(self, horizon: int) -> Environment:
        """The same environment, on the same core, with longer or shorter episodes."""
        parts = (self.robot, self.scene, self.core, self._map, self.objective, self._observer, self.grasping)
        config = dataclasses.replace(self.config, horizon=horizon)
        task = dataclasses.replace(self.task, horizon=horizon)
        return Environment(task, *parts, self._companions, self.period, config)

    # Steps.

    def step(self, state: EnvState, action: Array) -> EnvState:
        """One agent step of every world, the finished ones included.

        Args:
          action: [W, n], -1..1; clipped. Numbers of an array of JAX that are not finite are counted and treated as 0.

        Raises:
          ActionError: the action has another shape, is not of numbers, or is NumPy's and has some that are not finite.
          InputError: a reward of the user's is not finite (on the native engine).
        """
        return self._sound(self._step(checked_state(state), checked_action(self, action)))

    def _sound(self, state: EnvState) -> EnvState:
        """The state after a step. Raises InputError: a reward of the user's is not finite, on the native engine."""
        if self._own is not None and not self.pure and not np.isfinite(np.asarray(state.reward)).all():
            self._own.refuse_nonfinite(state.info)
        return state

    def step_fn(self, state: EnvState, action: Float[Array, "W n"]) -> EnvState:
        """`step`, neither checked nor compiled."""
        world = state.batch.world
        robots, bad = self._clean(action, world.key, world.step)
        batch, status = self.core.repeat_action_fn(state.batch, robots, self._substeps)
        seen = self._evaluate(StepContext.of(batch, action), status, state.measures, bad)
        return self._state(batch, seen, state.bad_actions + bad, state)

    def step_autoreset(self, state: EnvState, action: Array) -> EnvState:
        """`step`, and a new episode at once where one is over (Gymnasium's SAME_STEP).

        Observations of worlds that are done are those of their new episodes. The last observations of the episodes that
        ended are `info["final_obs"]`, by name. Reward, `terminated`, `truncated` and the rest of `info` are of the
        episode that ended. A compiled loop calls either this or `step`, because `info` has one more key here.
        """
        return self._sound(self._autoreset(checked_state(state), checked_action(self, action)))

    def step_autoreset_fn(self, state: EnvState, action: Float[Array, "W n"]) -> EnvState:
        """`step_autoreset`, neither checked nor compiled."""
        after = self.step_fn(state, action)
        new = self.core.engine.when_any(after.done, lambda same: self.reset_fn(same, same.done), after)
        info = {**after.info, "final_obs": after.obs}
        return dataclasses.replace(
            new, reward=after.reward, terminated=after.terminated, truncated=after.truncated, info=info
        )

    # Episodes.

    def reset(self, seed: Seed | EnvState = 0, mask: Bool[Array, "W"] | None = None) -> EnvState:
        """All worlds at the start of their first episode; or a new episode in some worlds.

        Args:
          seed: of everything random (see `seeds.Seed`); or a state, of which the masked worlds are reset.
          mask: with a state: which worlds; None: all. Each new episode begins with a random row of the pool, which
            belongs to seed, world and episode.

        Raises:
          EngineError: not a seed, or a mask without a state. ActionError: not a truth value for each world.
        """
        if isinstance(seed, EnvState):
            mask = np.ones(self.num_worlds, bool) if mask is None else mask
            return self._reset(seed, checked_mask(mask, self.num_worlds))
        if mask is not None:
            raise EngineError("a mask resets worlds of a state: reset(state, mask); a seed starts all of them")
        compile_together(self.pending_programs(seed))
        with GC_PAUSED:
            return self._start(self.core.engine.reset(), as_seed(seed, self.num_worlds))

    def pending_programs(self, seed: Seed = 0) -> list[Traced]:
        """The programs of `reset(seed)`, traced and not compiled, while the engine's kernels are being loaded; empty:
        nothing is gained by compiling them beforehand. The first one returns the state, so that a program which steps
        it can be traced, too, and all of them compiled together (`ig2mj.process.gc_pause.compile_together`).
        """
        physics = self.core.engine.pending_reset_program()
        return (
            [] if physics is None else [self._start.traced(physics.returned, as_seed(seed, self.num_worlds)), physics]
        )

    def _start_fn(self, physics: Physics, seed: Seeds) -> EnvState:
        batch = self.core.start_fn(physics, seed)
        return self._begun(batch, jnp.ones(self.num_worlds, bool), None)

    def start_from(self, rows: Int[np.ndarray, "W"], seed: Seed = 0) -> EnvState:
        """All worlds at the start of an episode from these rows of the pool, so that each can be played once.

        Raises:
          EngineError: not one row for each world, or a row that the pool does not have.
        """
        size = self.core.starts.pool.size
        rows = np.asarray(rows)
        if rows.shape != (self.num_worlds,) or rows.min() < 0 or rows.max() >= size:
            raise EngineError(f"start_from takes {self.num_worlds} rows, each from 0 to {size - 1}")
        return self._loaded(seed, None, None, rows.astype(np.int32))

    def start_with(
        self, starts: Pool, draw: Draw | None = None, rows: Int[np.ndarray, "W"] | None = None, seed: Seed = 0
    ) -> EnvState:
        """All worlds at the start of an episode from states of their own, whatever the pool has.

        Args:
          starts: W rows, with fields of the model where worlds differ in them. draw: what was drawn for these episodes;
            None: what the seed says. rows: numbers that the episodes count as; None: 0.

        Raises:
          EngineError: not one row for each world, or of another scene, or `draw` has other axes than the environment.
        """
        if starts.size != self.num_worlds:
            raise EngineError(f"start_with takes {self.num_worlds} start states, not {starts.size}")
        rows = np.zeros(self.num_worlds, np.int32) if rows is None else np.asarray(rows, np.int32)
        return self._loaded(seed, starts, None if draw is None else jax.tree.map(jnp.asarray, draw), rows)

    def start_programs(
        self,
        starts: Pool | None = None,
        draw: Draw | None = None,
        rows: Int[np.ndarray, "W"] | None = None,
        seed: Seed = 0,
    ) -> list[Traced]:
        """The programs of `start_with`, without `starts` those of `start_from`, and those that follow (`following`):
        traced and not compiled, as `pending_programs`."""
        rows = np.zeros(self.num_worlds, np.int32) if rows is None else np.asarray(rows, np.int32)
        draw = None if draw is None else jax.tree.map(jnp.asarray, draw)
        physics = self.core.engine.pending_reset_program()
        if physics is None:
            return []
        load = self._load.traced(physics.returned, as_seed(seed, self.num_worlds), starts, draw, rows)
        return [*(() if self.following is None else self.following(load.returned)), load, physics]

    def _loaded(self, seed: Seed, starts: Pool | None, draw: Draw | None, rows: Int[np.ndarray, "W"]) -> EnvState:
        """`start_from`, or with states `start_with`. While kernels are being loaded, its programs are compiled together
        with those that follow."""
        compile_together(self.start_programs(starts, draw, rows, seed))
        with GC_PAUSED:
            return self._load(self.core.engine.reset(), as_seed(seed, self.num_worlds), starts, draw, rows)

    def _load_fn(
        self, physics: Physics, seed: Seeds, starts: Pool | None, draw: Draw | None, rows: Int[Array, "W"]
    ) -> EnvState:
        batch, own = self.core.start_fn(physics, seed), self.core.starts
        key = batch.world.key
        starts, usual = own.rows(jnp.asarray(rows), key) if starts is None else own.drawn(starts, key)
        if draw is not None and _shapes(draw) != _shapes(usual):
            raise EngineError("the draw has other axes or numbers of worlds than the environment (randomize=...)")
        draw = usual if draw is None else draw
        batch = dataclasses.replace(self.core.load_fn(batch, starts.physics, starts.states), draw=draw)
        return self._begun(batch, jnp.ones(self.num_worlds, bool), None, rows)

    def resume(
        self,
        batch: Batch,
        rows: Int[np.ndarray, "W"],
        mask: Bool[Array, "W"] | None = None,
        before: EnvState | None = None,
    ) -> EnvState:
        """The environment's state for worlds that were changed outside of it, in episodes of these rows of the pool.

        Args:
          mask, before: only the masked worlds are taken from `batch`, the others from `before`. None: all are.
        """
        mask = np.ones(self.num_worlds, bool) if mask is None else np.asarray(mask)
        return self._resume(batch, mask, before, np.asarray(rows, np.int32))

    def reset_fn(self, state: EnvState, mask: Bool[Array, "W"]) -> EnvState:
        """`reset` of the masked worlds, not compiled."""
        mask = jnp.asarray(mask)
        state = dataclasses.replace(state, info={k: v for k, v in state.info.items() if k != "final_obs"})
        return self._begun(self.core.reset_fn(state.batch, mask), mask, state)

    def _begun(
        self,
        batch: Batch,
        mask: Bool[Array, "W"],
        before: EnvState | None,
        rows: Int[Array, "W"] | None = None,
    ) -> EnvState:
        """After a reset of the masked worlds, to these rows of the pool; None: those that were sampled for them. The
        other worlds are as before."""
        old = (
            None
            if before is None
            else SeenState(**{f.name: getattr(before, f.name) for f in dataclasses.fields(SeenState)})
        )
        if rows is None:
            rows = self._rows(batch.world.key)
        seen = self._evaluate_first(StepContext.of(batch), rows, mask, old)
        count = jnp.zeros(self.num_worlds, jnp.int32) if before is None else before.bad_actions
        return self._state(batch, seen, count, before, mask)

    def _state(
        self, batch: Batch, seen: SeenState, bad: Int[Array, "W"], before: EnvState | None, begun: Array | None = None
    ) -> EnvState:
        """A state with its images. `begun`: worlds that were reset since `before`; the others keep its images."""
        last = None if before is None else (before.obs, before.memory)
        images, memory = self._observer.images(batch.world, batch.controllers[0], last, begun, batch.draw)
        obs = {name: {**seen.obs, **images}[name] for name in self.observation_spaces}
        of_step = (seen.reward, seen.terminated, seen.truncated, seen.info, seen.measures, seen.status)
        return EnvState(batch, obs, *of_step, bad.astype(jnp.int32), memory)

    # What is computed after physics. Pure.

    def _clean_fn(
        self, action: Float[Array, "W n"], key: UInt[Array, "W 2"], control_steps: Int[Array, "W"]
    ) -> tuple[Float[Array, "W m"], Int[Array, "W"]]:
        """All robots' actions, and how many numbers of the given one were not finite."""
        action = jnp.asarray(action, jnp.float32)
        fine = jnp.isfinite(action)
        robots = self._map(jnp.where(fine, action, 0.0))
        if self._companions is not None:
            others = self._companions(jnp.asarray(key), jnp.asarray(control_steps) // self._substeps)
            robots = jnp.concatenate([robots, others], axis=1)
        return robots, (~fine).sum(1).astype(jnp.int32)

    def _rows_fn(self, key: UInt[Array, "W 2"]) -> Int[Array, "W"]:
        return pick_rows(key, self.core.starts.pool.size)

    def _evaluate_fn(
        self, context: StepContext, status: GoalStatus, before: Measures, bad: Int[Array, "W"]
    ) -> SeenState:
        """What follows from a step: reward, ends of episodes, observations that need no images.

        Args:
          status: of the task's goal. before: measures of the last step. bad: numbers of the action that were not
            finite.
        """
        now = self.objective.measure(context.view, context.states, status, None, before, context.action)
        sound = context.flags == 0
        terms = {
            name: jnp.where(sound, term if self._own is not None else jnp.nan_to_num(term), 0.0)
            for name, term in self.objective.rewards(before, now).items()
        }
        success, over = self.objective.ended(now, status)
        success, steps = success & sound, context.control_steps // self._substeps
        terminated = over & sound
        truncated = ~terminated & (~sound | (steps >= self.task.horizon))
        info = {"success": success, "steps": steps, "bad_actions": bad, "flags": context.flags}
        return self._seen(context, status, now, terms, terminated, truncated, info)

    def _evaluate_first_fn(
        self, context: StepContext, rows: Int[Array, "W"], mask: Bool[Array, "W"], before: SeenState | None
    ) -> SeenState:
        """The same at the start of episodes in the masked worlds; the others keep `before`.

        Args:
          rows: of the pool, with which the episodes begin.
        """
        view, states = context.view, context.states
        status = self._goal.status(states, view) if self._goal is not None else GoalStatus.empty(self.num_worlds)
        now = self.objective.measure(view, states, status, rows)
        zero = jnp.zeros(self.num_worlds, jnp.int32)
        none, terms = zero.astype(bool), {name: zero.astype(jnp.float32) for name in self.objective.terms}
        steps = context.control_steps // self._substeps
        info = {"success": none, "steps": steps, "bad_actions": zero, "flags": zero}
        new = self._seen(context, status, now, terms, none, none, info)
        if before is None:
            return new
        return select_worlds(mask, new, dataclasses.replace(before, obs={name: before.obs[name] for name in new.obs}))

    def _seen(
        self,
        context: StepContext,
        status: GoalStatus,
        measures: Measures,
        terms: Mapping[str, Array],
        terminated: Bool[Array, "W"],
        truncated: Bool[Array, "W"],
        info: Mapping[str, Array],
    ) -> SeenState:
        """Observations and `info`. `terms`: of the reward. `info`: "success", "steps", "bad_actions", "flags"."""
        info = {
            "success": info["success"],
            **self.objective.info(context.view, measures, status),
            **{name: info[name] for name in ("steps", "bad_actions", "flags")},
            **{f"reward/{name}": term for name, term in terms.items()},
        }
        time_left = 1.0 - info["steps"].astype(jnp.float32) / self.task.horizon
        obs = self._observer.vectors(context, measures, status, time_left)
        total = jnp.stack([terms[name] for name in self.objective.terms]).sum(0)
        return SeenState(obs, total, terminated, truncated, info, measures, status)

    def metrics(self, state: EnvState) -> dict[str, int]:
        """Episodes begun, worlds flagged by `guards.Flag`, and numbers of actions that were not finite. On the host."""
        return {**self.core.metrics(state.batch), "bad_actions": int(np.asarray(state.bad_actions).sum())}

    def close(self) -> None:
        """Does nothing, since an environment holds no open resources. May be called twice."""


def _shapes(draw: Draw) -> tuple[Any, list[tuple[int, ...]]]:
    """Which fields are given, and their shapes."""
    leaves, given = jax.tree.flatten(draw)
    return given, [np.shape(leaf) for leaf in leaves]
