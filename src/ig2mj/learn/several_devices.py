"""`ManyDevices`: an iteration of a training run on several devices of one or more processes.

Each device steps its part of the worlds in a compiled program of its own, called from a thread of its own: XLA cannot
compile one program for several GPUs that holds MJX-Warp's calls (`ig2mj.worlds.sharding`). Then one program over all
devices learns. Each device learns from its part of the replay buffer, gradients are averaged, and all devices hold the
same weights.

The devices may belong to several processes on several hosts (`ig2mj.cluster.team`). All processes run the same loop,
and the program over all devices synchronises them. The clock and the statistics of episodes pass through that program,
so that all processes take the same decisions.

Axes: W worlds, T steps.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import jax
import numpy as np
from jax.sharding import Mesh, NamedSharding, PartitionSpec

from ig2mj.cluster.team import Team
from ig2mj.engine.view import Array
from ig2mj.errors import EngineError
from ig2mj.learn.collect import Play, TrainingEnv, begin, collect_fn
from ig2mj.learn.iteration import Algorithm, finite, floats
from ig2mj.learn.nonempty_leaves import nonempty, nonempty_specs, restored, shards_of

AXIS = "devices"
"""The axis of devices, over which algorithms average gradients."""

SEED_STRIDE = 7919
"""Between the seeds of two devices' worlds."""


class ManyDevices:
    """See the module's text."""

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
        """The algorithm's buffer at the start of a run, each part on its device."""
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
