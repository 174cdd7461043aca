"""Brax's PPO in an environment of ig2mj: `pip install brax`, then `python examples/brax_ppo.py` on a GPU.

The actor sees proprioception ("state"), the critic the privileged state. ig2mj's environment is a batch already and
begins its episodes itself, each from another start state, so that Brax wraps nothing around it.
"""

from __future__ import annotations

import argparse
import functools
from typing import Any

import jax
import jax.numpy as jnp
from brax.training.agents.ppo import networks, train

import ig2mj
from ig2mj.envs.brax import BraxEnv

if not hasattr(jax, "device_put_replicated"):  # Brax 0.14 calls what JAX 0.10 has taken away
    jax.device_put_replicated = lambda tree, devices: jax.tree.map(lambda a: jnp.stack([a] * len(devices)), tree)


def trained(env: BraxEnv, steps: int, seed: int = 0, **settings: Any) -> tuple[Any, Any, dict[str, Any]]:
    """Trains for so many agent steps of all worlds together; what Brax's `train` returns."""
    wanted: dict[str, Any] = {
        "num_envs": env.num_envs,
        "episode_length": 200,
        "unroll_length": 16,
        "batch_size": env.num_envs // 4,
        "num_minibatches": 4,
        "num_updates_per_batch": 4,
        "discounting": 0.97,
        "learning_rate": 3e-4,
        "entropy_cost": 1e-3,
        "normalize_observations": True,
        "network_factory": functools.partial(
            networks.make_ppo_networks, policy_obs_key="state", value_obs_key="privileged_state"
        ),
    }
    wanted.update(settings)
    return train.train(
        env, num_timesteps=steps, wrap_env=False, run_evals=False, num_evals=0, seed=seed, log_training_metrics=True,
        **wanted,
    )  # fmt: skip


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--task", default="CookingMeat")
    parser.add_argument("--worlds", type=int, default=2048)
    parser.add_argument("--steps", type=int, default=20_000_000)
    arguments = parser.parse_args()
    environment = BraxEnv(ig2mj.make(arguments.task, worlds=arguments.worlds, engine="warp"))
    trained(environment, arguments.steps, progress_fn=lambda steps, metrics: print(steps, metrics))
