"""Gymnasium's face: `gymnasium.make("ig2mj/CookingMeat-v0")` and `gymnasium.make_vec(...)`.

`import gymnasium, ig2mj` makes the environments known to Gymnasium, in that order, and `import ig2mj.envs.gymnasium` in
any. Without an import: `gymnasium.make("ig2mj.envs.gymnasium:ig2mj/CookingMeat-v0")`. Keyword arguments go to
`ig2mj.make`: `robot=`, `grasping=`, `engine=`, `observations=`, ...

The vector environment has the three autoreset modes: `autoreset_mode="same_step"` (what was seen last is
`info["final_obs"]`), "next_step" (the default), and "disabled" (`reset(options={"reset_mask": mask})`).

All arrays are fresh in every step, never buffers that are used again.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any, ClassVar

import gymnasium
import jax
import numpy as np
from gymnasium import spaces
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space

from ig2mj.envs import names
from ig2mj.envs.environment import Environment, EnvState
from ig2mj.envs.observations import Space
from ig2mj.envs.registry import make
from ig2mj.errors import ActionError

STEPS_PER_SECOND = 10
"""Agent steps of a simulated second, for films."""


def gym_space(space: Space) -> spaces.Box:
    """Gymnasium's space."""
    return spaces.Box(space.low, space.high, space.shape, space.dtype)


def _spaces(env: Environment) -> tuple[gymnasium.Space, gymnasium.Space]:
    observations: dict[str, spaces.Space[Any]] = {
        name: gym_space(space) for name, space in env.observation_spaces.items()
    }
    return spaces.Dict(observations), gym_space(env.action_space)


class GymEnv(gymnasium.Env):
    """One world. Attributes: env: the environment underneath. state: its state, None before the first reset."""

    metadata: ClassVar[dict[str, Any]] = {"render_modes": [], "render_fps": STEPS_PER_SECOND}

    def __init__(self, task: str, render_mode: str | None = None, **options: Any):
        """Arguments as `ig2mj.make`, without `worlds`."""
        self.env = make(task, worlds=1, **options)
        self.state: EnvState | None = None
        self.render_mode = render_mode
        self.observation_space, self.action_space = _spaces(self.env)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
        """A new episode. With a seed the first of that seed; else the next one of the seed before."""
        super().reset(seed=seed)
        if seed is not None or self.state is None:
            self.state = self.env.reset(int(self.np_random.integers(2**31)) if seed is None else seed)
        else:
            self.state = self.env.reset(self.env.current(self.state))
        return self._obs(), self._info()

    def step(self, action: np.ndarray) -> tuple[dict[str, np.ndarray], float, bool, bool, dict[str, Any]]:
        """One agent step of 1/10 s. Raises ActionError: a wrong shape."""
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

    def close(self) -> None:
        """May be called twice."""
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
        """Arguments as `ig2mj.make`; autoreset_mode: see the module's text."""
        self.env = make(task, worlds=num_envs, **options)
        self.state: EnvState | None = None
        self.num_envs, self.render_mode = num_envs, render_mode
        self.autoreset_mode = _mode(autoreset_mode)
        self.metadata = {"render_modes": [], "render_fps": STEPS_PER_SECOND, "autoreset_mode": self.autoreset_mode}
        self.single_observation_space, self.single_action_space = _spaces(self.env)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
        """New episodes: of all worlds, or of those of `options={"reset_mask": mask}`. One seed serves all worlds."""
        super().reset(seed=seed)
        mask = (options or {}).get("reset_mask")
        if mask is not None and self.state is not None:
            mask = np.asarray(mask, bool)
            if mask.shape != (self.num_envs,):
                raise ActionError(f"reset_mask has shape {(self.num_envs,)}, not {mask.shape}")
            self.state = self.env.reset(self.state, mask)
        elif seed is not None or self.state is None:
            self.state = self.env.reset(int(self.np_random.integers(2**31)) if seed is None else seed)
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

    def close(self, **kwargs: Any) -> None:
        """May be called twice."""
        self.env.close()

    def _info(self, info: Mapping[str, Any]) -> dict[str, Any]:
        """Gymnasium's form: beside every array the mask of the worlds that it is of."""
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
