"""`write_runs`: selects and joins runs of recordings, with or without the frames of the world between first and last.

A replay by action reproduces the omitted frames bit for bit, and a compact run takes a hundredth of the space. Steps
and observations are always kept.

Axes: N frames of all kept runs, C columns.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from ig2mj.demos.reader import Recording, Run
from ig2mj.demos.whole_output import whole_output
from ig2mj.demos.writer import FLUSH, FORMAT, PACKED, packing_of
from ig2mj.errors import InputError

SMALL = 1024
"""Bytes up to which an array is stored without chunks."""


def write_compact(recording: Recording, file: str | os.PathLike, runs: Sequence[Run], **attributes: Any) -> None:
    """Writes some runs of a recording without the frames between their first and last. See `write_runs`."""
    write_runs([(recording, runs)], file, **attributes)


def write_runs(
    sources: Sequence[tuple[Recording, Sequence[Run]]],
    file: str | os.PathLike,
    compact: bool = True,
    **attributes: Any,
) -> None:
    """Writes runs of recordings of one environment to a file, renumbered in their order.

    The file appears once it is complete.

    Args:
      sources: recordings with the same columns, and the runs of each.
      compact: omit the frames of the world between the first and the last of each run.
      attributes: further attributes of the file, next to those of the first recording.

    Raises:
      InputError: a recording is broken or has other columns than the first, or the file cannot be written.
    """
    import h5py

    first_recording = sources[0][0]
    names = list(first_recording.columns)
    for recording, _ in sources:
        if list(recording.columns) != names:
            raise InputError(recording.file, "has other columns than the first recording", element="attribute columns")
    indices = [_index(recording, runs, compact) for recording, runs in sources]
    with whole_output(file) as unfinished, h5py.File(unfinished, "w", libver=("v108", "v108")) as out:
        about = {"format": FORMAT, "version": first_recording.version, "columns": json.dumps(names)}
        for name, value in (first_recording.header | about | attributes).items():
            out.attrs[name] = value
        for column, name in enumerate(names):
            _write_column(out, name, column, [recording for recording, _ in sources], indices)
        index = np.concatenate(indices) if indices else np.zeros((0, len(names)), np.int64)
        shape = {"chunks": (FLUSH, max(len(names), 1)), "maxshape": (None, len(names))}
        out.create_dataset("index", data=index.astype(np.int32), **shape, **PACKED)
        first = 0
        for number, run in enumerate(run for _, runs in sources for run in runs):
            group = out.create_group(f"run_{number:06d}")
            for name, value in run.attributes.items():
                group.attrs[name] = value
            group.attrs["parts"] = np.array([[first, run.frames]])
            first += run.frames


def _index(recording: Recording, runs: Sequence[Run], compact: bool) -> np.ndarray:
    """[N, C] rows of the recording's arrays that are kept; -1: none."""
    of_world = [name.startswith("frames/") for name in recording.columns]
    parts = [np.zeros((0, len(of_world)), np.int32)]
    for run in runs:
        rows = np.concatenate([run.index(k, min(k + FLUSH, run.frames)) for k in range(0, run.frames, FLUSH)])
        if compact:
            rows[1:-1, of_world] = -1
        parts.append(rows)
    return np.concatenate(parts)


def _write_column(
    out: Any, name: str, column: int, recordings: Sequence[Recording], indices: Sequence[np.ndarray]
) -> None:
    """Writes the used rows of an array, one source after the other, and renumbers them in the indices."""
    used, offset = [], 0
    for index in indices:
        rows, renumbered = np.unique(index[:, column], return_inverse=True)
        none = int(len(rows) > 0 and rows[0] < 0)
        index[:, column] = np.where(index[:, column] < 0, -1, renumbered - none + offset)
        used.append(rows[none:])
        offset += len(rows) - none
    like = recordings[0].arrays.get(name)
    if like is None:
        return
    shape, row_bytes = (offset, *like.shape[1:]), int(np.prod(like.shape[1:])) * like.dtype.itemsize
    if offset * row_bytes <= SMALL:
        blocks = [b for r, rows in zip(recordings, used, strict=True) for b in _blocks(r, name, rows)]
        out.create_dataset(name, data=np.concatenate(blocks) if blocks else np.zeros(shape, like.dtype))
        return
    packing = packing_of(name, like.shape[1:], noise=False)
    packing = packing | {"compression_opts": 9} if packing is PACKED else packing
    chunk = (min(offset, max(2**20 // max(row_bytes, 1), 1), FLUSH), *like.shape[1:])
    array, at = out.create_dataset(name, shape, like.dtype, chunks=chunk, **packing), 0
    for recording, rows in zip(recordings, used, strict=True):
        for block in _blocks(recording, name, rows):
            array[at : at + len(block)] = block
            at += len(block)


def _blocks(recording: Recording, name: str, rows: np.ndarray) -> Iterator[np.ndarray]:
    """The rows of an array, at most `FLUSH` at a time; adjacent ones are read together."""
    for stretch in np.split(rows, np.flatnonzero(np.diff(rows) > 1) + 1):
        for k in range(0, len(stretch), FLUSH):
            part = stretch[k : k + FLUSH]
            yield recording.read(name, int(part[0]), int(part[-1]) + 1)
