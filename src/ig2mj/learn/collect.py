"""Steps of an environment under a policy, and what is kept of them.

On a pure engine `collect` is one `lax.scan` over the environment's `step_autoreset_fn`, made to be part of a larger
program. On the native engine the same function loops in Python, around the environment's own stepping.

Axes: W worlds, T steps, n numbers of an action.
"""

from __future__ import annotations

import dataclasses
import functools
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Protocol, runtime_checkable

import jax
import jax.numpy as jnp
import numpy as np
from flax import struct
from jaxtyping import Bool, Float, Int

from ig2mj.engine.view import Array
from ig2mj.learn.perception import Perception, Seen
from ig2mj.learn.protocols import Adviser

FINAL = "final_obs"


@runtime_checkable
class TrainingEnv(Protocol):
    """What an environment must have for training; `ig2mj.envs.Environment` has all of it.

    A state has obs, reward, terminated, truncated and info, and is a dataclass. With `pure`, `step_autoreset_fn` can be
    part of a compiled program. `info["final_obs"]` is there after every `step_autoreset`.
    """

    num_worlds: int

    @property
    def observation_spaces(self) -> Mapping[str, Any]: ...

    @property
    def pure(self) -> bool: ...

    @property
    def action_space(self) -> Any: ...

    def prepare_devices(self, devices: Sequence[Any]) -> None: ...

    def reset(self, seed: int) -> Any: ...

    def step_autoreset(self, state: Any, action: Any) -> Any: ...

    def step_autoreset_fn(self, state: Any, action: Any) -> Any: ...


@struct.dataclass
class Transition:
    """A step of every world; stacked over T steps in a rollout.

    Attributes:
      seen: what the action was chosen on. action: -1..1. extra: what the algorithm keeps of the choice, by name.
      terminated: nothing comes after it. truncated: cut off, and of value what `after` is worth.
      after: what is seen after it, of the same episode also where a new one has begun.
    """

    seen: Seen
    action: Float[Array, "*t n"]
    extra: dict[str, Array]
    reward: Float[Array, "*t"]
    terminated: Bool[Array, "*t"]
    truncated: Bool[Array, "*t"]
    after: Seen

    @property
    def done(self) -> Array:
        """The episode is over."""
        return self.terminated | self.truncated


@struct.dataclass
class Play:
    """State of all worlds between two steps.

    Attributes:
      state: of the environment. acting: what the algorithm carries from step to step (`Algorithm.acting_state`).
      total, steps: return and steps of the running episodes.
    """

    state: Any
    acting: Any
    total: Float[Array, "W"]
    steps: Int[Array, "W"]


@struct.dataclass
class Advice:
    """What an algorithm knows besides what is seen.

    Attributes:
      steps: of the running episode so far; 0 at its start. label: what an expert would do; None without one.
    """

    steps: Int[Array, "W"]
    label: Float[Array, "W n"] | None = None


Act = Callable[[Any, Any, Seen, Array, Advice], tuple[Array, dict[str, Array], Any]]
"""(learner, acting state, seen, key, advice) -> (action, extra, acting state)"""

GUIDED = "guided"
"""The name among a transition's extras of whether the expert had a part in the episode [W]; such episodes are left out
of the success that is reported."""


def begin(env: TrainingEnv, acting: Any, seed: int) -> Play:
    """All worlds at the start of an episode."""
    return started(env.reset(seed), acting, env.num_worlds)


def started(state: Any, acting: Any, num_worlds: int) -> Play:
    """The `Play` of worlds in this state, at the start of an episode. `state`: the state, or its shapes."""
    zero = np.zeros(num_worlds)
    return Play(_kept(state), acting, jnp.asarray(zero, jnp.float32), jnp.asarray(zero, jnp.int32))


def collect_fn(
    env: TrainingEnv,
    perception: Perception,
    act: Act,
    adviser: Adviser | None,
    learner: Any,
    play: Play,
    key: Array,
    length: int,
) -> tuple[Play, Transition, dict[str, Array]]:
    """`length` steps of every world of a pure environment, as one scan.

    Returns:
      Where the worlds stand, the rollout [T, W, ...], and sums over it (see `_sums`).
    """

    outcomes = outcomes_of(env)

    def step(play: Play, key: Array) -> tuple[Play, tuple[Transition, dict[str, Array]]]:
        seen = perception(play.state.obs)
        action, extra, acting = act(learner, play.acting, seen, key, _advice(adviser, play))
        state = env.step_autoreset_fn(play.state, action)
        new, kept = _stepped(perception, outcomes, play, seen, action, extra, acting, state)
        return dataclasses.replace(new, state=_kept(state)), kept

    play, (rollout, sums) = jax.lax.scan(step, play, jax.random.split(key, length))
    return play, rollout, jax.tree.map(lambda a: a.sum(0), sums)


def _advice(adviser: Adviser | None, play: Play) -> Advice:
    """What is known besides what is seen."""
    if adviser is None:
        return Advice(play.steps)
    notes = getattr(play.acting, "notes", None)
    return Advice(play.steps, adviser.label(play.state, notes, play.steps == 0))


def outcomes_of(env: Any) -> tuple[str, ...]:
    """What an environment's `info` says of an episode when it ends, besides success."""
    objective = getattr(env, "objective", None)
    return (*getattr(objective, "outcomes", ()), *(("goal_progress",) if objective is not None else ()))


def horizon_of(env: Any) -> int:
    """Agent steps of an environment's episodes; 0 where it does not say."""
    return int(getattr(getattr(env, "task", env), "horizon", 0))


class NativeCollector:
    """`collect_fn` for an environment that cannot be compiled: the policy is, the environment is called."""

    def __init__(self, env: TrainingEnv, perception: Perception, act: Act, adviser: Adviser | None = None):
        """Compiles nothing yet."""
        self._env = env
        self._before = jax.jit(self._choose)
        self._after = jax.jit(functools.partial(_stepped, perception, outcomes_of(env)))
        self._perception, self._act, self._adviser = perception, act, adviser

    def _choose(
        self, learner: Any, acting: Any, obs: Mapping[str, Array], key: Array, advice: Advice
    ) -> tuple[Seen, Array, dict[str, Array], Any]:
        seen = self._perception(obs)
        return seen, *self._act(learner, acting, seen, key, advice)

    def __call__(
        self, learner: Any, play: Play, key: Array, length: int
    ) -> tuple[Play, Transition, dict[str, Any], float]:
        """As `collect_fn`; also the seconds that were spent in the environment."""
        rollout, sums, spent = [], [], 0.0
        for k in np.asarray(jax.random.split(key, length)):
            advice = _advice(self._adviser, play)
            seen, action, extra, acting = self._before(learner, play.acting, play.state.obs, k, advice)
            action = np.asarray(action)
            began = time.perf_counter()
            state = self._env.step_autoreset(play.state, action)
            spent += time.perf_counter() - began
            light = _Light(state.obs, state.reward, state.terminated, state.truncated, dict(state.info))
            old = dataclasses.replace(play, state=None)
            new, (transition, sum_) = self._after(old, seen, action, extra, acting, light)
            play = dataclasses.replace(new, state=_kept(state))
            rollout.append(transition)
            sums.append(sum_)
        stacked = jax.tree.map(lambda *a: jnp.stack(a), *rollout)
        return play, stacked, jax.tree.map(lambda *a: sum(np.asarray(x) for x in a), *sums), spent


@struct.dataclass
class _Light:
    """What of an environment's state a compiled program reads."""

    obs: dict[str, Array]
    reward: Any
    terminated: Any
    truncated: Any
    info: dict[str, Any]


def _stepped(
    perception: Perception,
    outcomes: Sequence[str],
    play: Play,
    seen: Seen,
    action: Array,
    extra: dict[str, Array],
    acting: Any,
    state: Any,
) -> tuple[Play, tuple[Transition, dict[str, Array]]]:
    """The play after a step, without its state; what is kept of the step, and sums."""
    reward = jnp.asarray(state.reward, jnp.float32)
    terminated, truncated = jnp.asarray(state.terminated), jnp.asarray(state.truncated)
    after = perception(state.info[FINAL])
    transition = Transition(seen, jnp.asarray(action), extra, reward, terminated, truncated, after)
    total, steps = play.total + reward, play.steps + 1
    sums = _sums(transition, total, steps, state.info, outcomes)
    over = transition.done
    new = Play(None, acting, jnp.where(over, 0.0, total), jnp.where(over, 0, steps))
    return new, (transition, sums)


def _sums(
    transition: Transition, total: Array, steps: Array, info: Mapping[str, Any], outcomes: Sequence[str]
) -> dict[str, Array]:
    """Sums over worlds: of episodes that ended number, return, success, length and outcomes; the rest of steps."""
    over = transition.done.astype(jnp.float32)
    worlds = jnp.float32(over.shape[0])
    if GUIDED in transition.extra:
        over = over * ~transition.extra[GUIDED]
    success = jnp.asarray(info.get("success", transition.terminated), jnp.float32)
    sums = {
        "episodes": over.sum(),
        "return": (over * total).sum(),
        "success": (over * success).sum(),
        "length": (over * steps).sum(),
        "steps": worlds,
        "reward": transition.reward.sum(),
    }
    if "flags" in info:
        sums["flagged"] = (over * (jnp.asarray(info["flags"]) != 0)).sum()
    for name in outcomes:
        sums[name] = (over * jnp.asarray(info[name], jnp.float32)).sum()
    sums |= {name: jnp.asarray(info[name]).sum() for name in info if name.startswith("reward/")}
    return sums


def _kept(state: Any) -> Any:
    """Without what was seen last, which was read and need not be carried on."""
    if state is None or FINAL not in state.info:
        return state
    return dataclasses.replace(state, info={k: v for k, v in state.info.items() if k != FINAL})


def if_ready(
    ready: Bool[Array, ""], update: Callable[[Any], tuple[Any, dict[str, Array]]], learner: Any
) -> tuple[Any, dict[str, Array]]:
    """What an update gives; while it is not time for it, the learner as it is, and losses of 0."""
    update = jax.jit(update, inline=True)  # traced once, for its shapes and for the branch; the program is the same
    nothing = jax.tree.map(lambda a: jnp.zeros(a.shape, a.dtype), jax.eval_shape(lambda x: update(x)[1], learner))
    return jax.lax.cond(ready, update, lambda learner: (learner, nothing), learner)
