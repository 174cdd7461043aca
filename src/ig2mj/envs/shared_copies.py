"""`SharedCopies`: copies of worlds in memory that several processes share, one place for each world.

A copy of a furnished home has 0.1 MB in some fifty arrays. Written to pipes, the copies of an agent step of 1,024
worlds, some forty, keep the process that steps the worlds from stepping them.

Axes: W worlds, k of them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import jax
import numpy as np

from ig2mj.engine.snapshot import Snapshot
from ig2mj.planning.away import WorldCopy

ALIGNED = 64
"""Bytes to which arrays are aligned."""


class SharedCopies:
    """See the module's text. Reading and writing a place must not overlap.

    Attributes:
      like: a copy of a world, whose arrays have the shapes and types of all. memory: bytes that hold all copies.
    """

    def __init__(self, like: WorldCopy, worlds: int, memory: Any = None, allocate: Callable[[int], Any] = bytearray):
        """
        Args:
          like: see above. worlds: W. memory: of another `SharedCopies` with the same arguments; None: new memory.
          allocate: makes memory of so many bytes.
        """
        self.like = like
        leaves, self._structure = jax.tree.flatten(like)
        offsets, size = [], 0
        for leaf in leaves:
            offsets.append(size)
            size += -(-leaf.nbytes * worlds // ALIGNED) * ALIGNED
        self.memory = allocate(max(size, 1)) if memory is None else memory
        self._arrays = [
            np.frombuffer(self.memory, leaf.dtype, worlds * leaf.size, offset).reshape(worlds, *leaf.shape)
            for leaf, offset in zip(leaves, offsets, strict=True)
        ]

    def put(self, worlds: Sequence[int], physics: Snapshot, states: Sequence[np.ndarray]) -> None:
        """Copies k worlds. `physics`, and leaves of the extended `states`: with an axis of k worlds."""
        index = np.asarray(worlds, np.int64)
        arrays = jax.tree.leaves(WorldCopy(physics, [a[:, None] for a in states]))
        for place, array in zip(self._arrays, arrays, strict=True):
            place[index] = array

    def get(self, world: int) -> WorldCopy:
        """The copy of a world, in arrays of its own."""
        return jax.tree.unflatten(self._structure, [np.array(array[world]) for array in self._arrays])
