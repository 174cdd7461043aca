"""skrl's PPO through Gymnasium's face: `pip install skrl torch`, then `python examples/skrl_ppo.py`."""

from __future__ import annotations

import argparse
from typing import Any

import gymnasium
import torch
from skrl.agents.torch.ppo import PPO, PPO_CFG
from skrl.envs.wrappers.torch import wrap_env
from skrl.memories.torch import RandomMemory
from skrl.models.torch import DeterministicMixin, GaussianMixin, Model
from skrl.resources.preprocessors.torch import RunningStandardScaler
from skrl.trainers.torch import SequentialTrainer
from skrl.utils import set_seed
from torch import nn

import ig2mj.envs.gymnasium  # noqa: F401  makes the environments known to Gymnasium


def body(seen: int, out: int) -> nn.Sequential:
    return nn.Sequential(nn.Linear(seen, 128), nn.ELU(), nn.Linear(128, 128), nn.ELU(), nn.Linear(128, out))


class Policy(GaussianMixin, Model):
    def __init__(self, **spaces: Any):
        Model.__init__(self, **spaces)
        GaussianMixin.__init__(self, clip_actions=True)
        self.net = body(self.num_observations, self.num_actions)
        self.log_std = nn.Parameter(torch.full((self.num_actions,), -1.0))

    def compute(self, inputs: dict[str, Any], role: str = "") -> tuple[torch.Tensor, dict[str, Any]]:
        return self.net(inputs["observations"]), {"log_std": self.log_std}


class Value(DeterministicMixin, Model):
    def __init__(self, **spaces: Any):
        Model.__init__(self, **spaces)
        DeterministicMixin.__init__(self)
        self.net = body(self.num_observations, 1)

    def compute(self, inputs: dict[str, Any], role: str = "") -> tuple[torch.Tensor, dict[str, Any]]:
        return self.net(inputs["observations"]), {}


def trained(task: str, worlds: int, steps: int, seed: int = 0, **options: Any) -> PPO:
    """PPO after so many steps of every world, with a progress bar. `options`: of `ig2mj.make`."""
    set_seed(seed)
    env = wrap_env(gymnasium.make_vec(f"ig2mj/{task}-v0", num_envs=worlds, **options), wrapper="gymnasium")
    spaces = {"observation_space": env.observation_space, "action_space": env.action_space, "state_space": None}
    models = {"policy": Policy(**spaces, device=env.device), "value": Value(**spaces, device=env.device)}
    settings = PPO_CFG(
        rollouts=32,
        learning_epochs=4,
        mini_batches=4,
        discount_factor=0.98,
        entropy_loss_scale=1e-3,
        time_limit_bootstrap=True,
        observation_preprocessor=RunningStandardScaler,
        observation_preprocessor_kwargs={"size": env.observation_space, "device": env.device},
    )
    settings.experiment.write_interval = settings.experiment.checkpoint_interval = 0
    memory = RandomMemory(memory_size=settings.rollouts, num_envs=worlds, device=env.device)
    agent = PPO(models=models, memory=memory, **spaces, device=env.device, cfg=settings)
    training = {"timesteps": steps, "headless": True, "close_environment_at_exit": False}
    SequentialTrainer(env=env, agents=agent, cfg=training).train()
    return agent


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--task", default="PointNavigation")
    parser.add_argument("--worlds", type=int, default=16)
    parser.add_argument("--steps", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    trained(arguments.task, arguments.worlds, arguments.steps, arguments.seed)
