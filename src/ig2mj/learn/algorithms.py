"""Algorithms by name, with settings for a GPU and for two cores."""

from __future__ import annotations

from typing import Any

from ig2mj.envs.environment import Environment
from ig2mj.envs.experts import expert_of
from ig2mj.errors import UnknownNameError
from ig2mj.learn.dagger import Dagger, DaggerConfig
from ig2mj.learn.demos import Demos
from ig2mj.learn.looking import start_pictures
from ig2mj.learn.perception import Perception
from ig2mj.learn.ppo import PPO, PPOConfig
from ig2mj.learn.sac import SAC, SACConfig

Config = SACConfig | PPOConfig | DaggerConfig

CONFIGS: dict[str, Config] = {"sac": SACConfig(), "ppo": PPOConfig(), "dagger": DaggerConfig()}
"""For thousands of worlds on a GPU."""

SMALL: dict[str, Config] = {
    "sac": SACConfig(
        updates=16,
        batch=256,
        capacity=200_000,
        gamma=0.98,
        atoms=51,
        tau=0.02,
        lr=1e-3,
        last_lr=3e-4,
        actor=(64, 64),
        critic=(128, 128),
    ),
    "ppo": PPOConfig(length=64, parts=8, gamma=0.98, lr=1e-3, actor=(64, 64), critic=(64, 64)),
    "dagger": DaggerConfig(updates=4, batch=256, capacity=200_000, actor=(128, 128)),
}
"""For some worlds on two cores: small networks, and fewer, larger steps."""


def config_of(name: str, small: bool = False) -> Config:
    """Settings of an algorithm; `small`: for two cores. Raises UnknownNameError."""
    if name not in CONFIGS:
        raise UnknownNameError("algorithm", name, CONFIGS)
    return (SMALL if small else CONFIGS)[name]


def made(
    config: Config,
    perception: Perception,
    env: Environment,
    demos: Demos | None = None,
    axis: str | None = None,
    expert: bool = False,
) -> Any:
    """The algorithm of these settings for an environment.

    Args:
      demos: for SAC. axis: of several devices. expert: the task's expert helps SAC; DAgger always has it.

    Raises:
      UnknownNameError: the task has no expert, and one is needed.
    """
    size = env.action_space.shape[0]
    if isinstance(config, SACConfig):
        return SAC(perception, size, config, axis, demos, expert_of(env) if expert else None)
    if isinstance(config, PPOConfig):
        return PPO(perception, size, config, axis)
    helper, starts = expert_of(env), None
    if config.starts:
        starts = start_pictures(env, perception, config.starts, helper, config.opening)
    return Dagger(perception, size, helper, config, axis, starts)
