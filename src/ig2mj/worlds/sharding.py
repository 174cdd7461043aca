"""Worlds distributed over devices: one process, or several hosts under `jax.distributed`.

Each device runs its own program on its own part of the worlds, from a thread of its own, and nothing is sent between
devices; what is asked for is put together as one JAX array sharded over the world axis. A world's random streams belong
to its global number, so it does not matter on which device it lands.

Why not one program for all devices (`shard_map`): XLA crashes while it compiles such a program for two GPUs when it
holds MJX-Warp's calls (JAX 0.11.2; one device, and two CPU devices, are fine). One program per device needs nothing of
the compiler, and since worlds do not exchange anything it does the same work.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from flax import struct
from jax.sharding import Mesh, NamedSharding, PartitionSpec
from jaxtyping import Bool, Float

from ig2mj.engine.base import Engine, Write, check_pure
from ig2mj.engine.view import Array
from ig2mj.errors import EngineError
from ig2mj.predicates.compile import GoalStatus
from ig2mj.process import entry_point
from ig2mj.worlds.batch import Batch
from ig2mj.worlds.batch_files import load_parts, restored_batch, save_parts
from ig2mj.worlds.core import Core, Policy

AXIS = "worlds"


@struct.dataclass
class Shards:
    """The worlds of this process: one batch per device, in the order of the devices."""

    parts: tuple[Batch, ...]

    def __repr__(self) -> str:
        return f"Shards({', '.join(map(repr, self.parts))})"


@entry_point
class ShardedWorlds:
    """The verbs of `Face`, over several devices; a batch is `Shards`, which verbs consume."""

    def __init__(self, make: Callable[[int], Core], num_worlds: int, devices: Sequence[Any] | None = None):
        """Shares worlds out.

        Args:
          make: builds a core of a given number of worlds: one device's part.
          num_worlds: in all, on all hosts.
          devices: of this process; None: all of `jax.local_devices()`.

        Raises:
          EngineError: the worlds do not divide evenly, or the engine's steps cannot be compiled.
        """
        self.devices = list(devices) if devices is not None else jax.local_devices()
        hosts = jax.process_count()
        count = len(self.devices) * hosts
        if num_worlds % count:
            raise EngineError(f"{num_worlds} worlds cannot be shared by {count} devices (take a multiple of {count})")
        self.num_worlds, self.part = num_worlds, num_worlds // count
        self.local = make(self.part)
        engine = self.local.engine
        check_pure(engine, EngineError(f"the {engine.name} engine has no devices to share worlds over"))
        engine.prepare_devices(self.devices)
        self._first = jax.process_index() * len(self.devices) * self.part
        self._sharding = NamedSharding(Mesh(np.array(self.devices), (AXIS,)), PartitionSpec(AXIS))
        self._threads = ThreadPoolExecutor(len(self.devices), "ig2mj-device")
        _ = self.local.starts.pool, self.local.starts.floor  # made here, once, and not on every device's thread

    @property
    def engine(self) -> Engine:
        """The engine of one device's part."""
        return self.local.engine

    def start(self, seed: int = 0) -> Shards:
        """All worlds at the start of their first episode."""
        return Shards(
            tuple(self._each(lambda k: self.local.start(jnp.int32(seed), jnp.int32(self._first + k * self.part))))
        )

    def step(self, batch: Shards, action: Float[Array, "W n"] | None = None) -> tuple[Shards, GoalStatus]:
        """One control step, and the status of the goal, of all worlds of this process.

        Args:
          action: of all worlds of this process (see `Core.step`), or None to keep the last controls.
        """
        local = [None] * len(self.devices) if action is None else self._split(action)
        done = self._each(lambda k: self.local.step(batch.parts[k], local[k]))
        return Shards(tuple(part for part, _ in done)), self._joined([status for _, status in done])

    def rollout(self, batch: Shards, carry: Sequence[Any], policy: Policy, length: int) -> tuple[Shards, list[Any]]:
        """`length` control steps without leaving the devices; see `Core.rollout`.

        Args:
          carry: one per device.
        """
        done = self._each(lambda k: self.local.rollout(batch.parts[k], carry[k], policy, length))
        return Shards(tuple(part for part, _ in done)), [carried for _, carried in done]

    def reset(self, batch: Shards, mask: Bool[Array, "W"]) -> Shards:
        """New episodes in the masked worlds of this process."""
        local = self._split(mask)
        return Shards(tuple(self._each(lambda k: self.local.reset(batch.parts[k], local[k]))))

    def write(self, batch: Shards, write: Write) -> Shards:
        """Moves objects and joints, or switches grasps, without passing time, in all worlds of this process."""
        leaves, structure = jax.tree.flatten(write)
        parts = [self._split(leaf) for leaf in leaves]
        local = [jax.tree.unflatten(structure, [part[k] for part in parts]) for k in range(len(self.devices))]
        return Shards(tuple(self._each(lambda k: self.local.write(batch.parts[k], local[k]))))

    def fork(self, batch: Shards) -> Shards:
        """An independent copy, each part on its device. Raises StaleStateError."""
        return Shards(tuple(self._each(lambda k: self.local.fork(batch.parts[k]))))

    def save(self, batch: Shards, file: str | os.PathLike) -> None:
        """Writes all worlds of this process to an `.npz` file, for `load` or for a core of as many worlds.

        Raises:
          StaleStateError: the batch was consumed. InputError: the file cannot be written.
        """
        save_parts(self.local, batch.parts, file)

    def load(self, file: str | os.PathLike) -> Shards:
        """The worlds that `save` wrote. Raises InputError, as `Face.load`."""
        saved = load_parts(self.local, len(self.devices), file)
        return Shards(tuple(self._each(lambda k: restored_batch(self.local, saved[k]))))

    def metrics(self, batch: Shards) -> dict[str, int]:
        """Of all worlds of this process; see `Face.metrics`."""
        each = [self.local.metrics(part) for part in batch.parts]
        return {name: sum(one[name] for one in each) for name in each[0]}

    def gather(self, batch: Shards, read: Callable[[Batch], Any]) -> Any:
        """What `read` takes of every part, as arrays over this process's worlds, sharded over its devices.

        `read` gives arrays that begin with the world axis, e.g. `lambda b: b.world.view.object_com`.
        """
        return self._joined([read(part) for part in batch.parts])

    def place(self, array: Array) -> jax.Array:
        """Puts an array over this process's worlds onto its devices."""
        return jax.device_put(array, self._sharding)

    def _joined(self, parts: Sequence[Any]) -> Any:
        """One pytree of arrays over this process's worlds from one per device."""

        def one(*pieces: jax.Array) -> jax.Array:
            shape = (sum(p.shape[0] for p in pieces), *pieces[0].shape[1:])
            return jax.make_array_from_single_device_arrays(shape, self._sharding, list(pieces))

        return jax.tree.map(one, *parts)

    def _split(self, array: Array) -> list[jax.Array]:
        """Each device's part of an array over this process's worlds."""
        return [
            s.data for s in sorted(self.place(array).addressable_shards, key=lambda s: self.devices.index(s.device))
        ]

    def _each(self, act: Callable[[int], Any]) -> list[Any]:
        """Runs something for every device, each on its own thread with that device as the default."""

        def on(k: int) -> Any:
            with jax.default_device(self.devices[k]):
                return act(k)

        return list(self._threads.map(on, range(len(self.devices))))
