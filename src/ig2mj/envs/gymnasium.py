"""Gymnasium's interface: `gymnasium.make("ig2mj/CookingMeat-v0")` and `gymnasium.make_vec(...)`.

Environments are registered once ig2mj is imported, before Gymnasium or after. Gymnasium imports a module that the name
begins with: `gymnasium.make("ig2mj:ig2mj/CookingMeat-v0")`. Keyword arguments go to `ig2mj.make`: `robot=`,
`grasping=`, `engine=`, `observations=`, ...

With `render_mode="rgb_array"`, `render()` gives an image of the world from next to the robot (of each world, for a
vector environment), [480, 640, 3], as `gymnasium.wrappers.RecordVideo` takes it.

The vector environment has the three autoreset modes: `autoreset_mode="same_step"` (the last observation is
`info["final_obs"]`), "next_step" (the default), and "disabled" (`reset(options={"reset_mask": mask})`).

Gymnasium's `vectorization_mode="async"` needs `vector_kwargs={"context": "spawn"}`: JAX does not run in processes that
were forked. The vector environment is faster, since its worlds are one batch.

All arrays are new in every step; no buffer is reused.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import gymnasium
import jax
import numpy as np
from gymnasium import spaces
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space

from ig2mj.agents.base import ACTION_PERIOD
from ig2mj.envs import names
from ig2mj.envs.environment import Environment, EnvState
from ig2mj.envs.observations import Space
from ig2mj.envs.registry import make
from ig2mj.errors import ActionError, EngineError, UnknownNameError
from ig2mj.process.entry import refuse_fork
from ig2mj.worlds.random_streams import as_seed
from ig2mj.worlds.starts import checked_mask

RENDER_MODES = ("rgb_array",)


def gym_space(space: Space) -> spaces.Box:
    """Gymnasium's space."""
    return spaces.Box(space.low, space.high, space.shape, space.dtype)


def _spaces(env: Environment) -> tuple[gymnasium.Space, gymnasium.Space]:
    observations: dict[str, spaces.Space[Any]] = {
        name: gym_space(space) for name, space in env.observation_spaces.items()
    }
    return spaces.Dict(observations), gym_space(env.action_space)


def _metadata(period: float) -> dict[str, Any]:
    return {"render_modes": list(RENDER_MODES), "render_fps": round(1 / period, 3)}


def _checked(render_mode: str | None) -> str | None:
    if render_mode is not None and render_mode not in RENDER_MODES:
        raise UnknownNameError("render mode", render_mode, RENDER_MODES)
    return render_mode


def _begun(state: EnvState | None) -> EnvState:
    if state is None:
        raise gymnasium.error.ResetNeeded("reset the environment before its first image")
    return state


class _NoSpace(spaces.Dict):
    """The space of an environment that cannot run in this process: comparing it raises the reason.

    Gymnasium's asynchronous workers hand errors to the calling process from their first comparison of spaces on, and
    not from where they make environments.
    """

    def __eq__(self, other: object) -> bool:
        refuse_fork()
        return False

    __hash__ = None  # pyright: ignore[reportAssignmentType]


class GymEnv(gymnasium.Env):
    """One world. Attributes: env: the environment underneath. state: its state, None before the first reset."""

    metadata: dict[str, Any] = _metadata(ACTION_PERIOD)

    def __init__(self, task: str, render_mode: str | None = None, **options: Any):
        """Arguments as `ig2mj.make`, without `worlds`. render_mode: "rgb_array", or None."""
        self.state: EnvState | None = None
        self.render_mode = _checked(render_mode)
        self.env: Environment
        if "worlds" in options or "num_envs" in options:
            raise EngineError("gymnasium.make makes one world; many are gymnasium.make_vec(..., num_envs=4)")
        try:
            refuse_fork()
        except EngineError:
            self.observation_space = self.action_space = _NoSpace()
            return
        self.env = make(task, worlds=1, **options)
        self.metadata = _metadata(self.env.period)
        self.observation_space, self.action_space = _spaces(self.env)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
        """A new episode. With a seed the first of that seed; else the next one of the seed before."""
        refuse_fork()
        super().reset(seed=seed)
        if seed is not None or self.state is None:
            self.state = self.env.reset(int(self.np_random.integers(2**31)) if seed is None else seed)
        else:
            self.state = self.env.reset(self.env.current(self.state))
        return self._obs(), self._info()

    def step(self, action: np.ndarray) -> tuple[dict[str, np.ndarray], float, bool, bool, dict[str, Any]]:
        """One agent step of `env.period` seconds. Raises ActionError: a wrong shape."""
        if self.state is None:
            raise gymnasium.error.ResetNeeded("reset the environment before its first step")
        action = np.asarray(action)
        if action.shape != self.action_space.shape:
            raise ActionError(f"an action has shape {self.action_space.shape}, not {action.shape}")
        state = self.state = self.env.step(self.state, action[None])
        reward, terminated, truncated = (
            np.asarray(a)[0].item() for a in (state.reward, state.terminated, state.truncated)
        )
        return self._obs(), float(reward), bool(terminated), bool(truncated), self._info()

    def render(self) -> np.ndarray | None:  # pyright: ignore[reportIncompatibleMethodOverride]
        """An image [480, 640, 3] of the world as it is now; None without a render mode."""
        return None if self.render_mode is None else self.env.render(_begun(self.state))

    def close(self) -> None:
        """May be called twice."""
        if hasattr(self, "env"):
            self.env.close()

    def _obs(self) -> dict[str, np.ndarray]:
        assert self.state is not None
        return {name: np.array(array[0]) for name, array in self.state.obs.items()}

    def _info(self) -> dict[str, Any]:
        assert self.state is not None
        return {name: np.asarray(array)[0].item() for name, array in self.state.info.items()}


class GymVectorEnv(gymnasium.vector.VectorEnv):
    """Many worlds. Attributes: env: the environment underneath. state: its state, None before the first reset."""

    def __init__(
        self,
        task: str,
        num_envs: int = 1,
        autoreset_mode: str | AutoresetMode = AutoresetMode.NEXT_STEP,
        render_mode: str | None = None,
        **options: Any,
    ):
        """Arguments as `ig2mj.make`; autoreset_mode: see the module's text. render_mode: "rgb_array", or None."""
        self.render_mode = _checked(render_mode)
        if "worlds" in options:
            raise EngineError(f"worlds={options['worlds']}: gymnasium.make_vec takes num_envs")
        self.env = make(task, worlds=num_envs, **options)
        self.state: EnvState | None = None
        self.num_envs = num_envs
        self.autoreset_mode = _mode(autoreset_mode)
        self.metadata = {**_metadata(self.env.period), "autoreset_mode": self.autoreset_mode}
        self.single_observation_space, self.single_action_space = _spaces(self.env)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)

    def reset(  # pyright: ignore[reportIncompatibleMethodOverride]
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
        """New episodes: of all worlds, or of those of `options={"reset_mask": mask}`.

        Args:
          seed: of all worlds; or one for each, of which each world then begins as an environment of one world does with
            its seed (None: any). None: the next episodes of the seeds before.

        Raises:
          ActionError: a mask of another shape. EngineError: not a seed for each world.
        """
        super().reset(seed=seed if seed is None or isinstance(seed, int | np.integer) else None)  # pyright: ignore
        given: Any = seed
        if isinstance(seed, Sequence | np.ndarray) and np.ndim(given):
            given = [int(self.np_random.integers(2**31)) if s is None else s for s in seed]
        mask = (options or {}).get("reset_mask")
        if mask is not None and self.state is not None:
            mask = np.asarray(checked_mask(mask, self.num_envs))
            state = self.state if seed is None else _reseeded(self.state, as_seed(given, self.num_envs), mask)
            self.state = self.env.reset(state, mask)
        elif seed is not None or self.state is None:
            self.state = self.env.reset(int(self.np_random.integers(2**31)) if seed is None else given)
        else:
            self.state = self.env.reset(self.env.current(self.state))
        return _host(self.state.obs), self._info(self.state.info)

    def step(
        self, actions: np.ndarray
    ) -> tuple[dict[str, np.ndarray], np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """One agent step of all worlds. Raises ActionError: a wrong shape."""
        before = self.state
        if before is None:
            raise gymnasium.error.ResetNeeded("reset the environment before its first step")
        if self.autoreset_mode == AutoresetMode.SAME_STEP:
            state = self.env.step_autoreset(before, actions)
        else:
            over = np.asarray(before.done)
            state = self.env.step(before, actions)
            if self.autoreset_mode == AutoresetMode.NEXT_STEP and over.any():
                state = _restarted(self.env.reset(state, over), over)
        self.state = state
        info = dict(state.info)
        final = info.pop("final_obs", None)
        found = self._info(info)
        if final is not None:
            self._add_final(found, final, np.asarray(state.done), info)
        flags = np.array(state.terminated), np.array(state.truncated)
        return _host(state.obs), np.array(state.reward, np.float64), *flags, found

    def render(self) -> tuple[np.ndarray, ...] | None:
        """An image [480, 640, 3] of each world as it is now; None without a render mode."""
        if self.render_mode is None:
            return None
        return tuple(self.env.render(_begun(self.state), world) for world in range(self.num_envs))

    def close(self, **kwargs: Any) -> None:
        """May be called twice."""
        self.env.close()

    def _info(self, info: Mapping[str, Any]) -> dict[str, Any]:
        """Gymnasium's form: with every array the mask of the worlds that it is of."""
        found: dict[str, Any] = {}
        for name, array in info.items():
            found[name] = np.array(array)
            found[f"_{name}"] = np.ones(self.num_envs, bool)
        return found

    def _add_final(self, found: dict[str, Any], final: Any, done: np.ndarray, info: Mapping[str, Any]) -> None:
        if not done.any():
            return
        found["final_obs"], found["_final_obs"] = _host(final), done
        found["final_info"], found["_final_info"] = {name: np.array(a) for name, a in info.items()}, done.copy()


def _reseeded(state: EnvState, seed: Any, mask: np.ndarray) -> EnvState:
    """A state of which the next episodes of the masked worlds are the first of other seeds."""
    batch, worlds = state.batch, np.arange(len(mask), dtype=np.int32)
    seeds = np.where(mask, np.asarray(seed), np.asarray(batch.seed)).astype(np.int32)
    number = np.where(mask, worlds if np.ndim(seed) == 0 else 0, np.asarray(batch.number)).astype(np.int32)
    episode = np.where(mask, -1, np.asarray(batch.episode)).astype(np.int32)
    return dataclasses.replace(state, batch=dataclasses.replace(batch, seed=seeds, number=number, episode=episode))


def _restarted(state: EnvState, over: np.ndarray) -> EnvState:
    """NEXT_STEP: the step of a world that was done before is its reset."""
    return dataclasses.replace(
        state,
        reward=np.where(over, 0.0, state.reward).astype(np.float32),
        terminated=np.asarray(state.terminated) & ~over,
        truncated=np.asarray(state.truncated) & ~over,
    )


def _mode(mode: str | AutoresetMode) -> AutoresetMode:
    if isinstance(mode, AutoresetMode):
        return mode
    return AutoresetMode[mode.upper()] if mode.upper() in AutoresetMode.__members__ else AutoresetMode(mode)


def _host(tree: Any) -> Any:
    return jax.tree.map(lambda a: np.array(a), tree)


names.register(gymnasium)
