"""How good a policy is: episodes that each begin with a start state of their own.

Axes: W worlds, n numbers of an action.
"""

from __future__ import annotations

import dataclasses
import math
import time
from collections.abc import Callable, Mapping
from typing import Any

import jax
import numpy as np
from jaxtyping import Bool, Float

from ig2mj.engine.view import Array
from ig2mj.envs.environment import Environment

Acting = Callable[[Mapping[str, Array], Array], Array]
"""From observations by name, and a key, to actions [W, n]."""


@dataclasses.dataclass(frozen=True)
class Evaluation:
    """Of E episodes, in the order of the rows that they began with. `steps`: agent steps of the episode."""

    success: Bool[np.ndarray, "E"]
    success_in_hand: Bool[np.ndarray, "E"]
    total: Float[np.ndarray, "E"]
    steps: Float[np.ndarray, "E"]
    flagged: Bool[np.ndarray, "E"]
    steps_per_second: float

    def summary(self) -> dict[str, Any]:
        """Rates and means; the success with the limits of its 95 % interval (Wilson's)."""
        low, high = wilson(int(self.success.sum()), len(self.success))
        done = self.success
        return {
            "episodes": len(done),
            "success_rate": float(done.mean()),
            "success_low": round(low, 4),
            "success_high": round(high, 4),
            "success_in_hand_rate": float(self.success_in_hand.mean()),
            "mean_return": float(self.total.mean()),
            "mean_steps_to_success": float(self.steps[done].mean()) if done.any() else None,
            "flagged": int(self.flagged.sum()),
            "steps_per_second": round(self.steps_per_second, 1),
        }


def evaluate(
    env: Environment, act: Acting, episodes: int, progress: Callable[[int, int], None] = lambda done, of: None
) -> Evaluation:
    """Plays the rows of the environment's pool, the first `episodes`, each once (and anew where it has fewer).

    Args:
      act: a policy (`Policy.actor`), pure. progress: called with the episodes that were played.
    """
    choose, worlds, size = jax.jit(act), env.num_worlds, env.core.starts.pool.size
    keys = iter(np.asarray(jax.random.split(jax.random.PRNGKey(0), -(-episodes // worlds) * env.task.horizon)))
    found: list[tuple[np.ndarray, ...]] = []
    began, steps = time.monotonic(), 0
    for first in range(0, episodes, worlds):
        numbers = np.arange(first, first + worlds)
        state = env.start_from(numbers % size, seed=first)
        over, none = np.zeros(worlds, bool), np.zeros(worlds, bool)
        success, in_hand, flagged = none.copy(), none.copy(), none.copy()
        total, length = np.zeros(worlds), np.zeros(worlds)
        for _ in range(env.task.horizon):
            state = env.step(state, np.asarray(choose(state.obs, next(keys))))
            info, going = state.info, ~over
            total += going * np.asarray(state.reward)
            length += going
            steps += worlds
            ends = going & np.asarray(state.done)
            success |= ends & np.asarray(info["success"])
            in_hand |= ends & np.asarray(info.get("success_in_hand", none))
            flagged |= ends & (np.asarray(info["flags"]) != 0)
            over |= ends
            if over[numbers < episodes].all():
                break
        kept = numbers < episodes
        found.append(tuple(a[kept] for a in (success, in_hand, total, length, flagged)))
        progress(min(first + worlds, episodes), episodes)
    success, in_hand, total, length, flagged = (np.concatenate(parts) for parts in zip(*found, strict=True))
    return Evaluation(success, in_hand, total, length, flagged, steps / (time.monotonic() - began))


def wilson(successes: int, count: int, z: float = 1.96) -> tuple[float, float]:
    """Limits of the interval in which a rate lies with 95 % confidence (Wilson 1927)."""
    rate = successes / count
    middle = (rate + z * z / (2 * count)) / (1 + z * z / count)
    half = z * math.sqrt(rate * (1 - rate) / count + z * z / (4 * count**2)) / (1 + z * z / count)
    return max(middle - half, 0.0), min(middle + half, 1.0)
