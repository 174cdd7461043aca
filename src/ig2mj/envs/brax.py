"""Brax's interface, for trainers of Brax's or Playground's environments; needs a pure engine (warp or jax).

    env = BraxEnv(ig2mj.make("CookingMeat", worlds=4096, engine="warp"))
    state = env.reset(jax.random.PRNGKey(0))
    state = jax.jit(env.step)(state, action)

Brax need not be installed: trainers use the members only. The environment is batched and resets itself, so none of
Brax's wrappers may be used (`wrap_env=False`). Those of Brax and Playground return to each world's first state in every
episode; here each episode begins with a row of the pool, chosen by a key of seed, world and episode.

Observations are `state` (all vectors but the privileged one), `privileged_state`, and `pixels/NAME` for images.

Axes: W worlds, n numbers of an action.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any, Protocol, runtime_checkable

import jax
import jax.numpy as jnp
import numpy as np
from flax import struct
from jaxtyping import Float

from ig2mj.engine.view import Array
from ig2mj.envs.state import metrics_of
from ig2mj.errors import EngineError
from ig2mj.process import entry_point
from ig2mj.worlds.random_streams import as_seed

PRIVILEGED = "privileged_state"


@struct.dataclass
class BraxState:
    """Brax's `State`, with the same members.

    Attributes:
      pipeline_state: the environment's state. obs: by name. reward: [W]. done: [W] 1 at the end of an episode, else 0.
      metrics: reward terms and success of this step. info: "steps" of the episode, "truncation", "episode_done",
        "episode_metrics" (sums over the present episode: "sum_reward", "length", and of each metric).
    """

    pipeline_state: Any
    obs: dict[str, Array]
    reward: Float[Array, "W"]
    done: Float[Array, "W"]
    metrics: dict[str, Array]
    info: dict[str, Any]


@runtime_checkable
class PureEnv(Protocol):
    """Members that an environment must have; `ig2mj.envs.Environment` has them."""

    num_worlds: int
    period: float

    @property
    def pure(self) -> bool: ...

    @property
    def observation_spaces(self) -> Mapping[str, Any]: ...

    @property
    def action_space(self) -> Any: ...

    def reset(self, seed: Any) -> Any: ...

    def step_autoreset_fn(self, state: Any, action: Any) -> Any: ...


@entry_point
class BraxEnv:
    """See the module's text. Attributes: env: the environment underneath."""

    def __init__(self, env: PureEnv):
        """Raises EngineError: the engine is not pure, so it cannot be part of a compiled program."""
        if not env.pure:
            raise EngineError(
                "Brax's trainers compile the environment, which the native engine does not allow (take engine='warp' "
                "or 'jax', or train with ig2mj.learn)"
            )
        self.env = env
        self._vectors = [n for n, space in env.observation_spaces.items() if len(space.shape) == 1 and n != PRIVILEGED]
        self._pictures = [n for n, space in env.observation_spaces.items() if len(space.shape) == 3]

    @property
    def observation_size(self) -> dict[str, tuple[int, ...]]:
        """Shape of each observation, without the world axis."""
        spaces = self.env.observation_spaces
        sizes: dict[str, tuple[int, ...]] = {}
        if self._vectors:
            sizes["state"] = (sum(spaces[name].shape[0] for name in self._vectors),)
        if PRIVILEGED in spaces:
            sizes[PRIVILEGED] = spaces[PRIVILEGED].shape
        return sizes | {f"pixels/{name}": spaces[name].shape for name in self._pictures}

    @property
    def action_size(self) -> int:
        """n."""
        return self.env.action_space.shape[0]

    @property
    def backend(self) -> str:
        """Not one of Brax's."""
        return "ig2mj"

    @property
    def dt(self) -> float:
        """Seconds of an agent step."""
        return self.env.period

    @property
    def num_envs(self) -> int:
        """W."""
        return self.env.num_worlds

    @property
    def unwrapped(self) -> BraxEnv:
        """Itself."""
        return self

    def reset(self, rng: Array) -> BraxState:
        """First episodes of all worlds. `rng`: a key, or one for each world as Brax's wrappers give; the
        first one seeds the random streams of all worlds."""
        rng = jnp.asarray(rng)
        keys = rng if jnp.issubdtype(rng.dtype, jax.dtypes.prng_key) else rng.reshape(-1, rng.shape[-1])
        key = keys[0] if keys.ndim else keys
        state = self.env.reset(as_seed(key))
        zero = jnp.zeros(self.num_envs, jnp.float32)
        metrics = self._metrics(state)
        sums = {"sum_reward": zero, "length": zero, **{name: zero for name in metrics}}
        info = {"steps": zero, "truncation": zero, "episode_done": zero, "episode_metrics": sums}
        return BraxState(state, self._obs(state), zero, zero, metrics, info)

    def step(self, state: BraxState, action: Float[Array, "W n"]) -> BraxState:
        """One agent step of all worlds, and the next episode where one is over. Pure."""
        going = 1.0 - state.done  # the sums of an episode that is over stand until the next step
        after = self.env.step_autoreset_fn(state.pipeline_state, action)
        final = {name: array for name, array in after.info.items() if name != "final_obs"}
        inner = dataclasses.replace(after, info=final)
        metrics, reward = self._metrics(after), jnp.asarray(after.reward, jnp.float32)
        sums = state.info["episode_metrics"]
        now = {"sum_reward": reward, "length": jnp.ones_like(reward), **metrics}
        sums = {name: sums[name] * going + now[name] for name in sums}
        done = jnp.asarray(after.done, jnp.float32)
        info = {
            "steps": jnp.asarray(final["steps"], jnp.float32),
            "truncation": jnp.asarray(after.truncated, jnp.float32),
            "episode_done": done,
            "episode_metrics": sums,
        }
        return BraxState(inner, self._obs(after), reward, done, metrics, info)

    def _obs(self, state: Any) -> dict[str, Array]:
        found: dict[str, Array] = {}
        if self._vectors:
            found["state"] = jnp.concatenate([state.obs[name] for name in self._vectors], axis=1)
        if PRIVILEGED in state.obs:
            found[PRIVILEGED] = state.obs[PRIVILEGED]
        return found | {f"pixels/{name}": state.obs[name] for name in self._pictures}

    def _metrics(self, state: Any) -> dict[str, Array]:
        return {name: jnp.asarray(array, np.float32) for name, array in metrics_of(state.info).items()}
