"""rsl_rl's PPO in many worlds at once: `pip install rsl-rl-lib`, then `python examples/rsl_rl_ppo.py`.

Observations and actions stay on the device of the environment (`ig2mj.envs.arrays.TorchEnv`).
"""

from __future__ import annotations

import argparse
import time
from typing import Any

import torch
from rsl_rl.env import VecEnv
from rsl_rl.runners import OnPolicyRunner
from tensordict import TensorDict

import ig2mj
from ig2mj.envs.arrays import TorchEnv

NETWORK = {"class_name": "MLPModel", "hidden_dims": [128, 128], "activation": "elu", "obs_normalization": True}

ACTIONS = {"class_name": "GaussianDistribution", "init_std": 0.5}


class Worlds(VecEnv):
    """rsl_rl's interface of an environment. Worlds that are done begin again in the same step."""

    def __init__(self, env: TorchEnv, seed: int):
        self._env = env
        obs, _ = env.reset(seed=seed)
        self.device = next(iter(obs.values())).device
        self.num_envs, self.num_actions = env.num_worlds, env.action_size
        self.max_episode_length, self.cfg = env.env.task.horizon, {"task": env.env.task.name}
        self.episode_length_buf = torch.zeros(self.num_envs, dtype=torch.long, device=self.device)
        self._obs, self.reward, self.ended, self.succeeded = obs, 0.0, 0, 0

    def get_observations(self) -> TensorDict:
        vectors = [rows.flatten(1).float() for _, rows in sorted(self._obs.items())]
        return TensorDict({"policy": torch.cat(vectors, dim=1)}, batch_size=[self.num_envs], device=self.device)

    def step(self, actions: torch.Tensor) -> tuple[TensorDict, torch.Tensor, torch.Tensor, dict[str, Any]]:
        self._obs, reward, terminated, truncated, info = self._env.step(actions.clamp(-1, 1))
        done = terminated | truncated
        self.episode_length_buf = torch.where(done, 0, self.episode_length_buf + 1)
        self.reward += float(reward.mean())
        self.ended += int(done.sum())
        self.succeeded += int((info["success"] & done).sum())
        return self.get_observations(), reward.float(), done, {"time_outs": truncated & ~terminated}


def trained(task: str, worlds: int, iterations: int, seed: int = 0, length: int = 24, **options: Any) -> OnPolicyRunner:
    """PPO after so many iterations of `length` steps of all worlds. `options`: of `ig2mj.make`."""
    torch.manual_seed(seed)
    env = Worlds(TorchEnv(ig2mj.make(task, worlds=worlds, **options)), seed)
    settings = {
        "num_steps_per_env": length,
        "save_interval": 10**9,
        "obs_groups": {"actor": ["policy"], "critic": ["policy"]},
        "actor": {**NETWORK, "distribution_cfg": ACTIONS},
        "critic": dict(NETWORK),
        "algorithm": {"class_name": "PPO", "gamma": 0.98, "entropy_coef": 1e-3, "learning_rate": 5e-4},
    }
    runner, begun = OnPolicyRunner(env, settings, log_dir=None, device=str(env.device)), time.monotonic()
    for iteration in range(1, iterations + 1):
        env.reward, env.ended, env.succeeded = 0.0, 0, 0
        runner.learn(1)
        speed = iteration * length * worlds / (time.monotonic() - begun)
        print(
            f"iteration {iteration} of {iterations}: reward {env.reward / length:+.4f} a step, "
            f"{env.succeeded} of {env.ended} episodes succeeded, {speed:.0f} steps/s",
            flush=True,
        )
    return runner


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--task", default="PointNavigation")
    parser.add_argument("--worlds", type=int, default=16)
    parser.add_argument("--iterations", type=int, default=50)
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    trained(arguments.task, arguments.worlds, arguments.iterations, arguments.seed)
