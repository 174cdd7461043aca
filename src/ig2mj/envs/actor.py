"""`Actor`: an agent that is a pure function, such as a policy; and `Tally`, how episodes that run side by side end.

On a pure engine an actor becomes part of the program that steps the worlds: many steps are one call, after which little
is fetched. Steps that are called one by one leave a GPU idle while Python runs.

Axes: W worlds, n numbers of an action, m numbers that are remembered.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from types import SimpleNamespace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from flax import struct
from jaxtyping import Bool, Float, Int, UInt

from ig2mj.engine.view import Array
from ig2mj.envs.environment import Environment
from ig2mj.envs.state import EnvState
from ig2mj.errors import ActionError
from ig2mj.process import entry_point
from ig2mj.process.gc_pause import Compiled, Traced

STEPS = 20
"""The most agent steps of one call."""

Choose = Callable[..., tuple[Array, Array]]
"""Actions [W, n] and what is remembered [W, m], from observations by name, what was remembered, in which worlds an
episode begins [W], a key and, where an actor has them, parameters. Pure."""

Ending = tuple[Array, Array, Array, dict[str, Array], Array]
"""Reward, `terminated`, `truncated`, what a tally needs of `info`, and the truth of the goal's literals."""


@struct.dataclass
class Tally:
    """How the first episodes of all worlds go on and end. All of it may be NumPy's, or traced.

    Attributes:
      going: not over yet. success: how they ended. outcomes: the same of what the task measures, by name
        (`ig2mj.tasks.objective.Objective.outcomes`). total: the return. steps: that were taken.
      literals: truth of the goal's literals at the end, of those that go on now.
    """

    going: Bool[Array, "W"]
    success: Bool[Array, "W"]
    outcomes: dict[str, Bool[Array, "W"]]
    total: Float[Array, "W"]
    steps: Int[Array, ""] | np.int32
    literals: Bool[Array, "W L"]

    @classmethod
    def begun(cls, state: Any, outcomes: Sequence[str] = ()) -> Tally:
        """At the start of episodes.

        Args:
          state: what has its reward and status. outcomes: names of what the task measures.
        """
        none = np.zeros(np.shape(state.reward), bool)
        literals = np.asarray(state.status.literals)
        return cls(~none, none, {n: none for n in outcomes}, none.astype(np.float32), np.int32(0), literals)

    def after(self, ending: Ending) -> Tally:
        """After a step of all worlds, of which those that were over count no more."""
        reward, terminated, truncated, info, literals = ending
        where = np.where if isinstance(self.going, np.ndarray) and isinstance(literals, np.ndarray) else jnp.where
        ends, going = self.going & (terminated | truncated), self.going & ~(terminated | truncated)
        return Tally(
            going,
            self.success | (ends & info["success"]),
            {name: before | (ends & info[name]) for name, before in self.outcomes.items()},
            self.total + reward * self.going,
            self.steps + np.int32(1),
            where(self.going[:, None], literals, self.literals),
        )


def ending(state: EnvState, outcomes: Sequence[str] = ()) -> Ending:
    """What a tally needs of a state. `outcomes`: names of what the task measures."""
    info = {n: state.info[n] for n in ("success", *outcomes)}
    return state.reward, state.terminated, state.truncated, info, state.status.literals


@entry_point
class Actor:
    """An agent that is a pure function of observations and a key: an `ig2mj.envs.rollout.Act`."""

    def __init__(self, env: Environment, choose: Choose, remembers: int = 0, seed: int = 0, parameters: Any = None):
        """Nothing is compiled before it acts.

        Args:
          remembers: m. seed: of the keys.
          parameters: last argument of `choose`, a pytree; None: it takes none. What differs between policies belongs
            here: with other constants physics would be compiled again.
        """
        self._env, self._choose = env, jax.jit(choose)
        self._more = () if parameters is None else (parameters,)
        self._several = Compiled(self._several_fn, donate_argnums=0)
        self._random, self._kept = np.random.default_rng(seed), np.zeros((env.num_worlds, remembers), np.float32)

    def seeded(self, seed: int) -> Actor:
        """The same actor, whose keys start again."""
        self._random = np.random.default_rng(seed)
        return self

    def __call__(self, state: EnvState) -> Array:
        """Actions [W, n] of NumPy's."""
        action, self._kept = self._choose(state.obs, self._kept, begins(state), self._keys(), *self._more)
        return np.asarray(action)

    def several(self, state: EnvState, tally: Tally, most: int = STEPS) -> tuple[EnvState, Tally]:
        """Steps of a pure engine until all episodes are over, `most` and no more than `STEPS`. Consumes the state.

        Raises:
          ActionError: numbers of an action were not finite.
        """
        keys = np.zeros((STEPS, 2), np.uint32)
        keys[:most] = self._keys(most)
        given = (self._kept, keys, np.int32(most), *self._more)
        state, tally, self._kept = self._several(state, tally, *given)
        if count := int(np.asarray(state.bad_actions).sum()):
            raise ActionError(f"{count} numbers of actions of {self._env.task.name} are not finite")
        return state, tally

    def traced(self, state: Any, outcomes: Sequence[str] = ()) -> Traced:
        """The program of `several`, traced and not compiled.

        Args:
          state: shapes of what it is given. outcomes: names of what the task measures.
        """
        zeros = jax.tree.map(lambda a: np.zeros(a.shape, a.dtype), (state.reward, state.status))
        tally = Tally.begun(SimpleNamespace(reward=zeros[0], status=zeros[1]), outcomes)
        keys = np.zeros((STEPS, 2), np.uint32)
        return self._several.traced(state, tally, self._kept, keys, np.int32(STEPS), *self._more)

    def _several_fn(
        self,
        state: EnvState,
        tally: Tally,
        kept: Float[Array, "W m"],
        keys: UInt[Array, "s 2"],
        most: Int[Array, ""] | np.int32,
        *more: Any,
    ) -> tuple[EnvState, Tally, Float[Array, "W m"]]:
        def go_on(carry: Any) -> Bool[Array, ""]:
            _, tally, _, k = carry
            return tally.going.any() & (k < most)

        def step(carry: Any) -> Any:
            state, tally, kept, k = carry
            action, kept = self._choose(state.obs, kept, begins(state), keys[k], *more)
            state = self._env.step_fn(state, resting(action, tally.going))
            return state, tally.after(ending(state, tuple(tally.outcomes))), kept, k + 1

        return jax.lax.while_loop(go_on, step, (state, tally, kept, jnp.int32(0)))[:3]

    def _keys(self, *shape: int) -> UInt[np.ndarray, "... 2"]:
        return self._random.integers(0, 2**32, (*shape, 2), np.uint32)


def begins(state: EnvState) -> Bool[Array, "W"]:
    """In which worlds what is observed is the first of an episode: after a start, and after a step that ended one where
    the next begins by itself. Its `info` is then of the end."""
    return (state.info["steps"] == 0) | state.terminated | state.truncated


def resting(action: Array, going: Bool[Array, "W"]) -> Array:
    """The action, zero where the episode is over. Such worlds wait for the others. In training a policy sees no states
    after the end of an episode, and its actions could make physics non-finite there."""
    where = np.where if isinstance(action, np.ndarray) else jnp.where
    return where(going[:, None], action, np.float32(0.0))
