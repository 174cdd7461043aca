"""How good a policy is: `ig2mj.envs.rollout.play` from every start state in turn, and how sure the rate is."""

from __future__ import annotations

import math
from typing import Any

import jax
import numpy as np

from ig2mj.envs.environment import Environment
from ig2mj.envs.rollout import Act, Played
from ig2mj.learn.perception import Perception
from ig2mj.learn.policies import Policy


def acting(policy: Policy, env: Environment, file: object, *, drawn: bool = False, seed: int = 0) -> Act:
    """A policy as who acts in an environment.

    Args:
      file: of the policy, for messages. drawn: see `Policy.actor`. seed: of drawn actions.

    Raises:
      InputError: the policy is for something else.
    """
    perception = Perception(env.observation_spaces, policy.card["depends"]["mode"])
    policy.check(env, perception, file)
    choose, keys = jax.jit(policy.actor(perception, drawn=drawn)), np.random.default_rng(seed)

    def act(state: Any) -> np.ndarray:
        return np.asarray(choose(state.obs, keys.integers(0, 2**32, 2, np.uint32)))

    return act


def summary(played: Played) -> dict[str, Any]:
    """Rates and means; the success with the limits of its 95 % interval."""
    count, successes = len(played.success), sum(played.success)
    low, high = wilson(successes, count)
    return {
        "episodes": count,
        "success_rate": successes / count,
        "success_low": round(low, 4),
        "success_high": round(high, 4),
        "success_in_hand_rate": sum(played.success_in_hand) / count,
        "mean_return": float(np.mean(played.total)),
        "steps_per_second": round(played.steps / played.seconds, 1),
    }


def wilson(successes: int, count: int, z: float = 1.96) -> tuple[float, float]:
    """Limits of the interval in which a rate lies with 95 % confidence (Wilson 1927)."""
    rate = successes / count
    middle = (rate + z * z / (2 * count)) / (1 + z * z / count)
    half = z * math.sqrt(rate * (1 - rate) / count + z * z / (4 * count**2)) / (1 + z * z / count)
    return max(middle - half, 0.0), min(middle + half, 1.0)
