"""RLlib's PPO through Gymnasium's interface: `pip install "ray[rllib]" torch`, then `python examples/rllib_ppo.py`.

Each runner of RLlib makes one batch of worlds (`ig2mj.envs.gymnasium.GymVectorEnv`) and steps all of them together.
"""

from __future__ import annotations

import argparse
from typing import Any

import gymnasium
import numpy as np
import ray
from ray.rllib.algorithms.algorithm import Algorithm
from ray.rllib.algorithms.ppo import PPOConfig
from ray.rllib.connectors.env_to_module import MeanStdFilter
from ray.tune.registry import register_env


class Flat(gymnasium.vector.VectorObservationWrapper):
    """All observations side by side: [W, n]."""

    def __init__(self, env: Any):
        super().__init__(env)
        width = sum(int(np.prod(space.shape)) for space in env.single_observation_space.values())
        self.single_observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (width,), np.float32)
        self.observation_space = gymnasium.vector.utils.batch_space(self.single_observation_space, env.num_envs)

    def observations(self, observations: dict[str, np.ndarray]) -> np.ndarray:
        rows = [observations[name].reshape(self.num_envs, -1) for name in sorted(observations)]
        return np.concatenate(rows, axis=1).astype(np.float32)


def make(settings: dict[str, Any]) -> gymnasium.vector.VectorEnv:
    """A batch of worlds. `settings`: the task, and options of `ig2mj.make`."""
    options = dict(settings)
    worlds, task = options.pop("num_envs", 1), options.pop("task")
    return Flat(gymnasium.make_vec(f"ig2mj:ig2mj/{task}-v0", num_envs=worlds, **options))


def trained(
    task: str, worlds: int, iterations: int, seed: int = 0, length: int = 32, runners: int = 0, **options: Any
) -> Algorithm:
    """PPO after so many iterations of `length` steps of all worlds.

    `runners`: processes that step worlds, each a batch of `worlds`; 0: this process. `options`: of `ig2mj.make`.
    """
    register_env("ig2mj", make)
    config = (
        PPOConfig()
        .environment("ig2mj", env_config={"task": task, **options})
        .env_runners(
            num_env_runners=runners,
            num_envs_per_env_runner=worlds,
            rollout_fragment_length=length,
            gym_env_vectorize_mode=gymnasium.VectorizeMode.VECTOR_ENTRY_POINT,
            env_to_module_connector=lambda env, spaces, device: MeanStdFilter(),
        )
        .training(
            gamma=0.98,
            lr=5e-4,
            train_batch_size_per_learner=worlds * length * max(runners, 1),
            minibatch_size=max(worlds * length // 4, 1),
            num_epochs=4,
        )
        .debugging(seed=seed, log_level="ERROR")
    )
    algorithm = config.build_algo()
    for iteration in range(1, iterations + 1):
        result = algorithm.train()
        found = result["env_runners"]
        print(
            f"iteration {iteration} of {iterations}: return {found.get('episode_return_mean', float('nan')):+.3f}, "
            f"{found['num_env_steps_sampled_lifetime']:.0f} steps in {result['time_total_s']:.0f} s",
            flush=True,
        )
    return algorithm


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--task", default="PointNavigation")
    parser.add_argument("--worlds", type=int, default=16)
    parser.add_argument("--iterations", type=int, default=50)
    parser.add_argument("--runners", type=int, default=0)
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    ray.init(include_dashboard=False)
    trained(arguments.task, arguments.worlds, arguments.iterations, arguments.seed, runners=arguments.runners).stop()
