"""Memory that a step needs for its own purposes, taken once and not by every CUDA graph.

MuJoCo Warp allocates some 70 arrays in every step. Captured in a CUDA graph they are memory of that graph, which it
keeps: 32 graphs may be held, one for each set of buffers that JAX calls a step with, and with 8,192 worlds of a
humanoid, whose fingers make a hundred convex contacts, each would take 10 GB. Here arrays of a step lie in a block of
memory that was allocated before (`reserve`); they take places in it and leave them in the order in which the step is
captured, which is the order in which its kernels run (those of convex pairs, which run side by side, keep their places
until all have ended). All programs of a device share the block: JAX runs them one after the other, on one stream. What
does not fit is allocated as before.
"""

from __future__ import annotations

import bisect
import contextlib
import threading
from collections.abc import Iterator
from typing import Any

import warp as wp

ALIGNMENT = 256
"""Bytes, as of CUDA's own allocations."""

ROOM = 1.1
"""A block is this much larger than the most that lies in it at a time, for gaps between arrays."""


class Arena:
    """Places in a block of memory; an allocator of Warp's."""

    deallocate_requires_context_guard = False

    def __init__(self, start: int, size: int, otherwise: Any):
        """`start`: address of the block. `otherwise`: the allocator for what does not fit."""
        self._otherwise = otherwise
        self._free = [(start, size)]  # places, by address
        self._taken: dict[int, int] = {}
        self._lock = threading.Lock()

    def allocate(self, size_in_bytes: int) -> int:
        """An address: of the first place that is large enough."""
        size = -(-max(size_in_bytes, 1) // ALIGNMENT) * ALIGNMENT
        with self._lock:
            for k, (start, room) in enumerate(self._free):
                if room >= size:
                    self._free[k : k + 1] = [(start + size, room - size)] if room > size else []
                    self._taken[start] = size
                    return start
        return self._otherwise.allocate(size_in_bytes)

    def deallocate(self, ptr: int, size_in_bytes: int) -> None:
        """Gives a place back."""
        with self._lock:
            size = self._taken.pop(ptr, 0)
            if size:
                self._give_back(ptr, size)
                return
        self._otherwise.deallocate(ptr, size_in_bytes)

    def _give_back(self, start: int, size: int) -> None:
        k = bisect.bisect(self._free, (start, 0))
        if k < len(self._free) and self._free[k][0] == start + size:
            size += self._free.pop(k)[1]
        if k and sum(self._free[k - 1]) == start:
            k -= 1
            begin, before = self._free.pop(k)
            start, size = begin, before + size
        self._free.insert(k, (start, size))


class Counter:
    """Another allocator, which counts the most bytes that were allocated at a time: how large a block must be."""

    deallocate_requires_context_guard = True

    def __init__(self, allocator: Any):
        self._allocator, self._now, self.most, self.arrays = allocator, 0, 0, 0

    def allocate(self, size_in_bytes: int) -> int:
        """As the other."""
        self._now += size_in_bytes
        self.most, self.arrays = max(self.most, self._now), self.arrays + 1
        return self._allocator.allocate(size_in_bytes)

    def deallocate(self, ptr: int, size_in_bytes: int) -> None:
        """As the other."""
        self._now -= size_in_bytes
        self._allocator.deallocate(ptr, size_in_bytes)

    def block(self, worlds: int) -> int:
        """Bytes for so many worlds, where one was counted; nearly all arrays are as long as there are worlds."""
        return int(ROOM * self.most * worlds) + ALIGNMENT * self.arrays


_arenas: dict[str, tuple[int, Arena]] = {}
_lock = threading.Lock()


def reserve(device: Any, size: int) -> None:
    """Makes sure that a CUDA device has a block of so many bytes. Smaller ones stay: captured graphs use them."""
    with _lock:
        if _arenas.get(device.alias, (0, None))[0] < size:
            start = device.default_allocator.allocate(size)  # which waits, so that any stream may use it
            _arenas[device.alias] = size, Arena(start, size, device.get_allocator())


@contextlib.contextmanager
def used() -> Iterator[None]:
    """Inside the block arrays of the present device are made in its block of memory, if it has one."""
    device = wp.get_device()
    if device.alias not in _arenas:
        yield
        return
    with wp.ScopedAllocator(device, _arenas[device.alias][1]):
        yield
