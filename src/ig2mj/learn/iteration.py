"""An iteration of a training run: the worlds are stepped, then the algorithm updates the networks.

`OneDevice` and `SeveralHomes` run on one device, `ig2mj.learn.several_devices.ManyDevices` on several. On one device
with a pure engine, stepping and learning are one compiled program, or two.

Axes: W worlds, T steps.
"""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable, Iterator, Mapping
from typing import Any, Protocol, runtime_checkable

import jax
import jax.numpy as jnp
import numpy as np

from ig2mj.engine.view import Array
from ig2mj.envs.experts import expert_of
from ig2mj.learn.collect import NativeCollector, Play, TrainingEnv, begin, collect_fn, started
from ig2mj.learn.perception import Perception
from ig2mj.learn.progress import OF_HOMES
from ig2mj.learn.protocols import as_adviser
from ig2mj.process.gc_pause import Compiled, Traced, compile_together


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

        self.learn = Compiled(learn, donate_argnums=(0, 1))
        if env.pure:
            self._collect = Compiled(collect, donate_argnums=1)

            def timed(learner: Any, play: Play, key: Array) -> Any:
                began = time.perf_counter()
                found = jax.block_until_ready(self._collect(learner, play, key))
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
        """Compiles the iteration together with what `begin(seed)` runs, while the engine's kernels are being loaded.

        Arrays may be shapes.
        """
        pending = getattr(self._env, "pending_programs", None)
        programs = pending(seed) if pending is not None else []
        if programs:
            acting = self._algorithm.acting_state(self.num_worlds)
            play = started(programs[0].returned, acting, self.num_worlds)
            compile_together(itertools.chain(self._programs(learner, buffer, play, key), programs))

    def _programs(self, learner: Any, buffer: Any, play: Any, key: Array) -> Iterator[Traced]:
        """Of an iteration, each traced when it is asked for."""
        last = key, jnp.float32(0.0), jnp.bool_(False)
        if self._whole is not None:
            yield self._whole.traced(learner, buffer, play, *last)
            return
        collect = self._collect.traced(learner, play, key)
        yield collect
        yield self.learn.traced(learner, buffer, collect.returned[1], *last)

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
    of its own, and one program learns.

    Where the algorithm replays and all homes have equally many worlds, homes take turns: an iteration steps the worlds
    of one home. A home then has as many worlds for the same number of steps between updates as a training in one home
    has, and a GPU, whose time for a step hardly depends on the number of worlds while they are few, is used as well.

    Attributes:
      turns: iterations until each home has had its turn; 1: each iteration steps all of them.
    """

    def __init__(self, env: Any, algorithm: Algorithm, in_turn: bool = True):
        """`env`: an `ig2mj.envs.several_homes.HomesEnvironment`. `in_turn`: homes take turns where they can."""
        self._env, self._algorithm, self.num_worlds = env, algorithm, env.num_worlds
        even = len({part.num_worlds for part in env.envs}) == 1
        self.turns = len(env.envs) if in_turn and even and getattr(algorithm, "replays", False) else 1
        self._next = 0
        helped = algorithm.adviser is not None
        self._advisers = [as_adviser(expert_of(part)) if helped else None for part in env.envs]
        self._play = [self._player(k) for k in range(len(env.envs))]

        def learn(
            learner: Any, buffer: Any, rollouts: list[Any], home: Array, key: Array, progress: Array, ready: Array
        ) -> Any:
            rollout = jax.tree.map(lambda *parts: jnp.concatenate(parts, axis=1), *rollouts)
            turn: tuple[Any, ...] = (home,) if self.turns > 1 else ()
            learner, buffer, losses = algorithm.learn(learner, buffer, rollout, key, progress, ready, *turn)
            return learner, buffer, {**losses, "all_finite": finite(learner)}

        self._learn = Compiled(learn, donate_argnums=(0, 1))

    def _player(self, k: int) -> Any:
        part, algorithm, adviser = self._env.envs[k], self._algorithm, self._advisers[k]
        if not part.pure:
            return NativeCollector(part, algorithm.perception, algorithm.act, adviser)

        def collect(learner: Any, play: Play, key: Array) -> Any:
            return collect_fn(part, algorithm.perception, algorithm.act, adviser, learner, play, key, algorithm.length)

        return Compiled(collect, donate_argnums=1)

    def buffer(self) -> Any:
        """The algorithm's buffer at the start of a run."""
        make: Any = self._algorithm.buffer
        return make(self.num_worlds, self.turns) if self.turns > 1 else make(self.num_worlds)

    def begin(self, seed: int) -> list[Play]:
        """All worlds at the start of an episode, home by home."""
        state = self._algorithm.acting_state
        parts = enumerate(self._env.envs)
        return [begin(part, state(part.num_worlds), self._env.seed_of(k, seed)) for k, part in parts]

    def compile_beforehand(self, learner: Any, buffer: Any, key: Array, seed: int) -> None:
        """Compiles all programs of all homes side by side: their starts, what steps them, and what learns.

        A home's programs are traced and lowered while those of the homes before it are compiled.
        """
        compile_together(self._programs(learner, buffer, key, seed))

    def _programs(self, learner: Any, buffer: Any, key: Array, seed: int) -> Iterator[Traced]:
        rollouts = list[Any]()
        for k, part in enumerate(self._env.envs):
            pending_programs = getattr(part, "pending_programs", None)
            pending = [] if pending_programs is None else pending_programs(self._env.seed_of(k, seed))
            if not pending:  # the engine runs what is compiled when it is called
                return
            play = started(pending[0].returned, self._algorithm.acting_state(part.num_worlds), part.num_worlds)
            collect = self._play[k].traced(learner, play, key)
            yield collect
            yield from pending
            rollouts.append(collect.returned[1])
            if len(rollouts) == len(self._env.envs) or (self.turns > 1 and k == 0):
                seen = rollouts[:1] if self.turns > 1 else rollouts
                yield self._learn.traced(learner, buffer, seen, np.int32(0), key, jnp.float32(0.0), jnp.bool_(False))

    def place(self, learner: Any, buffer: Any) -> tuple[Any, Any]:
        """Learner and buffer as arrays on the device."""
        return jax.tree.map(jnp.asarray, (learner, buffer))

    def __call__(
        self, learner: Any, buffer: Any, plays: list[Play], key: Array, progress: float, ready: bool, clock: float = 0.0
    ) -> tuple[Any, Any, list[Play], dict[str, float], dict[str, float], float]:
        """As `OneDevice.__call__`. The sums also have success and number of episodes of each home."""
        play_key, learn_key = jax.random.split(key)
        keys = [play_key] if len(plays) == 1 else jax.random.split(play_key, len(plays))
        first = self._next
        chosen = range(len(plays)) if self.turns == 1 else range(first, first + 1)
        self._next = (first + 1) % self.turns
        began, plays, rollouts, sums = time.perf_counter(), list(plays), list[Any](), dict[int, dict[str, Any]]()
        length = () if self._env.pure else (self._algorithm.length,)
        for k in chosen:
            plays[k], rollout, sums[k], *_ = self._play[k](learner, plays[k], keys[k], *length)
            rollouts.append(rollout)
        jax.block_until_ready(sums)
        spent = time.perf_counter() - began
        share, go = jnp.float32(progress), jnp.bool_(ready)
        learner, buffer, losses = self._learn(learner, buffer, rollouts, np.int32(first), learn_key, share, go)
        counted = {k: floats(jax.device_get(found)) for k, found in sums.items()}
        return learner, buffer, plays, self._total(counted), {**floats(jax.device_get(losses)), "clock": clock}, spent

    def _total(self, counted: Mapping[int, Mapping[str, float]]) -> dict[str, float]:
        """Sums over homes, and those of single homes. `counted`: by number of the home."""
        total = {name: sum(one[name] for one in counted.values()) for name in next(iter(counted.values()))}
        for k, home in enumerate(self._env.homes):
            for name in OF_HOMES:
                own = counted[k][name] if k in counted else 0.0
                total[f"{name}/{home}"] = total.get(f"{name}/{home}", 0.0) + own
        return total


def finite(tree: Any) -> Array:
    """Whether all floating-point numbers of a tree are finite."""
    floats = [a for a in jax.tree.leaves(tree) if jnp.issubdtype(a.dtype, jnp.floating)]
    return jnp.stack([jnp.isfinite(a).all() for a in floats]).all()


def floats(tree: Mapping[str, Any]) -> dict[str, float]:
    """Scalars as Python floats."""
    return {name: float(np.asarray(value)) for name, value in tree.items()}
