"""An iteration of a run, on one device or on several: the worlds play, then the algorithm learns from it.

On one device with a pure engine both are one program, or two. On several, every device plays its own part of the worlds
in a program of its own, from a thread of its own (XLA cannot compile one program for several GPUs that holds MJX-Warp's
calls, `ig2mj.worlds.sharding`); then one program over all devices learns: each from the part of the replay buffer that
it holds, with gradients averaged. Weights are the same everywhere. The devices may belong to several processes, on
several hosts (`ig2mj.cluster.team`): every process runs the same loop, and the program over all devices keeps them in
step. What decides about the loop (the clock, what the episodes gave) goes through that program, too, so that all
processes decide alike.

Axes: W worlds, T steps.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any, Protocol, runtime_checkable

import jax
import jax.numpy as jnp
import numpy as np
from jax.sharding import Mesh, NamedSharding, PartitionSpec

from ig2mj.cluster.team import Team
from ig2mj.engine.view import Array
from ig2mj.envs.experts import expert_of
from ig2mj.errors import EngineError
from ig2mj.learn.collect import NativeCollector, Play, TrainingEnv, begin, collect_fn, started
from ig2mj.learn.nonempty_leaves import nonempty, nonempty_specs, restored, shards_of
from ig2mj.learn.perception import Perception
from ig2mj.learn.protocols import as_adviser
from ig2mj.process.gc_pause import Compiled, compile_together

AXIS = "devices"
"""The axis of devices, over which algorithms average gradients."""

SEED_STRIDE = 7919
"""Between the seeds of two devices' worlds."""


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
        """What belongs to the worlds, at first."""
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
        """Where an iteration wants them."""
        return jax.tree.map(jnp.asarray, (learner, buffer))

    def __call__(
        self, learner: Any, buffer: Any, play: Play, key: Array, progress: float, ready: bool, clock: float = 0.0
    ) -> tuple[Any, Any, Play, dict[str, float], dict[str, float], float | None]:
        """Where all stands after an iteration, sums over its steps, losses, and seconds of the simulator if known."""
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
    """The same over several homes on one device: each home's worlds play in a program of their own, with an expert of
    their own, and one program learns from all of it."""

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
        """What belongs to the worlds, at first."""
        return self._algorithm.buffer(self.num_worlds)

    def begin(self, seed: int) -> list[Play]:
        """All worlds at the start of an episode, home by home."""
        state = self._algorithm.acting_state
        parts = enumerate(self._env.envs)
        return [begin(part, state(part.num_worlds), self._env.seed_of(k, seed)) for k, part in parts]

    def place(self, learner: Any, buffer: Any) -> tuple[Any, Any]:
        """Where an iteration wants them."""
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


class ManyDevices:
    """The same over several devices, of this process or of several; see the module's text."""

    def __init__(self, env: TrainingEnv, algorithm: Algorithm, devices: Sequence[Any], team: Team | None = None):
        """
        Args:
          env: one device's part of the worlds. algorithm: made with `axis=AXIS`. devices: of all processes, in the same
            order in each of them. team: these processes.

        Raises:
          EngineError: the engine is not pure, or the samples of an update are not shared evenly.
        """
        if not env.pure:
            raise EngineError("several devices need an engine that runs on devices (warp or jax)")
        own = [d for d in devices if d.process_index == jax.process_index()]
        batch = getattr(algorithm.config, "batch_size", 0)
        if batch % len(devices):
            raise EngineError(
                f"a batch of {batch} samples cannot be shared by {len(devices)} devices: --set batch_size=..."
            )
        env.prepare_devices(own)
        self._env, self._algorithm, self._devices, self._team = env, algorithm, own, team or Team()
        self._first, self._count = list(devices).index(own[0]), len(devices)
        self.num_worlds = env.num_worlds * self._count
        self._mesh = Mesh(np.array(devices), (AXIS,))
        self._threads = ThreadPoolExecutor(len(self._devices), "ig2mj-learn")

        def collect(learner: Any, play: Play, key: Array) -> Any:
            play, rollout, sums = collect_fn(
                env, algorithm.perception, algorithm.act, algorithm.adviser, learner, play, key, algorithm.length
            )
            return play, rollout, jax.tree.map(lambda a: a[None], sums)

        self._collect: list[Callable[..., Any]] = []  # one for each device, once they are compiled
        self._collect_fn = jax.jit(collect, donate_argnums=1)
        kinds: list[Any] = []

        def leaves() -> list[Any]:
            buffer = algorithm.buffer(self.num_worlds)
            kinds.append(jax.tree.structure(buffer))
            return jax.tree.leaves(buffer)

        specs = self._specs(jax.eval_shape(leaves))
        self._buffer_specs = jax.tree.unflatten(kinds[0], specs)
        self._learn: Callable[..., tuple] | None = None

    def _program(self, learner: Any, buffer: Any, rollout: Any, sums: Any) -> Callable[..., tuple]:
        """What learns, on all devices at once; of these shapes. It takes and gives trees as `nonempty` has them."""
        algorithm, whole, each = self._algorithm, PartitionSpec(), PartitionSpec(AXIS)
        trees = (learner, buffer, rollout, sums)
        specs = (whole, self._buffer_specs, PartitionSpec(None, AXIS), each)
        parts = [shards_of(tree, of_it, self._count) for tree, of_it in zip(trees, specs, strict=True)]
        into = [nonempty_specs(tree, of_it) for tree, of_it in zip(trees, specs, strict=True)]

        def learn(*given: Any) -> tuple:
            *leaves, times, key, ready = given
            learner, buffer, rollout, sums = (restored(*pair) for pair in zip(parts, leaves, strict=True))
            own = jax.random.fold_in(key, jax.lax.axis_index(AXIS))
            progress, clock = jax.lax.pmax(times[0], AXIS)
            learner, buffer, losses = algorithm.learn(learner, buffer, rollout, own, progress, ready)
            losses = jax.lax.pmean({**losses, "all_finite": 1.0 * finite(learner)}, AXIS)
            total = jax.tree.map(lambda a: jax.lax.psum(a[0], AXIS), sums)
            return nonempty(learner), nonempty(buffer), total, losses, clock

        mapped = jax.shard_map(
            learn,
            mesh=self._mesh,
            in_specs=(*into, each, whole, whole),
            out_specs=(whole, into[1], whole, whole, whole),
            check_vma=False,
        )
        return jax.jit(mapped, donate_argnums=(0, 1))

    def _specs(self, shapes: Sequence[Any]) -> list[PartitionSpec]:
        """How the arrays of a buffer are shared out: [W] and [T, W, ...] by worlds, all others are on every device."""
        found = []
        for shape in (a.shape for a in shapes):
            at = min(len(shape), 2) - 1
            mine = at >= 0 and shape[at] == self.num_worlds
            found.append(PartitionSpec(*[None] * at, AXIS) if mine else PartitionSpec())
        return found

    def buffer(self) -> Any:
        """What belongs to the worlds, at first, each part where it belongs."""
        shardings = jax.tree.map(lambda spec: NamedSharding(self._mesh, spec), self._buffer_specs)
        return jax.jit(lambda: self._algorithm.buffer(self.num_worlds), out_shardings=shardings)()

    def begin(self, seed: int) -> Any:
        """All worlds at the start of an episode, in one batch for each device of this process."""
        env, acting_state = self._env, self._algorithm.acting_state
        plays = self._first_then_each(
            lambda k: begin(env, acting_state(env.num_worlds), seed + (self._first + k) * SEED_STRIDE)
        )
        return [jax.device_put(play, device) for play, device in zip(plays, self._devices, strict=True)]

    def place(self, learner: Any, buffer: Any) -> tuple[Any, Any]:
        """Weights on every device, the replay buffer's parts on their own."""
        learner = jax.tree.map(lambda a: self._placed(a, PartitionSpec()), learner)
        return learner, jax.tree.map(self._placed, buffer, self._buffer_specs)

    def _placed(self, array: Any, spec: PartitionSpec) -> jax.Array:
        sharding = NamedSharding(self._mesh, spec)
        if isinstance(array, jax.Array) and array.sharding.is_equivalent_to(sharding, array.ndim):
            return array
        held = np.asarray(array)
        return jax.make_array_from_callback(held.shape, sharding, lambda index: held[index])

    def __call__(
        self, learner: Any, buffer: Any, plays: list[Play], key: Array, progress: float, ready: bool, clock: float = 0.0
    ) -> tuple[Any, Any, list[Play], dict[str, float], dict[str, float], float]:
        """As `OneDevice.__call__`; `losses["clock"]` is the largest of all processes' clocks."""
        play_key, learn_key = jax.random.split(key)
        plays, rollouts, sums, spent = self.play(learner, plays, play_key)
        learner, buffer, sums, losses, latest = self.learn(
            learner, buffer, rollouts, sums, np.asarray(learn_key), progress, ready, clock
        )
        losses = {**floats(losses), "clock": latest}
        return learner, buffer, plays, floats(sums), losses, spent

    def play(self, learner: Any, plays: list[Play], key: Array) -> tuple[list[Play], list[Any], list[Any], float]:
        """Steps the worlds of this process's devices, of which each begins where its part of `plays` ended.

        Args:
          key: the same in every process.

        Returns:
          Where they stand now, their rollouts, the rollouts' sums (arrays [1]), and seconds.
        """
        keys = np.asarray(jax.random.split(key, self._count))[self._first :]
        began = time.perf_counter()

        if not self._collect:
            with self._team.turns():  # the first process compiles, the others find its programs in the cache
                self._collect = self._compiled(learner, plays, keys)
        done = self._each(lambda k: jax.block_until_ready(self._collect[k](self._part(learner, k), plays[k], keys[k])))
        spent = time.perf_counter() - began
        plays, rollouts, sums = ([one[k] for one in done] for k in range(3))
        return plays, rollouts, sums, spent

    def learn(
        self,
        learner: Any,
        buffer: Any,
        rollouts: Sequence[Any],
        sums: Sequence[Any],
        key: np.ndarray,
        progress: float,
        ready: bool,
        clock: float = 0.0,
    ) -> tuple[Any, Any, dict[str, Any], dict[str, Any], float]:
        """Learns from rollouts, one for each device of this process, each on its own device.

        Args:
          sums: of each rollout, arrays [1]. key: the same in every process. progress, clock: the largest count.

        Returns:
          Learner, buffer, sums over all devices, means of losses, and the largest clock.
        """
        rollout = jax.tree.map(lambda *a: self._joined(a, 1), *rollouts)
        total = jax.tree.map(lambda *a: self._joined(a, 0), *sums)
        row = np.array([[progress, clock]], np.float32)
        times = self._joined([jax.device_put(row, device) for device in self._devices], 0)
        trees = (learner, buffer, rollout, total)
        if self._learn is None:
            self._learn = self._program(*jax.eval_shape(lambda *trees: trees, *trees))
        leaves = [nonempty(tree) for tree in trees]
        learnt, kept, total, losses, latest = self._learn(*leaves, times, key, np.bool_(ready))
        learner, buffer = restored(learner, learnt), restored(buffer, kept)
        total, losses, latest = jax.device_get((total, losses, latest))
        return learner, buffer, total, losses, float(latest)

    def _compiled(self, learner: Any, plays: list[Play], keys: np.ndarray) -> list[Callable[..., Any]]:
        """The program that plays, for every device of this process: traced in turn, compiled side by side."""
        lowered = []
        for k, device in enumerate(self._devices):
            with jax.default_device(device):
                lowered.append(self._collect_fn.lower(self._part(learner, k), plays[k], keys[k]))
        return list(self._threads.map(lambda program: program.compile(), lowered))

    def _part(self, tree: Any, k: int) -> Any:
        """One device's copy of what is the same on all."""
        device = self._devices[k]
        return jax.tree.map(lambda a: next(s.data for s in a.addressable_shards if s.device == device), tree)

    def _joined(self, pieces: Sequence[jax.Array], axis: int) -> jax.Array:
        """One array over all devices from those of this process's devices, put side by side along an axis."""
        first = pieces[0].shape
        shape = (*first[:axis], first[axis] * self._count, *first[axis + 1 :])
        sharding = NamedSharding(self._mesh, PartitionSpec(*[None] * axis, AXIS))
        return jax.make_array_from_single_device_arrays(shape, sharding, list(pieces))

    def _each(self, act: Callable[[int], Any], begin: int = 0) -> list[Any]:
        """Runs something for every device from `begin` on, on its own thread with that device as the default."""

        def on(k: int) -> Any:
            with jax.default_device(self._devices[k]):
                return act(k)

        return list(self._threads.map(on, range(begin, len(self._devices))))

    def _first_then_each(self, act: Callable[[int], Any]) -> list[Any]:
        """The same for what is not compiled yet: the others find the first one's program in JAX's cache."""
        with jax.default_device(self._devices[0]):
            first = act(0)
        return [first, *self._each(act, 1)]


def finite(tree: Any) -> Array:
    """No number of a tree is lost."""
    floats = [a for a in jax.tree.leaves(tree) if jnp.issubdtype(a.dtype, jnp.floating)]
    return jnp.stack([jnp.isfinite(a).all() for a in floats]).all()


def floats(tree: Mapping[str, Any]) -> dict[str, float]:
    """Numbers of the host."""
    return {name: float(np.asarray(value)) for name, value in tree.items()}
