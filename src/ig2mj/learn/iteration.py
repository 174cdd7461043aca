"""An iteration of a run, on one device or on several: the worlds play, then the algorithm learns from it.

On one device with a pure engine both are one program, or two. On several, every device plays its own part of the worlds
in a program of its own, from a thread of its own (XLA cannot compile one program for several GPUs that holds MJX-Warp's
calls, `ig2mj.worlds.sharding`); then one program over all devices learns: each from the part of the replay buffer that
it holds, with gradients averaged. Weights are the same everywhere.

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

from ig2mj.engine.view import Array
from ig2mj.errors import EngineError
from ig2mj.learn.collect import NativeCollector, Play, TrainingEnv, begin, collect_fn
from ig2mj.learn.perception import Perception

AXIS = "devices"
"""The axis of devices, over which algorithms average gradients."""

APART = 7919
"""Between the seeds of two devices' worlds."""


@runtime_checkable
class Algorithm(Protocol):
    """What the loop asks of an algorithm; all methods but the properties are pure."""

    name: str
    perception: Perception
    action_size: int
    config: Any
    actor: Any
    hint: Any

    @property
    def length(self) -> int: ...

    def warm_up(self, resumed: bool) -> int: ...

    def init(self, key: Array) -> Any: ...

    def memory(self, num_worlds: int) -> Any: ...

    def noise(self, num_worlds: int) -> Any: ...

    def act(self, learner: Any, noise: Any, seen: Any, key: Array, advice: Any) -> tuple[Array, Any, Any]: ...

    def learn(
        self, learner: Any, memory: Any, rollout: Any, key: Array, progress: Array, ready: Array
    ) -> tuple[Any, Any, dict[str, Array]]: ...


class OneDevice:
    """A rollout and what is learned from it: one program on a pure engine, else the parts in turn."""

    def __init__(self, env: TrainingEnv, algorithm: Algorithm, programs: int = 1):
        """`programs`: 1 or 2, on a pure engine; with 2 the simulator's time is known."""
        self._env, self._algorithm, self.num_worlds = env, algorithm, env.num_worlds
        self._whole = None
        if env.pure and programs == 1:

            def whole(learner: Any, memory: Any, play: Play, key: Array, progress: Array, ready: Array) -> Any:
                play_key, learn_key = jax.random.split(key)
                play, rollout, sums = collect_fn(
                    env, algorithm.perception, algorithm.act, algorithm.hint, learner, play, play_key, algorithm.length
                )
                learner, memory, losses = algorithm.learn(learner, memory, rollout, learn_key, progress, ready)
                return learner, memory, play, sums, {**losses, "all_finite": finite(learner)}

            self._whole = jax.jit(whole, donate_argnums=(0, 1, 2))
            return

        def learn(learner: Any, memory: Any, rollout: Any, key: Array, progress: Array, ready: Array) -> Any:
            learner, memory, losses = algorithm.learn(learner, memory, rollout, key, progress, ready)
            return learner, memory, {**losses, "all_finite": finite(learner)}

        def collect(learner: Any, play: Play, key: Array) -> Any:
            return collect_fn(
                env, algorithm.perception, algorithm.act, algorithm.hint, learner, play, key, algorithm.length
            )

        self._learn = jax.jit(learn, donate_argnums=(0, 1))
        if env.pure:
            program = jax.jit(collect, donate_argnums=1)

            def timed(learner: Any, play: Play, key: Array) -> Any:
                began = time.perf_counter()
                found = jax.block_until_ready(program(learner, play, key))
                return *found, time.perf_counter() - began

            self._collect = timed
        else:
            native = NativeCollector(env, algorithm.perception, algorithm.act, algorithm.hint)
            self._collect = lambda learner, play, key: native(learner, play, key, algorithm.length)

    def memory(self) -> Any:
        """What belongs to the worlds, at first."""
        return self._algorithm.memory(self.num_worlds)

    def begin(self, seed: int) -> Any:
        """All worlds at the start of an episode."""
        return begin(self._env, self._algorithm.noise(self.num_worlds), seed)

    def place(self, learner: Any, memory: Any) -> tuple[Any, Any]:
        """Where an iteration wants them."""
        return learner, memory

    def __call__(
        self, learner: Any, memory: Any, play: Play, key: Array, progress: float, ready: bool
    ) -> tuple[Any, Any, Play, dict[str, float], dict[str, float], float | None]:
        share, go = jnp.float32(progress), jnp.bool_(ready)
        if self._whole is not None:
            learner, memory, play, sums, losses = self._whole(learner, memory, play, key, share, go)
            spent = None
        else:
            play_key, learn_key = jax.random.split(key)
            play, rollout, sums, spent = self._collect(learner, play, play_key)
            learner, memory, losses = self._learn(learner, memory, rollout, learn_key, share, go)
        sums, losses = jax.device_get((sums, losses))
        return learner, memory, play, floats(sums), floats(losses), spent


class ManyDevices:
    """The same over several devices of this process; see the module's text."""

    def __init__(self, env: TrainingEnv, algorithm: Algorithm, devices: Sequence[Any]):
        """
        Args:
          env: one device's part of the worlds. algorithm: made with `axis=AXIS`.

        Raises:
          EngineError: the engine is not pure.
        """
        if not env.pure:
            raise EngineError("several devices need an engine that runs on devices (warp or jax)")
        self._env, self._algorithm, self._devices = env, algorithm, list(devices)
        self.num_worlds = env.num_worlds * len(self._devices)
        self._mesh = Mesh(np.array(self._devices), (AXIS,))
        self._threads = ThreadPoolExecutor(len(self._devices), "ig2mj-learn")

        def collect(learner: Any, play: Play, key: Array) -> Any:
            return collect_fn(
                env, algorithm.perception, algorithm.act, algorithm.hint, learner, play, key, algorithm.length
            )

        def learn(learner: Any, memory: Any, rollout: Any, key: Array, progress: Array, ready: Array) -> Any:
            own = jax.random.fold_in(key, jax.lax.axis_index(AXIS))
            learner, memory, losses = algorithm.learn(learner, memory, rollout, own, progress, ready)
            return learner, memory, jax.lax.pmean({**losses, "all_finite": 1.0 * finite(learner)}, AXIS)

        self._collect = jax.jit(collect, donate_argnums=1)
        kinds: list[Any] = []

        def leaves() -> list[Any]:
            memory = algorithm.memory(self.num_worlds)
            kinds.append(jax.tree.structure(memory))
            return jax.tree.leaves(memory)

        specs = self._specs(jax.eval_shape(leaves))
        self._memory_specs, whole = jax.tree.unflatten(kinds[0], specs), PartitionSpec()
        self._learn = jax.jit(
            jax.shard_map(
                learn,
                mesh=self._mesh,
                in_specs=(whole, self._memory_specs, PartitionSpec(None, AXIS), whole, whole, whole),
                out_specs=(whole, self._memory_specs, whole),
                check_vma=False,
            ),
            donate_argnums=(0, 1),
        )

    def _specs(self, shapes: Sequence[Any]) -> list[PartitionSpec]:
        """How the arrays of a memory are shared out: [W] and [T, W, ...] by worlds, all others are on every device."""
        found = []
        for shape in (a.shape for a in shapes):
            at = min(len(shape), 2) - 1
            mine = at >= 0 and shape[at] == self.num_worlds
            found.append(PartitionSpec(*[None] * at, AXIS) if mine else PartitionSpec())
        return found

    def memory(self) -> Any:
        """What belongs to the worlds, at first, each part where it belongs."""
        return self.place(None, self._algorithm.memory(self.num_worlds))[1]

    def begin(self, seed: int) -> Any:
        """All worlds at the start of an episode, in one batch for each device."""
        env, noise = self._env, self._algorithm.noise
        plays = self._each(lambda k: begin(env, noise(env.num_worlds), seed + k * APART))
        return [jax.device_put(play, device) for play, device in zip(plays, self._devices, strict=True)]

    def place(self, learner: Any, memory: Any) -> tuple[Any, Any]:
        """Weights on every device, the replay buffer's parts on their own."""
        specs = jax.tree.map(lambda spec: NamedSharding(self._mesh, spec), self._memory_specs)
        everywhere = NamedSharding(self._mesh, PartitionSpec())
        return jax.device_put(learner, everywhere), jax.device_put(memory, specs)

    def __call__(
        self, learner: Any, memory: Any, plays: list[Play], key: Array, progress: float, ready: bool
    ) -> tuple[Any, Any, list[Play], dict[str, float], dict[str, float], float]:
        play_key, learn_key = jax.random.split(key)
        keys = np.asarray(jax.random.split(play_key, len(self._devices)))
        began = time.perf_counter()
        done = self._each(lambda k: jax.block_until_ready(self._collect(self._part(learner, k), plays[k], keys[k])))
        spent = time.perf_counter() - began
        rollout = jax.tree.map(self._joined, *[rollout for _, rollout, _ in done])
        share, go = jnp.float32(progress), jnp.bool_(ready)
        learner, memory, losses = self._learn(learner, memory, rollout, np.asarray(learn_key), share, go)
        sums = jax.tree.map(lambda *a: sum(float(x) for x in a), *[sums for _, _, sums in done])
        return learner, memory, [play for play, _, _ in done], sums, floats(jax.device_get(losses)), spent

    def _part(self, tree: Any, k: int) -> Any:
        """One device's copy of what is the same on all."""
        device = self._devices[k]
        return jax.tree.map(lambda a: next(s.data for s in a.addressable_shards if s.device == device), tree)

    def _joined(self, *pieces: jax.Array) -> jax.Array:
        shape = (pieces[0].shape[0], self.num_worlds, *pieces[0].shape[2:])
        sharding = NamedSharding(self._mesh, PartitionSpec(None, AXIS))
        return jax.make_array_from_single_device_arrays(shape, sharding, list(pieces))

    def _each(self, act: Callable[[int], Any]) -> list[Any]:
        """Runs something for every device, on its own thread with that device as the default."""

        def on(k: int) -> Any:
            with jax.default_device(self._devices[k]):
                return act(k)

        return list(self._threads.map(on, range(len(self._devices))))


def finite(tree: Any) -> Array:
    """No number of a tree is lost."""
    floats = [a for a in jax.tree.leaves(tree) if jnp.issubdtype(a.dtype, jnp.floating)]
    return jnp.stack([jnp.isfinite(a).all() for a in floats]).all()


def floats(tree: Mapping[str, Any]) -> dict[str, float]:
    """Numbers of the host."""
    return {name: float(np.asarray(value)) for name, value in tree.items()}
