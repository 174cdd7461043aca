"""`record`: an environment that records its episodes to a file.

    env = record(ig2mj.make("CookingMeat", engine="native"), "runs.h5")
    state = env.reset(0)
    state = env.step(state, action)
    env.close()

The recorded environment replaces the original everywhere: in `play`, inside the Gymnasium wrapper
(`gym_env.unwrapped.env = record(gym_env.unwrapped.env, file)`), for experts. Calls of `step_fn` and `reset_fn` inside a
compiled program are not recorded.

Axes: W worlds, n numbers of an action.
"""

from __future__ import annotations

import dataclasses
import os
import weakref
from collections.abc import Collection, Mapping
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Int

from ig2mj.demos.frames import FrameRows
from ig2mj.demos.origin import origin_of
from ig2mj.demos.writer import RunWriter
from ig2mj.engine.view import Array
from ig2mj.envs.environment import Environment, EnvState
from ig2mj.errors import EngineError
from ig2mj.process import entry_point
from ig2mj.worlds.random_streams import Seed, as_seed, pick_rows


@entry_point
class RecordedEnvironment(Environment):
    """An environment with a file.

    Attributes:
      writer: of the file.
      devices: readings of a person's devices, [W, ...] by name; written with the next step as `devices/<name>`.
      label: action that an expert would take, [W, n]; written with the next step where labels are recorded.
    """

    def __init__(
        self,
        env: Environment,
        file: str | os.PathLike,
        worlds: Collection[int] | None = None,
        devices: Mapping[str, np.ndarray] | None = None,
        past_success: bool = False,
        labels: bool = False,
        observations: bool = False,
    ):
        """See `record`."""
        for name, value in vars(env).items():
            setattr(self, name, value)
        self._inner, self._file = env, file
        self._worlds = list(range(env.num_worlds)) if worlds is None else sorted(worlds)
        if self._worlds and not 0 <= self._worlds[0] <= self._worlds[-1] < env.num_worlds:
            raise EngineError(f"worlds to record are from 0 to {env.num_worlds - 1}")
        self._last: EnvState | None = None
        self.writer: RunWriter | None = None
        self.devices: dict[str, np.ndarray] = dict(devices or {})
        self._device_names, self._past_success = list(self.devices), past_success
        size = (env.num_worlds, *env.action_space.shape)
        self.label: np.ndarray | None = np.zeros(size, np.float32) if labels else None
        self._observed = list(env.observation_spaces) if observations else []
        self._succeeded, self._completed = np.zeros((2, env.num_worlds), bool)

    def step(self, state: EnvState, action: Array) -> EnvState:
        """As `Environment.step`."""
        if state is not self._last:
            self._begin(state, np.ones(self.num_worlds, bool), {})
        given = np.array(action, np.float32)
        after = self._inner.step(state, action)
        self._note(given, after)
        return after

    def step_autoreset(self, state: EnvState, action: Array) -> EnvState:
        """As `Environment.step_autoreset`."""
        after = self.step(state, action)
        kept = {name: getattr(after, name) for name in ("obs", "reward", "terminated", "truncated", "info")}
        kept = self.core.engine.copied(kept)  # the reset consumes the state
        done = np.asarray(after.done)
        new = self.reset(after, done) if done.any() else after
        info = {**kept.pop("info"), "final_obs": kept.pop("obs")}
        self._last = dataclasses.replace(new, info=info, **kept)
        return self._last

    def reset(self, seed: Seed | EnvState = 0, mask: Bool[Array, "W"] | None = None) -> EnvState:
        """As `Environment.reset`."""
        if not isinstance(seed, EnvState):
            return self._begin(self._inner.reset(seed), np.ones(self.num_worlds, bool), self._seeds(seed))
        chosen = np.ones(self.num_worlds, bool) if mask is None else np.asarray(mask, bool)
        if seed is not self._last:
            chosen = np.ones_like(chosen)
        return self._begin(self._inner.reset(seed, mask), chosen, {})

    def start_from(self, rows: Int[np.ndarray, "W"], seed: Seed = 0) -> EnvState:
        """As `Environment.start_from`."""
        state = self._inner.start_from(rows, seed)
        return self._begin(state, np.ones(self.num_worlds, bool), self._seeds(seed), np.asarray(rows))

    def begin_runs(
        self, state: EnvState, rows: Int[np.ndarray, "W"], worlds: Collection[int] | None = None
    ) -> EnvState:
        """Begins runs at a state of the environment that is recorded, such as one of its `resume`.

        Args:
          rows: of the pool, of all worlds. worlds: in which runs begin; None: all.
        """
        mask = np.ones(self.num_worlds, bool) if worlds is None else np.isin(np.arange(self.num_worlds), list(worlds))
        return self._begin(state, mask, {}, np.asarray(rows))

    def end_run(self, world: int, **attributes: Any) -> None:
        """Ends the run of a world, if there is one. `attributes`: of the run, such as `success`."""
        if self.writer is not None:
            self.writer.end(world, **attributes)

    def close(self) -> None:
        """Ends all runs, and closes the file; may be called twice."""
        if self.writer is not None:
            if self._past_success:
                for world in self._worlds:
                    how = {"success": bool(self._succeeded[world]), "complete": bool(self._completed[world])}
                    self.writer.end(world, terminated=False, **how)
            self.writer.close()
        self._inner.close()

    def __enter__(self) -> RecordedEnvironment:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def _begin(
        self, state: EnvState, mask: np.ndarray, about: dict[str, np.ndarray], rows: np.ndarray | None = None
    ) -> EnvState:
        """New runs in the masked worlds."""
        if self.writer is None:
            self._rows = FrameRows(self.core.engine, self._worlds, state)
            steps = ["action", *([] if self.label is None else ["label"])]
            steps += ["reward/total", "terminated", "truncated", "success"]
            steps += [f"reward/{name}" for name in self.objective.terms]
            steps += [f"devices/{name}" for name in self._device_names]
            names = (self._rows.own, self._rows.batched, steps)
            self.writer = RunWriter(self._file, origin_of(self._inner), *names, self._worlds, self._observed)
            weakref.finalize(self, self.writer.close)
        begun = [world for world in self._worlds if mask[world]]
        self._last = state
        if not begun:
            return state
        if rows is None:
            rows = np.asarray(pick_rows(jnp.asarray(state.batch.world.key), self.core.starts.pool.size))
        episode = np.asarray(state.batch.episode)
        self._succeeded[begun] = self._completed[begun] = False
        about = {"episode": episode, "row": rows, **about}
        runs = {w: {name: int(of_worlds[w]) for name, of_worlds in about.items()} for w in begun}
        self.writer.begin(runs, *self._frame(state))
        return state

    def _frame(self, state: EnvState) -> tuple[list[list[np.ndarray]], list[Any]]:
        """Blocks of each recorded world, and arrays of all worlds, with the recorded observations last."""
        own, batched = self._rows(state)
        return own, [*batched, *(np.array(state.obs[name]) for name in self._observed)]

    def _seeds(self, seed: Seed) -> dict[str, np.ndarray]:
        return {"seed": np.broadcast_to(np.asarray(as_seed(seed, self.num_worlds)), (self.num_worlds,))}

    def _note(self, action: np.ndarray, state: EnvState) -> None:
        """A frame of all worlds, and the ends of runs."""
        assert self.writer is not None
        terms = (state.info[f"reward/{name}"] for name in self.objective.terms)
        said = (self.devices[name] for name in self._device_names)
        steps = [state.reward, state.terminated, state.truncated, state.info["success"], *terms, *said]
        label = [] if self.label is None else [np.array(self.label, np.float32)]
        self.writer.add(*self._frame(state), [action, *label, *self.core.engine.kept(steps)])
        terminated, truncated = np.asarray(state.terminated), np.asarray(state.truncated)
        if self._past_success:
            self._succeeded |= np.asarray(state.info["success"])
            self._completed |= terminated | truncated
        elif terminated.any() or truncated.any():
            success = np.asarray(state.info["success"])
            for world in self._worlds:
                if terminated[world] or truncated[world]:
                    how = {"terminated": bool(terminated[world]), "truncated": bool(truncated[world])}
                    self.writer.end(world, success=bool(success[world]), complete=True, **how)
        self._last = state


@entry_point
def record(
    env: Environment,
    file: str | os.PathLike,
    worlds: Collection[int] | None = None,
    devices: Mapping[str, np.ndarray] | None = None,
    past_success: bool = False,
    labels: bool = False,
    observations: bool = False,
) -> RecordedEnvironment:
    """An environment that records its episodes, from its next reset on.

    Args:
      file: HDF5; an existing file is replaced. At most `writer.FLUSH` frames of each world are buffered.
      worlds: indices of the recorded worlds; None: all.
      devices: arrays [W, ...] with the names, shapes and types of the readings of a person's devices
        (`RecordedEnvironment.devices`); None: no devices.
      past_success: a run continues past success and failure of the episode, until a reset or `close`.
      labels: record an expert's action for every step (`RecordedEnvironment.label`).
      observations: record the observations of every frame, so that learning needs no replay.

    Raises:
      EngineError: no such worlds. InputError, at the first reset: the file cannot be written.
    """
    return RecordedEnvironment(env, file, worlds, devices, past_success, labels, observations)
