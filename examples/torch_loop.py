"""A plain PyTorch loop (advantage actor-critic) in many worlds at once: `pip install torch`, then

python examples/torch_loop.py --worlds 16           # on the native engine, on a CPU
python examples/torch_loop.py --worlds 2048         # on a GPU; tensors never leave it
"""

from __future__ import annotations

import argparse
from collections.abc import Callable

import torch
from torch import Tensor, nn

import ig2mj
from ig2mj.envs.arrays import TorchEnv


class ActorCritic(nn.Module):
    """A Gaussian over actions, and the value; observations are normalized by running moments."""

    def __init__(self, seen: int, acts: int):
        super().__init__()
        self.norm = nn.BatchNorm1d(seen, momentum=0.01, affine=False)
        self.body = nn.Sequential(nn.Linear(seen, 128), nn.Tanh(), nn.Linear(128, 128), nn.Tanh())
        self.mean, self.value = nn.Linear(128, acts), nn.Linear(128, 1)
        self.log_std = nn.Parameter(torch.full((acts,), -1.0))

    def forward(self, seen: Tensor) -> tuple[torch.distributions.Normal, Tensor]:
        x = self.body(self.norm(seen))
        return torch.distributions.Normal(self.mean(x), self.log_std.exp()), self.value(x)[:, 0]


def flat(obs: dict[str, Tensor]) -> Tensor:
    """All observations side by side: [W, n]."""
    return torch.cat([obs[name] for name in sorted(obs)], dim=1)


def train(
    env: TorchEnv,
    updates: int,
    length: int = 16,
    gamma: float = 0.97,
    report: Callable[[int, float, float], None] = lambda update, reward, success: None,
) -> ActorCritic:
    """Trains for so many updates of `length` steps of all worlds. `report`: update, mean reward, successes a step."""
    obs, _ = env.reset(seed=0)
    seen = flat(obs)
    model = ActorCritic(seen.shape[1], env.action_size).to(seen.device)
    adam = torch.optim.Adam(model.parameters(), 1e-3)
    for update in range(updates):
        log_probs, values, rewards, goes_on, extra, successes = [], [], [], [], [], 0.0
        for _ in range(length):
            policy, value = model(seen)
            action = policy.sample()
            obs, reward, terminated, truncated, info = env.step(action.clamp(-1, 1))
            with torch.no_grad():  # a time limit is no end: what was seen last is still worth something
                last = model(flat(info["final_obs"]))[1]
            done = terminated | truncated
            log_probs.append(policy.log_prob(action).sum(-1))
            values.append(value)
            rewards.append(reward)
            goes_on.append((~done).float())
            extra.append(gamma * last * (truncated & ~terminated).float())
            successes += float(info["success"].float().mean())
            seen = flat(obs)
        with torch.no_grad():
            returns, future = [], model(seen)[1]
            for k in reversed(range(length)):
                future = rewards[k] + extra[k] + gamma * goes_on[k] * future
                returns.insert(0, future)
        advantage = torch.stack(returns) - torch.stack(values)
        actor = -(torch.stack(log_probs) * advantage.detach()).mean()
        loss = actor + 0.5 * advantage.square().mean()
        adam.zero_grad()
        loss.backward()
        nn.utils.clip_grad_norm_(model.parameters(), 1.0)
        adam.step()
        report(update, float(torch.stack(rewards).mean()), successes / length)
    return model


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--task", default="PointNavigation")
    parser.add_argument("--worlds", type=int, default=16)
    parser.add_argument("--updates", type=int, default=1000)
    arguments = parser.parse_args()
    environment = TorchEnv(ig2mj.make(arguments.task, worlds=arguments.worlds))
    train(environment, arguments.updates, report=lambda *row: print("update, reward, successes a step:", *row))
