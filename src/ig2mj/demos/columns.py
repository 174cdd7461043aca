"""`Column`: one array of a recording, which stores each row once however many frames share it.

Frames are buffered as they come, as NumPy or JAX arrays on the host, and compared in batches, which takes a fraction of
the time of comparing them after each step, when other work has emptied the processor's caches.

Axes: F frames, W worlds, U rows that differ from the one before.
"""

from __future__ import annotations

import dataclasses
import hashlib
import itertools
import operator
from collections.abc import Sequence
from typing import Any

import numpy as np

SMALL = 4096
"""Bytes up to which NumPy arrays are copied; larger ones must not be changed afterwards."""

REMEMBERED = 65536
"""Number of first rows of runs that later runs are compared with."""


@dataclasses.dataclass
class Rows:
    """Rows of consecutive frames. `values`: [U, ...] or [U, W, ...]. `which`: [F] row of each frame, never falling.

    `source`: the buffer of the last frame.
    """

    values: np.ndarray
    which: np.ndarray
    source: Any


def gathered(buffers: Sequence[Any]) -> Rows:
    """Rows of buffers of one array; a buffer that repeats is the same row."""
    later, count = buffers[1:], len(buffers)
    if all(map(operator.is_not, later, buffers)):
        which, distinct = np.arange(count), buffers
    elif not any(map(operator.is_not, later, buffers)):
        which, distinct = np.zeros(count, np.int64), buffers[:1]
    else:
        first = [True, *map(operator.is_not, later, buffers)]
        which, distinct = np.cumsum(first) - 1, list(itertools.compress(buffers, first))
    shape = (len(distinct), *distinct[0].shape)
    try:
        content = b"".join(distinct)  # four times as fast as np.stack of JAX arrays
        values = np.frombuffer(content, distinct[0].dtype).reshape(shape)
    except (TypeError, ValueError, BufferError):  # in another memory, or with gaps
        values = np.stack([np.asarray(b) for b in distinct])
    return Rows(values, which, buffers[-1])


def held(buffers: Sequence[Any]) -> list[Any]:
    """Arrays of one frame to be buffered: JAX arrays as they are, small NumPy arrays copied."""
    return [a.copy() if isinstance(a, np.ndarray) and a.nbytes <= SMALL else a for a in buffers]


class Column:
    """The rows of one array in the file, of all worlds. Attributes: written: number of rows."""

    def __init__(self) -> None:
        self.written = 0
        self._last: dict[int, tuple[Any, bytes, int]] = {}  # of each world: buffer, content and place of its last row
        self._firsts: dict[bytes, int] = {}

    def place(
        self, world: int, rows: Rows, frames: np.ndarray, begins: Sequence[int] | np.ndarray, axis: int | None
    ) -> tuple[np.ndarray | int, np.ndarray | None]:
        """Assigns rows of the file to frames of a world.

        Args:
          frames: which of the rows' frames are the world's. begins: those of `frames`, by position, that begin a run.
          axis: where the world stands in the rows' second axis; None: the rows are its own.

        Returns:
          The place of each frame's row; rows to be written behind those that are there, or None.
        """
        last, content, at = self._last.get(world, (None, b"", -1))
        if len(rows.values) == 1 and rows.source is last and last is not None:
            return at, None
        values = rows.values if axis is None else rows.values[:, axis]
        rank, firsts = _ranks(values)
        which = rank[rows.which[frames]]
        places = np.full(len(firsts), -1, np.int64)
        if at >= 0 and values[firsts[which[0]]].tobytes() == content:
            places[which[0]] = at
        keys: dict[bytes, int] = {}
        alike = np.arange(len(firsts))
        for row in dict.fromkeys(which[position] for position in begins):
            if places[row] < 0:
                key = hashlib.blake2b(values[firsts[row]].tobytes(), digest_size=16).digest()
                places[row] = self._firsts.get(key, -1)
                alike[row] = keys.setdefault(key, row)
        which = alike[which]
        new = np.zeros(len(firsts), bool)
        new[which] = True
        new &= places < 0
        count = int(new.sum())
        places[new] = self.written + np.arange(count)
        self.written += count
        if len(self._firsts) < REMEMBERED:
            self._firsts |= {key: int(places[row]) for key, row in keys.items()}
        end = values[firsts[which[-1]]]
        same = at >= 0 and places[which[-1]] == at
        self._last[world] = (rows.source, content if same else end.tobytes(), int(places[which[-1]]))
        return places[which], values[firsts[new]] if count else None


def _ranks(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """[U] each row's number among those that differ from the one before, byte by byte; and the first of each number."""
    if len(values) == 1 or not values.size:
        return np.zeros(len(values), np.int64), np.zeros(1, np.int64)
    flat = np.ascontiguousarray(values).reshape(len(values), -1)
    width = flat.shape[1] * flat.itemsize
    raw = flat.view(np.uint64 if width % 8 == 0 else np.uint32 if width % 4 == 0 else np.uint8)
    new = np.concatenate([[True], (raw[1:] != raw[:-1]).any(1)])
    return np.cumsum(new) - 1, np.flatnonzero(new)
