"""Worlds shared out over devices: one process, or several hosts under `jax.distributed`.

Each device runs its own program on its own part of the worlds, from a thread of its own, and nothing is sent between
devices; what is asked for is put together as one JAX array sharded over the world axis. A world's random streams belong
to its global number, so it does not matter on which device it lands.

Why not one program for all devices (`shard_map`): XLA crashes while it compiles such a program for two GPUs when it
holds MJX-Warp's calls (JAX 0.11.2; one device, and two CPU devices, are fine). One program per device needs nothing of
the compiler, and as no world talks to another it does the same work.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from flax import struct
from jax.sharding import Mesh, NamedSharding, PartitionSpec
from jaxtyping import Bool, Float

from ig2mj.engine.view import Array
from ig2mj.errors import EngineError
from ig2mj.predicates.compile import GoalStatus
from ig2mj.worlds.batch import Batch, Worlds

AXIS = "worlds"

Control = Callable[[Batch, Any], tuple[Float[Array, "W nu"] | None, Any]]
"""Controls of the next step from a device's part of the worlds and a carry, and the new carry. Pure."""


@struct.dataclass
class Shards:
    """The worlds of this process: one batch per device, in the order of the devices."""

    parts: tuple[Batch, ...]


class ShardedWorlds:
    """The functions of `Worlds`, over several devices. All of them are jitted, and use up the shards they are given."""

    def __init__(self, make: Callable[[int], Worlds], num_worlds: int, devices: Sequence[Any] | None = None):
        """Shares worlds out.

        Args:
          make: builds `Worlds` of a given number of worlds: one device's part.
          num_worlds: in all, on all hosts.
          devices: of this process; None: all of `jax.local_devices()`.

        Raises:
          EngineError: the worlds do not divide evenly, or the engine is not pure.
        """
        self.devices = list(devices) if devices is not None else jax.local_devices()
        hosts = jax.process_count()
        count = len(self.devices) * hosts
        if num_worlds % count:
            raise EngineError(f"{num_worlds} worlds cannot be shared by {count} devices (take a multiple of {count})")
        self.num_worlds, self.part = num_worlds, num_worlds // count
        self.local = make(self.part)
        if not self.local.engine.pure:
            raise EngineError(f"the {self.local.engine.name} engine has no devices to share worlds over")
        self._first = jax.process_index() * len(self.devices) * self.part
        self._sharding = NamedSharding(Mesh(np.array(self.devices), (AXIS,)), PartitionSpec(AXIS))
        self._threads = ThreadPoolExecutor(len(self.devices), "ig2mj-device")
        self._start = jax.jit(self.local.start)
        self._step = jax.jit(self.local.step, donate_argnums=0)
        self._reset = jax.jit(self.local.reset, donate_argnums=0)
        self._rollout = jax.jit(self._scan, static_argnums=(2, 3), donate_argnums=(0, 1))

    def start(self, seed: int = 0) -> Shards:
        """All worlds at the start of episode 0."""
        return Shards(tuple(self._each(lambda k: self._start(jnp.int32(seed), jnp.int32(self._first + k * self.part)))))

    def step(self, shards: Shards, ctrl: Float[Array, "W nu"] | None = None) -> tuple[Shards, list[GoalStatus | None]]:
        """One control step of every world, and each device's statuses.

        Args:
          ctrl: of all worlds of this process, or None to keep the controls.
        """
        split = self.place(ctrl) if ctrl is not None else None
        local = None if split is None else [s.data for s in sorted(split.addressable_shards, key=self._order)]
        done = self._each(lambda k: self._step(shards.parts[k], None if local is None else local[k]))
        return Shards(tuple(batch for batch, _ in done)), [status for _, status in done]

    def rollout(
        self, shards: Shards, carries: Sequence[Any], control: Control, length: int
    ) -> tuple[Shards, list[Any]]:
        """`length` control steps without leaving the devices.

        Args:
          carries: one per device. control: the same function object each time, or it is compiled again.
        """
        done = self._each(lambda k: self._rollout(shards.parts[k], carries[k], control, length))
        return Shards(tuple(batch for batch, _ in done)), [carry for _, carry in done]

    def reset(self, shards: Shards, mask: Bool[Array, "W"]) -> Shards:
        """New episodes in the masked worlds of this process."""
        local = [s.data for s in sorted(self.place(mask).addressable_shards, key=self._order)]
        return Shards(tuple(self._each(lambda k: self._reset(shards.parts[k], local[k]))))

    def gather(self, shards: Shards, read: Callable[[Batch], Any]) -> Any:
        """What `read` takes of every part, as arrays over this process's worlds, sharded over its devices.

        `read` gives arrays that begin with the world axis, e.g. `lambda b: b.world.view.object_com`.
        """

        def one(*pieces: jax.Array) -> jax.Array:
            shape = (sum(p.shape[0] for p in pieces), *pieces[0].shape[1:])
            return jax.make_array_from_single_device_arrays(shape, self._sharding, list(pieces))

        return jax.tree.map(one, *(read(part) for part in shards.parts))

    def place(self, array: Array) -> jax.Array:
        """Puts an array over this process's worlds onto its devices."""
        return jax.device_put(array, self._sharding)

    def _scan(self, batch: Batch, carry: Any, control: Control, length: int) -> tuple[Batch, Any]:
        def body(state: tuple[Batch, Any], _: None) -> tuple[tuple[Batch, Any], None]:
            one, kept = state
            ctrl, kept = control(one, kept)
            return (self.local.step(one, ctrl)[0], kept), None

        return jax.lax.scan(body, (batch, carry), None, length)[0]

    def _each(self, act: Callable[[int], Any]) -> list[Any]:
        """Runs something for every device, each on its own thread with that device as the default."""

        def on(k: int) -> Any:
            with jax.default_device(self.devices[k]):
                return act(k)

        return list(self._threads.map(on, range(len(self.devices))))

    def _order(self, shard: Any) -> int:
        return self.devices.index(shard.device)
