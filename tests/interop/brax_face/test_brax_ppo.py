"""Brax's own PPO trains through the Brax face. A point that must reach a goal stands in for a household, whose batched
engine takes minutes to compile on a processor."""

from __future__ import annotations

import dataclasses
import pathlib
import sys
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from flax import struct

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[3] / "examples"))

from brax_ppo import trained

from ig2mj.envs.brax import BraxEnv
from ig2mj.envs.observations import Space

HORIZON = 20


@struct.dataclass
class State:
    obs: dict[str, Any]
    reward: Any
    terminated: Any
    truncated: Any
    info: dict[str, Any]
    key: Any

    @property
    def done(self) -> Any:
        return self.terminated | self.truncated


class Point:
    """W points in the plane, each with a goal; paid for the way that is made."""

    pure = True
    observation_spaces = {  # noqa: RUF012
        "proprioception": Space((4,), np.float32, -np.inf, np.inf),
        "privileged_state": Space((4,), np.float32, -np.inf, np.inf),
    }
    action_space = Space((2,), np.float32, -1.0, 1.0)

    def __init__(self, num_worlds: int):
        self.num_worlds = num_worlds

    def reset(self, seed: Any) -> State:
        key, now = jax.random.split(jax.random.PRNGKey(seed))
        place = jax.random.uniform(now, (self.num_worlds, 4), minval=-1, maxval=1)
        zero = jnp.zeros(self.num_worlds)
        info = {"success": zero > 0, "steps": zero.astype(jnp.int32), "reward/way": zero}
        return State(self._obs(place), zero, zero > 0, zero > 0, info, key)

    def _obs(self, place: Any) -> dict[str, Any]:
        return {"proprioception": place, "privileged_state": place}

    def step_autoreset_fn(self, state: State, action: Any) -> State:
        place = state.obs["proprioception"]
        pos = jnp.clip(place[:, :2] + 0.1 * jnp.clip(action, -1, 1), -1, 1)
        before, now = (jnp.linalg.norm(p - place[:, 2:], axis=1) for p in (place[:, :2], pos))
        success, steps = now < 0.1, state.info["steps"] + 1
        truncated = ~success & (steps >= HORIZON)
        key, new_key = jax.random.split(state.key)
        new = jax.random.uniform(new_key, place.shape, minval=-1, maxval=1)
        done = success | truncated
        place = jnp.where(done[:, None], new, jnp.concatenate([pos, place[:, 2:]], axis=1))
        reward = before - now + success
        info = {"success": success, "steps": jnp.where(done, 0, steps), "reward/way": reward}
        return State(self._obs(place), reward, success, truncated, info, key)


def test_ppo_learns_to_reach_a_goal_through_the_brax_face():
    env = BraxEnv(Point(64))
    settings = {"learning_rate": 1e-3, "unroll_length": 10}
    make_policy, parameters, _ = trained(env, 250_000, **settings)
    policy = jax.jit(make_policy(parameters, deterministic=True))
    state, step, episodes, successes = env.reset(jax.random.PRNGKey(7)), jax.jit(env.step), 0, 0
    for k in range(60):
        action, _ = policy(state.obs, jax.random.PRNGKey(k))
        state = step(state, action)
        episodes += int(state.done.sum())
        successes += int(state.metrics["success"].sum())
    assert successes > 0.7 * episodes > 50, (successes, episodes)  # seen: 83 % after 150,000 steps
    assert dataclasses.is_dataclass(state)
