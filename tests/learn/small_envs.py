"""Small pure environments that learning is tried on: seconds on one core, and what is right is known."""

from __future__ import annotations

import dataclasses
from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import numpy as np
from flax import struct

from ig2mj.envs.observations import Space


@struct.dataclass
class State:
    obs: dict[str, Any]
    reward: Any
    terminated: Any
    truncated: Any
    info: dict[str, Any]
    pos: Any
    goal: Any
    steps: Any
    key: Any


class SmallEnv:
    """W worlds; `pure=False` is the same environment, but one that refuses to be compiled."""

    horizon = 20
    size = 2
    observation_spaces: ClassVar[dict[str, Space]]

    def __init__(self, num_worlds: int, pure: bool = True, horizon: int | None = None):
        self.num_worlds, self.pure = num_worlds, pure
        self.horizon = horizon or self.horizon
        self._step, self._start = jax.jit(self._step_fn), jax.jit(self._start_fn)

    @property
    def action_space(self) -> Space:
        return Space((self.size,), np.float32, -1.0, 1.0)

    def prepare_devices(self, devices):
        """Nothing to make ready."""

    def reset(self, seed: int) -> State:
        return self._start(jax.random.PRNGKey(seed))

    def step_autoreset(self, state: State, action: Any) -> State:
        return self._step(state, action)

    def step_autoreset_fn(self, state: State, action: Any) -> State:
        assert self.pure, "who cannot be compiled must not be asked to"
        return self._step_fn(state, action)

    # What a task is.

    def draw(self, key: Any) -> tuple[Any, Any]:
        """Positions and goals of all worlds."""
        raise NotImplementedError

    def judge(self, state: State, pos: Any) -> tuple[Any, Any]:
        """Reward and success after the move."""
        raise NotImplementedError

    def see(self, pos: Any, goal: Any) -> dict[str, Any]:
        raise NotImplementedError

    def speed(self) -> float:
        return 0.1

    def _start_fn(self, key: Any) -> State:
        key, now = jax.random.split(key)
        pos, goal = self.draw(now)
        zero = jnp.zeros(self.num_worlds)
        no = zero.astype(bool)
        info = {"success": no, "reward/way": zero}
        return State(self.see(pos, goal), zero, no, no, info, pos, goal, no.astype(jnp.int32), key)

    def _step_fn(self, state: State, action: Any) -> State:
        pos = jnp.clip(state.pos + self.speed() * jnp.clip(action, -1, 1), -1, 1)
        reward, success = self.judge(state, pos)
        steps = state.steps + 1
        truncated = ~success & (steps >= self.horizon)
        done = success | truncated
        key, now = jax.random.split(state.key)
        new_pos, new_goal = self.draw(now)
        after = self.see(pos, state.goal)
        pos = jnp.where(done[:, None], new_pos, pos)
        goal = jnp.where(done[:, None], new_goal, state.goal)
        info = {"success": success, "reward/way": reward, "final_obs": after}
        steps = jnp.where(done, 0, steps)
        return State(self.see(pos, goal), reward, success, truncated, info, pos, goal, steps, key)


class PointMass(SmallEnv):
    """A point must reach a goal in the plane; paid for the way, and 1 at the goal, as the activities do."""

    observation_spaces: ClassVar[dict[str, Space]] = {
        "proprioception": Space((2,), np.float32, -np.inf, np.inf),
        "privileged_state": Space((2,), np.float32, -np.inf, np.inf),
    }

    def draw(self, key: Any) -> tuple[Any, Any]:
        both = jax.random.uniform(key, (2, self.num_worlds, 2), minval=-1, maxval=1)
        return both[0], both[1]

    def judge(self, state: State, pos: Any) -> tuple[Any, Any]:
        before, now = (jnp.linalg.norm(p - state.goal, axis=1) for p in (state.pos, pos))
        success = now < 0.1
        return before - now + success, success

    def see(self, pos: Any, goal: Any) -> dict[str, Any]:
        return {"proprioception": pos, "privileged_state": goal}


class SeenPointMass(PointMass):
    """The same, where the goal is only seen in a picture of 32 x 32."""

    side = 32
    observation_spaces: ClassVar[dict[str, Space]] = {
        **PointMass.observation_spaces,
        "rgb": Space((32, 32, 3), np.uint8, 0.0, 255.0),
        "depth": Space((32, 32, 1), np.float32, 0.0, 10.0),
    }

    def see(self, pos: Any, goal: Any) -> dict[str, Any]:
        grid = jnp.linspace(-1, 1, self.side)

        def blob(at: Any) -> Any:
            far = (grid[None, :, None] - at[:, None, None, 1]) ** 2 + (grid[None, None, :] - at[:, None, None, 0]) ** 2
            return jnp.exp(-far / 0.02)

        red, green = blob(goal), blob(pos)
        rgb = jnp.stack([red, green, jnp.zeros_like(red)], axis=-1)
        depth = 3.0 - 2.0 * red[..., None]
        return {**super().see(pos, goal), "rgb": (255 * rgb).astype(jnp.uint8), "depth": depth}


class FarReward(SmallEnv):
    """A line with little to gain on the left and much on the right, farther than an episode is long.

    Right of 0.8 a step is worth 1, left of 0 a tenth. From 0.2 the right is six steps away, the left two, and an
    episode has three. Who takes the time limit for an end goes left; the right side is worth more (gamma 0.9).
    """

    horizon = 3
    size = 1
    observation_spaces: ClassVar[dict[str, Space]] = {"proprioception": Space((1,), np.float32, -np.inf, np.inf)}

    def draw(self, key: Any) -> tuple[Any, Any]:
        pos = jax.random.uniform(key, (self.num_worlds, 1), minval=-1, maxval=1)
        return pos, jnp.zeros_like(pos)

    def judge(self, state: State, pos: Any) -> tuple[Any, Any]:
        x = pos[:, 0]
        return jnp.where(x > 0.8, 1.0, jnp.where(x < 0.0, 0.1, 0.0)), jnp.zeros_like(x, bool)

    def see(self, pos: Any, goal: Any) -> dict[str, Any]:
        return {"proprioception": pos}


class FarRewardThatEnds(FarReward):
    """The same, but its time limit is (wrongly) called an end: what is learned then is the opposite."""

    def _step_fn(self, state: State, action: Any) -> State:
        state = super()._step_fn(state, action)
        return dataclasses.replace(state, terminated=state.truncated, truncated=jnp.zeros_like(state.truncated))
