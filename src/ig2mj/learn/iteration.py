"""An iteration of a training run: the worlds are stepped, then the algorithm updates the networks.

`OneDevice` and `SeveralHomes` run on one device, `ig2mj.learn.several_devices.ManyDevices` on several. On one device
with a pure engine, stepping and learning are one compiled program, or two.

Axes: W worlds, T steps.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from typing import Any, Protocol, runtime_checkable

import jax
import jax.numpy as jnp
import numpy as np

from ig2mj.engine.view import Array
from ig2mj.envs.experts import expert_of
from ig2mj.learn.collect import NativeCollector, Play, TrainingEnv, begin, collect_fn, started
from ig2mj.learn.perception import Perception
from ig2mj.learn.protocols import as_adviser
from ig2mj.process.gc_pause import Compiled, compile_together


@runtime_checkable
class Algorithm(Protocol):
    """What the loop asks of an algorithm; all methods but the properties are pure."""

    name: str
    perception: Perception
    action_size: int
    config: Any
    actor: Any
    adviser: Any

    @property
    def length(self) -> int: ...

    def warm_up(self, resumed: bool) -> int: ...

    def init(self, key: Array) -> Any: ...

    def buffer(self, num_worlds: int) -> Any: ...

    def acting_state(self, num_worlds: int) -> Any: ...

    def act(self, learner: Any, acting: Any, seen: Any, key: Array, advice: Any, /) -> tuple[Array, Any, Any]: ...

    def learn(
        self, learner: Any, buffer: Any, rollout: Any, key: Array, progress: Array, ready: Array, /
    ) -> tuple[Any, Any, dict[str, Array]]: ...


class OneDevice:
    """A rollout and what is learned from it: one program on a pure engine, else the parts in turn."""

    def __init__(self, env: TrainingEnv, algorithm: Algorithm, programs: int = 1):
        """`programs`: 1 or 2, on a pure engine; with 2 the simulator's time is known.

        Where there are two, or the engine is not pure, they are `play` (learner, play, key -> play, rollout, sums,
        seconds) and `learn` (learner, buffer, rollout, key, progress, ready -> learner, buffer, losses).
        """
        self._env, self._algorithm, self.num_worlds = env, algorithm, env.num_worlds
        self._whole: Compiled | None = None
        if env.pure and programs == 1:

            def whole(learner: Any, buffer: Any, play: Play, key: Array, progress: Array, ready: Array) -> Any:
                play_key, learn_key = jax.random.split(key)
                play, rollout, sums = collect_fn(
                    env,
                    algorithm.perception,
                    algorithm.act,
                    algorithm.adviser,
                    learner,
                    play,
                    play_key,
                    algorithm.length,
                )
                learner, buffer, losses = algorithm.learn(learner, buffer, rollout, learn_key, progress, ready)
                return learner, buffer, play, sums, {**losses, "all_finite": finite(learner)}

            self._whole = Compiled(whole, donate_argnums=(0, 1, 2))
            return

        def learn(learner: Any, buffer: Any, rollout: Any, key: Array, progress: Array, ready: Array) -> Any:
            learner, buffer, losses = algorithm.learn(learner, buffer, rollout, key, progress, ready)
            return learner, buffer, {**losses, "all_finite": finite(learner)}

        def collect(learner: Any, play: Play, key: Array) -> Any:
            return collect_fn(
                env, algorithm.perception, algorithm.act, algorithm.adviser, learner, play, key, algorithm.length
            )

        self.learn = jax.jit(learn, donate_argnums=(0, 1))
        if env.pure:
            program = jax.jit(collect, donate_argnums=1)

            def timed(learner: Any, play: Play, key: Array) -> Any:
                began = time.perf_counter()
                found = jax.block_until_ready(program(learner, play, key))
                return *found, time.perf_counter() - began

            self.play: Callable[..., tuple[Play, Any, dict[str, Any], float]] = timed
        else:
            native = NativeCollector(env, algorithm.perception, algorithm.act, algorithm.adviser)
            self.play = lambda learner, play, key: native(learner, play, key, algorithm.length)

    def buffer(self) -> Any:
        """The algorithm's buffer at the start of a run."""
        return self._algorithm.buffer(self.num_worlds)

    def begin(self, seed: int) -> Any:
        """All worlds at the start of an episode."""
        return begin(self._env, self._algorithm.acting_state(self.num_worlds), seed)

    def compile_beforehand(self, learner: Any, buffer: Any, key: Array, seed: int) -> None:
        """Compiles the iteration together with what `begin(seed)` runs, while the engine's kernels are being loaded."""
        pending = getattr(self._env, "pending_programs", None)
        programs = pending(seed) if pending is not None else []
        if programs and self._whole is not None:
            acting = self._algorithm.acting_state(self.num_worlds)
            play = started(programs[0].returned, acting, self.num_worlds)
            whole = self._whole.traced(learner, buffer, play, key, jnp.float32(0.0), jnp.bool_(False))
            compile_together([whole, *programs])

    def place(self, learner: Any, buffer: Any) -> tuple[Any, Any]:
        """Learner and buffer as arrays on the device."""
        return jax.tree.map(jnp.asarray, (learner, buffer))

    def __call__(
        self, learner: Any, buffer: Any, play: Play, key: Array, progress: float, ready: bool, clock: float = 0.0
    ) -> tuple[Any, Any, Play, dict[str, float], dict[str, float], float | None]:
        """One iteration.

        Args:
          progress: share of the run that is over, 0 to 1. ready: networks are updated. clock: seconds of the run.

        Returns:
          Learner, buffer and worlds; sums over the steps; losses; seconds of the simulator, None: not measured.
        """
        share, go = jnp.float32(progress), jnp.bool_(ready)
        if self._whole is not None:
            learner, buffer, play, sums, losses = self._whole(learner, buffer, play, key, share, go)
            spent = None
        else:
            play_key, learn_key = jax.random.split(key)
            play, rollout, sums, spent = self.play(learner, play, play_key)
            learner, buffer, losses = self.learn(learner, buffer, rollout, learn_key, share, go)
        sums, losses = jax.device_get((sums, losses))
        return learner, buffer, play, floats(sums), {**floats(losses), "clock": clock}, spent


class SeveralHomes:
    """An iteration over several homes on one device: a program of its own steps the worlds of each home, with an expert
    of its own, and one program learns from all rollouts."""

    def __init__(self, env: Any, algorithm: Algorithm):
        """`env`: an `ig2mj.envs.several_homes.HomesEnvironment`."""
        self._env, self._algorithm, self.num_worlds = env, algorithm, env.num_worlds
        helped = algorithm.adviser is not None
        self._advisers = [as_adviser(expert_of(part)) if helped else None for part in env.envs]
        self._play = [self._player(k) for k in range(len(env.envs))]
        self._compiled: list[Callable[..., Any]] | None = None

        def learn(learner: Any, buffer: Any, rollouts: list[Any], key: Array, progress: Array, ready: Array) -> Any:
            rollout = jax.tree.map(lambda *parts: jnp.concatenate(parts, axis=1), *rollouts)
            learner, buffer, losses = algorithm.learn(learner, buffer, rollout, key, progress, ready)
            return learner, buffer, {**losses, "all_finite": finite(learner)}

        self._learn = jax.jit(learn, donate_argnums=(0, 1))

    def _player(self, k: int) -> Any:
        part, algorithm, adviser = self._env.envs[k], self._algorithm, self._advisers[k]
        if not part.pure:
            return NativeCollector(part, algorithm.perception, algorithm.act, adviser)

        def collect(learner: Any, play: Play, key: Array) -> Any:
            return collect_fn(part, algorithm.perception, algorithm.act, adviser, learner, play, key, algorithm.length)

        return jax.jit(collect, donate_argnums=1)

    def buffer(self) -> Any:
        """The algorithm's buffer at the start of a run."""
        return self._algorithm.buffer(self.num_worlds)

    def begin(self, seed: int) -> list[Play]:
        """All worlds at the start of an episode, home by home."""
        state = self._algorithm.acting_state
        parts = enumerate(self._env.envs)
        return [begin(part, state(part.num_worlds), self._env.seed_of(k, seed)) for k, part in parts]

    def place(self, learner: Any, buffer: Any) -> tuple[Any, Any]:
        """Learner and buffer as arrays on the device."""
        return jax.tree.map(jnp.asarray, (learner, buffer))

    def __call__(
        self, learner: Any, buffer: Any, plays: list[Play], key: Array, progress: float, ready: bool, clock: float = 0.0
    ) -> tuple[Any, Any, list[Play], dict[str, float], dict[str, float], float]:
        """As `OneDevice.__call__`."""
        play_key, learn_key = jax.random.split(key)
        keys = jax.random.split(play_key, len(plays))
        if self._env.pure and self._compiled is None:
            lowered = [play.lower(learner, part, one) for play, part, one in zip(self._play, plays, keys, strict=True)]
            with ThreadPoolExecutor(len(lowered), "ig2mj-homes") as threads:
                self._compiled = list(threads.map(lambda program: program.compile(), lowered))
        began = time.perf_counter()
        if self._compiled is not None:
            done = [act(learner, part, one) for act, part, one in zip(self._compiled, plays, keys, strict=True)]
        else:
            length = self._algorithm.length
            done = [act(learner, part, one, length)[:3] for act, part, one in zip(self._play, plays, keys, strict=True)]
        plays, rollouts, sums = ([one[k] for one in done] for k in range(3))
        jax.block_until_ready(sums)
        spent = time.perf_counter() - began
        share, go = jnp.float32(progress), jnp.bool_(ready)
        learner, buffer, losses = self._learn(learner, buffer, rollouts, learn_key, share, go)
        total = {name: sum(float(np.asarray(one[name])) for one in sums) for name in sums[0]}
        return learner, buffer, plays, total, {**floats(jax.device_get(losses)), "clock": clock}, spent


def finite(tree: Any) -> Array:
    """Whether all floating-point numbers of a tree are finite."""
    floats = [a for a in jax.tree.leaves(tree) if jnp.issubdtype(a.dtype, jnp.floating)]
    return jnp.stack([jnp.isfinite(a).all() for a in floats]).all()


def floats(tree: Mapping[str, Any]) -> dict[str, float]:
    """Scalars as Python floats."""
    return {name: float(np.asarray(value)) for name, value in tree.items()}
