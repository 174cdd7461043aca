"""Algorithms by name, with settings for a GPU and for two cores, and how their parts are put together."""

from __future__ import annotations

from typing import Any

from ig2mj.envs.experts import expert_of
from ig2mj.envs.planned_expert import PlannedExpert
from ig2mj.errors import Ig2mjError, UnknownNameError
from ig2mj.learn import networks
from ig2mj.learn.collect import horizon_of
from ig2mj.learn.dagger import Dagger, DaggerConfig
from ig2mj.learn.demos import Demos
from ig2mj.learn.occlusion import MEMORIES, OcclusionConfig, glimpses
from ig2mj.learn.occlusion.belief_labels import BeliefAdviser
from ig2mj.learn.occlusion.encoder_pretraining import start_images
from ig2mj.learn.occlusion.object_memory import make_memory
from ig2mj.learn.occlusion.projection import camera_projection, with_object_targets
from ig2mj.learn.perception import Perception
from ig2mj.learn.ppo import PPO, PPOConfig
from ig2mj.learn.protocols import Encoder
from ig2mj.learn.sac import SAC, SACConfig

Config = SACConfig | PPOConfig | DaggerConfig

ENCODERS = (*networks.ENCODERS, glimpses.NAME)
"""Encoders of images that settings name; `glimpses` is for SAC and DAgger."""

CONFIGS: dict[str, Config] = {"sac": SACConfig(), "ppo": PPOConfig(), "dagger": DaggerConfig()}
"""For thousands of worlds on a GPU."""

SMALL: dict[str, Config] = {
    "sac": SACConfig(
        utd_ratio=16,
        batch_size=256,
        buffer_size=200_000,
        gamma=0.98,
        num_atoms=51,
        tau=0.02,
        lr=1e-3,
        final_lr=3e-4,
        actor_layers=(64, 64),
        critic_layers=(128, 128),
    ),
    "ppo": PPOConfig(
        rollout_length=64, minibatches=8, gamma=0.98, lr=1e-3, actor_layers=(64, 64), critic_layers=(64, 64)
    ),
    "dagger": DaggerConfig(utd_ratio=4, batch_size=256, buffer_size=200_000, actor_layers=(128, 128)),
}
"""For some worlds on two cores: small networks, and fewer, larger steps."""

NO_OCCLUSION = OcclusionConfig()


def config_of(name: str, small: bool = False) -> Config:
    """Settings of an algorithm; `small`: for two cores. Raises UnknownNameError."""
    if name not in CONFIGS:
        raise UnknownNameError("algorithm", name, CONFIGS)
    return (SMALL if small else CONFIGS)[name]


def check_settings(config: Config, occlusion: OcclusionConfig = NO_OCCLUSION) -> None:
    """Refuses settings that do not go together, before anything is made.

    Raises:
      UnknownNameError: no such encoder or memory. Ig2mjError: a setting needs another.
    """
    o = occlusion
    if config.encoder not in ENCODERS:
        raise UnknownNameError("encoder", config.encoder, ENCODERS)
    if o.object_memory not in MEMORIES:
        raise UnknownNameError("object memory", o.object_memory, MEMORIES)
    if o != NO_OCCLUSION and not isinstance(config, DaggerConfig):
        name = next(n for n, value in vars(o).items() if value != getattr(NO_OCCLUSION, n))
        raise Ig2mjError(f"{name}: for --algo dagger only")
    for name in ("pretrain_updates", "pretrain_expert_steps"):
        if getattr(o, name) and not o.pretrain_images:
            raise Ig2mjError(
                f"{name}={getattr(o, name)}: there are no images of start states (--set pretrain_images=4096)"
            )
    if o.object_memory != "none" and config.encoder != glimpses.NAME:
        raise Ig2mjError(
            f"object_memory={o.object_memory}: only for actors that act on a prediction (encoder=glimpses)"
        )
    if o.belief_labels and o.object_memory == "none":
        raise Ig2mjError("belief_labels=true: only an actor with a memory has beliefs (--set object_memory=poses)")
    if config.encoder == glimpses.NAME and (isinstance(config, PPOConfig) or not config.aux_coef):
        raise Ig2mjError("encoder=glimpses: for sac and dagger, with an aux_coef above 0")


def make_algorithm(
    config: Config,
    perception: Perception,
    env: Any,
    demos: Demos | None = None,
    axis: str | None = None,
    expert: bool = False,
    occlusion: OcclusionConfig = NO_OCCLUSION,
    *,
    begun: bool = False,
) -> Any:
    """The algorithm of these settings for an environment.

    Args:
      env: an `ig2mj.envs.environment.Environment`. demos: for SAC and DAgger. axis: of several devices.
      expert: the task's expert helps SAC; DAgger always has it. occlusion: for DAgger.
      begun: SAC's actor begins as a policy (`ig2mj.learn.warm_start`).

    Raises:
      UnknownNameError: the task has no expert, and one is needed; see also `check_settings`.
      Ig2mjError: settings that do not go together, or that the environment has nothing for.
    """
    check_settings(config, occlusion)
    env = getattr(env, "envs", (env,))[0]  # of several homes the first: all have the same shapes
    size, horizon = env.action_space.shape[0], horizon_of(env)
    encoder: Encoder | None = None
    if config.encoder == glimpses.NAME:
        perception = with_object_targets(perception, env.privileged_names, camera_projection(env, perception))
        encoder = glimpses.encoder_of(perception)
    if isinstance(config, SACConfig):
        adviser = _expert_of(env) if expert else None
        return SAC(perception, size, config, axis, demos, adviser, horizon=horizon, encoder=encoder, begun=begun)
    if isinstance(config, PPOConfig):
        return PPO(perception, size, config, axis)
    helper, unlabelled, memory, o = _expert_of(env), None, None, occlusion
    if isinstance(helper, PlannedExpert) and o != NO_OCCLUSION:
        raise Ig2mjError("settings of occlusion are for scripted experts, not for the planner")
    adviser: Any = helper
    if o.object_memory != "none":
        readings = getattr(env.core.controllers[0], "hand_readings", ())
        memory = make_memory(perception, readings, full=o.object_memory == "full")
        if o.belief_labels and perception.targets is not None:
            adviser = BeliefAdviser(helper, memory, perception.targets)
    if o.pretrain_images:
        unlabelled = start_images(env, perception, o.pretrain_images, helper, o.pretrain_expert_steps)
    parts: dict[str, Any] = {"horizon": horizon, "encoder": encoder, "memory": memory, "demos": demos}
    return Dagger(perception, size, adviser, config, axis, unlabelled, **parts)


def _expert_of(env: Any) -> Any:
    """The expert of an environment, which gives labels while it is stepped. Raises Ig2mjError: it cannot there."""
    found = expert_of(env)
    if isinstance(found, PlannedExpert) and env.pure:
        raise Ig2mjError("the planner is no part of a compiled program (--set engine=native)")
    return found
