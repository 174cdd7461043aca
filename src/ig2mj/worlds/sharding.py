"""Worlds shared out over devices with JAX's own sharding: one process, or several hosts under `jax.distributed`.

Each device steps its own part, nothing is sent between them, and the world axis of every array is sharded. A world's
random streams belong to its global number, so it does not matter on which device it lands.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.sharding import Mesh, NamedSharding
from jax.sharding import PartitionSpec as P
from jaxtyping import Bool, Float

from ig2mj.engine.view import Array
from ig2mj.errors import EngineError
from ig2mj.predicates.compile import Verdict
from ig2mj.worlds.batch import Batch, Worlds

AXIS = "worlds"

SHARED = ("cdof_tri_col", "cdof_tri_row")
"""MJX-Warp's arrays that are the same for all worlds and on all devices."""


class ShardedWorlds:
    """The functions of `Worlds`, over several devices. All of them are jitted."""

    def __init__(self, make: Callable[[int], Worlds], num_worlds: int, devices: Sequence[Any] | None = None):
        """Shares worlds out.

        Args:
          make: builds `Worlds` of a given number of worlds: one device's part.
          num_worlds: in all.
          devices: None: all of `jax.devices()`.

        Raises:
          EngineError: the worlds do not divide evenly, or the engine is not pure.
        """
        chosen = list(devices) if devices is not None else jax.devices()
        if num_worlds % len(chosen):
            raise EngineError(
                f"{num_worlds} worlds cannot be shared by {len(chosen)} devices (take a multiple of {len(chosen)})"
            )
        self.mesh = Mesh(np.array(chosen), (AXIS,))
        self.num_worlds, self.part = num_worlds, num_worlds // len(chosen)
        self.local = make(self.part)
        if not self.local.engine.pure:
            raise EngineError(f"the {self.local.engine.name} engine has no devices to share worlds over")
        shape = jax.eval_shape(self.local.start)
        self.specs: Batch = jax.tree_util.tree_map_with_path(_spec, shape)
        self._start = self._mapped(
            lambda seed: self.local.start(seed, jax.lax.axis_index(AXIS) * self.part), (P(),), self.specs
        )
        verdict = P(AXIS)  # of all its arrays
        self._step = self._mapped(self.local.step, (self.specs, P(AXIS)), (self.specs, verdict), donate=(0,))
        self._step_held = self._mapped(self.local.step, (self.specs,), (self.specs, verdict), donate=(0,))
        self._reset = self._mapped(self.local.reset, (self.specs, P(AXIS)), self.specs, donate=(0,))

    def start(self, seed: int = 0) -> Batch:
        """All worlds at the start of episode 0."""
        return self._start(jnp.asarray(seed, jnp.int32))

    def step(self, batch: Batch, ctrl: Float[Array, "W nu"] | None = None) -> tuple[Batch, Verdict | None]:
        """One control step of every world; the batch given is used up."""
        return self._step_held(batch) if ctrl is None else self._step(batch, ctrl)

    def reset(self, batch: Batch, mask: Bool[Array, "W"]) -> Batch:
        """New episodes in the masked worlds; the batch given is used up."""
        return self._reset(batch, mask)

    def place(self, array: Array) -> Array:
        """Puts an array with a leading world axis onto the devices."""
        return jax.device_put(array, NamedSharding(self.mesh, P(AXIS)))

    def _mapped(self, act: Callable[..., Any], ins: Any, outs: Any, donate: tuple[int, ...] = ()) -> Callable[..., Any]:
        mapped = jax.shard_map(act, mesh=self.mesh, in_specs=ins, out_specs=outs, check_vma=False)
        return jax.jit(mapped, donate_argnums=donate)


def _spec(path: Any, leaf: Any) -> P:
    name = getattr(path[-1], "name", "")
    return P() if leaf.ndim == 0 or name in SHARED else P(AXIS)
