"""Stable-Baselines3 in ig2mj: `pip install stable-baselines3`, then `python examples/sb3_ppo.py`.

`Worlds` is all that is needed between the two: SB3's `VecEnv` over a batch that begins its episodes itself.
"""

from __future__ import annotations

import argparse
import sys
import time
from typing import Any

import numpy as np
from gymnasium import spaces
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.vec_env import VecEnv, VecMonitor, VecNormalize

import ig2mj
from ig2mj.envs.arrays import NumpyEnv


class Worlds(VecEnv):
    """All worlds of an environment as SB3 takes them: one vector of observations for each."""

    def __init__(self, env: Any):
        """`env`: of `ig2mj.make`."""
        self._env, self._names = NumpyEnv(env), sorted(env.observation_spaces)
        size = sum(env.observation_spaces[name].shape[0] for name in self._names)
        seen, acts = spaces.Box(-np.inf, np.inf, (size,), np.float32), spaces.Box(-1.0, 1.0, env.action_space.shape)
        self.render_mode, self._seed = None, 0
        super().__init__(env.num_worlds, seen, acts)

    def _flat(self, obs: dict[str, Any]) -> np.ndarray:
        return np.concatenate([obs[name] for name in self._names], axis=1)

    def reset(self) -> np.ndarray:
        return self._flat(self._env.reset(seed=self._seed)[0])

    def step_async(self, actions: np.ndarray) -> None:
        self._actions = actions

    def step_wait(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, list[dict[str, Any]]]:
        obs, reward, terminated, truncated, info = self._env.step(self._actions)
        done, last = terminated | truncated, self._flat(info["final_obs"])
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        for world in np.flatnonzero(done):
            infos[world] = {
                "terminal_observation": last[world],
                "TimeLimit.truncated": bool(truncated[world]),
                "is_success": bool(info["success"][world]),
            }
        return self._flat(obs), np.array(reward, np.float32), np.array(done), infos

    def seed(self, seed: int | None = None) -> list[int | None]:
        self._seed = 0 if seed is None else seed
        return [seed] * self.num_envs

    def close(self) -> None:
        pass

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        return [getattr(self, attr_name)] * len(list(self._get_indices(indices)))

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        raise NotImplementedError("the worlds are one batch, without attributes of their own")

    def env_method(self, method_name: str, *args: Any, indices: Any = None, **kwargs: Any) -> list[Any]:
        raise NotImplementedError("the worlds are one batch, without methods of their own")

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
        return [False] * len(list(self._get_indices(indices)))


class Progress(BaseCallback):
    """A line on stderr every few seconds: how many steps are done, the last episodes, how long it may take."""

    EVERY = 3.0

    def __init__(self, steps: int):
        super().__init__()
        self._steps = steps

    def _on_training_start(self) -> None:
        self._began = self._told = time.monotonic()

    def _on_step(self) -> bool:
        now = time.monotonic()
        if now - self._told >= self.EVERY:
            self._told, seconds, done = now, now - self._began, self.num_timesteps
            ended = list(self.model.ep_info_buffer or [])
            words = f"mean return {np.mean([e['r'] for e in ended]):.3f}" if ended else "no episode has ended yet"
            left = seconds * max(self._steps - done, 0) / done
            line = f"{done:,} of {self._steps:,} steps, {words}, {done / seconds:,.0f} steps/s, about {left:.0f} s left"
            print(line, file=sys.stderr, flush=True)
        return True


def trained(task: str, worlds: int, steps: int, **options: Any) -> PPO:
    """PPO after so many agent steps of all worlds together. `options`: of `ig2mj.make`."""
    env = VecNormalize(VecMonitor(Worlds(ig2mj.make(task, worlds=worlds, **options))))
    model = PPO("MlpPolicy", env, n_steps=64, batch_size=256, gamma=0.98, learning_rate=1e-3, device="cpu")
    return model.learn(steps, callback=Progress(steps))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--task", default="PointNavigation")
    parser.add_argument("--worlds", type=int, default=16)
    parser.add_argument("--steps", type=int, default=200_000)
    arguments = parser.parse_args()
    model = trained(arguments.task, arguments.worlds, arguments.steps)
    print(model.ep_info_buffer[-1] if model.ep_info_buffer else "no episode has ended")
