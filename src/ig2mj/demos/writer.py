"""`RunWriter`: writes runs of worlds to HDF5 while they are played.

    /                    attributes: format, version, columns, and the origin of the file (`ig2mj.demos.origin`)
    /run_000000          one run of one world; attributes: world, seed, episode, row, frames, ended, complete, success,
                         terminated, truncated, parts
    /frames/<name>       [U, ...] rows of an array of the world (`ig2mj.demos.frames.Frame`)
    /obs/<name>          [U, ...] rows of an observation, where observations are recorded
    /steps/<name>        [U, ...] rows of the step that led to a frame: action, label, reward and its terms, ends
    /index               [N, C] for each frame of the file, its row in each of the C columns; -1: none

`parts` of a run are pairs (first, count) of rows of the index. A row is stored once for as long as it stays the same,
and once where runs start alike. At most `FLUSH` frames of each world are buffered; a killed process loses those.
"""

from __future__ import annotations

import dataclasses
import errno
import json
import os
import pathlib
from collections.abc import Collection, Mapping, Sequence
from typing import Any

import numpy as np

from ig2mj.demos.columns import Column, Rows, gathered, held
from ig2mj.engine.native.recorded import Cut
from ig2mj.errors import InputError

FORMAT, FORMAT_VERSION = "ig2mj recording", 3
"""Raise the version when frames, or the effect of a step on them, change: recordings are bound to it and not to the
package's version. Version 2 has hashes of every byte (`ig2mj.demos.origin`), and neither sensors nor period."""

READABLE_VERSIONS = (2, 3)

OBSERVED = "obs/"
"""Group of the observations."""

COLUMN_GROUPS = ("frames/", OBSERVED, "steps/")
"""Groups of the arrays of a file."""

OBSERVATION_PACKING: dict[str, Any] = {"compression": "gzip", "compression_opts": 1}
"""Of images."""

FLUSH = 200
"""Largest number of buffered frames of a world (iGibson's value)."""

FLUSH_BYTES = 2**28
"""Largest number of buffered bytes."""

CHUNK_BYTES = 2**17
"""Bytes of a chunk of an array, of at least one row."""

INDEX = 8192
"""Bytes below which a single row is stored without chunks, whose index would take more."""

MOSTLY = 0.5
"""Share of numbers that change from row to row above which an array is not packed: their last digits are noise."""

PACKED: dict[str, Any] = {"compression": "gzip", "compression_opts": 1, "shuffle": True}


@dataclasses.dataclass(eq=False)
class _Frame:
    """A buffered frame of all worlds. `worlds`: those whose runs it belongs to."""

    own: Sequence[Sequence[Any]]
    batched: list[Any]
    step: list[Any] | None
    worlds: Collection[int]


@dataclasses.dataclass(eq=False)
class _Run:
    group: Any
    attributes: dict[str, Any]
    parts: list[tuple[int, int]]
    starts: int  # buffered frame that starts it; -1: it started earlier
    stops: int = -1  # frame after its last one


class RunWriter:
    """Writes runs to a file; a context manager. `runs`: number of runs so far."""

    def __init__(
        self,
        file: str | os.PathLike,
        attributes: Mapping[str, Any],
        own: Mapping[str, Cut],
        batched: Sequence[str],
        steps: Sequence[str],
        worlds: Sequence[int] = (0,),
        observed: Sequence[str] = (),
    ):
        """Makes the file.

        Args:
          own: arrays that each world hands in separately, by name, and their places in its blocks. batched: names of
            those with a world axis. steps: names of a step's arrays, with a world axis. worlds: indices of the
            recorded worlds on that axis. observed: names of observations, which follow the batched arrays of a frame.

        Raises:
          InputError: it cannot be written there.
        """
        self.file = pathlib.Path(file)
        self._opened = _created(self.file)
        self._worlds, self._cuts, self._num_batched = list(worlds), list(own.values()), len(batched) + len(observed)
        names = [f"frames/{name}" for name in (*own, *batched)] + [f"{OBSERVED}{name}" for name in observed]
        names += [f"steps/{name}" for name in steps]
        own_attributes = {"format": FORMAT, "version": FORMAT_VERSION, "columns": json.dumps(names)}
        for name, value in (own_attributes | dict(attributes)).items():
            self._opened.attrs[name] = value
        index = {"chunks": (FLUSH, max(len(names), 1)), "maxshape": (None, len(names))}
        self._index = self._opened.create_dataset("index", (0, len(names)), np.int32, **index, **PACKED)
        self._names, self._columns, self._arrays = names, [Column() for _ in names], [None] * len(names)
        self._pending: list[_Frame] = []
        self._open: dict[int, list[_Run]] = {world: [] for world in worlds}  # the last one may go on
        self._written = self._bytes = self.runs = 0
        self._opened.flush()

    def begin(self, worlds: Mapping[int, Mapping[str, Any]], own: Sequence[Sequence[Any]], batched: Sequence) -> None:
        """Starts runs of some worlds at this frame, and ends their current runs.

        Args:
          worlds: attributes of the run of each. own: blocks of each recorded world, in their order. batched: [W, ...].
            The arrays must not be changed afterwards.
        """
        for world, attributes in worlds.items():
            self.end(world)
            group = self._opened.create_group(f"run_{self.runs:06d}")
            about = {"world": world, "frames": 0, "ended": False, "complete": False, **attributes}
            self._open[world].append(_Run(group, about, [], len(self._pending)))
            self.runs += 1
        self._put(_Frame(own, held(batched), None, set(worlds)))

    def add(self, own: Sequence[Sequence[Any]], batched: Sequence[Any], step: Sequence[Any]) -> None:
        """Adds a frame to all current runs, and the step [W, ...] that led to it."""
        going = {world for world, runs in self._open.items() if runs and runs[-1].stops < 0}
        if going:
            self._put(_Frame(own, held(batched), held(step), going))

    def end(self, world: int, **attributes: Any) -> None:
        """Ends the current run of a world, if there is one."""
        runs = self._open[world]
        if runs and runs[-1].stops < 0:
            runs[-1].stops = len(self._pending)
            runs[-1].attributes |= {**attributes, "ended": True}

    def close(self) -> None:
        """Ends all runs and closes the file; may be called twice."""
        if not self._opened:
            return
        for world in self._worlds:
            self.end(world)
        self.flush()
        self._opened.close()

    def __enter__(self) -> RunWriter:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def _put(self, frame: _Frame) -> None:
        if not self._pending:
            sizes = (a.nbytes if hasattr(a, "nbytes") else len(a) for part in (*frame.own, frame.batched) for a in part)
            self._bytes = sum(sizes)
        self._pending.append(frame)
        count = len(self._pending)
        if count >= FLUSH or count * self._bytes >= FLUSH_BYTES:
            self.flush()

    def flush(self) -> None:
        """Writes the buffered frames."""
        frames, self._pending = self._pending, []
        if frames:
            self._write(frames)
        for world, runs in self._open.items():
            for run in runs:
                for name, value in run.attributes.items():
                    run.group.attrs[name] = value
                run.group.attrs["frames"] = sum(count for _, count in run.parts)
                run.group.attrs["parts"] = np.array(run.parts, np.int64).reshape(-1, 2)
                run.attributes, run.starts = {}, -1
            self._open[world] = [run for run in runs if run.stops < 0]
        self._opened.flush()

    def _write(self, frames: list[_Frame]) -> None:
        num_own, num_batched = len(self._cuts), self._num_batched
        taken = {w: np.array([k for k, f in enumerate(frames) if w in f.worlds], int) for w in self._worlds}
        index = np.full((sum(map(len, taken.values())), len(self._names)), -1, np.int32)
        offsets = dict(zip(taken, np.cumsum([0, *map(len, taken.values())]), strict=False))
        begins = {w: np.searchsorted(taken[w], [r.starts for r in self._open[w] if r.starts >= 0]) for w in taken}
        everywhere = [gathered(a) for a in zip(*(f.batched for f in frames), strict=True)]
        with_step = np.array([k for k, f in enumerate(frames) if f.step is not None], int)
        steps = [gathered(a) for a in zip(*(f.step for f in frames if f.step is not None), strict=True)]
        for number, world in enumerate(self._worlds):
            if not len(taken[world]):
                continue
            at = slice(offsets[world], offsets[world] + len(taken[world]))
            own = [frames[k].own[number] for k in taken[world]] if self._cuts else []
            blocks = [gathered(p) for p in zip(*own, strict=True)]
            for c, cut in enumerate(self._cuts):
                rows = blocks[cut.piece]
                rows = Rows(cut(rows.values), rows.which, rows.source)
                index[at, c] = self._place(c, world, rows, np.arange(len(taken[world])), begins[world], None)
            for c, rows in enumerate(everywhere):
                place = self._place(num_own + c, world, rows, taken[world], begins[world], world)
                index[at, num_own + c] = place
            stepped = np.isin(taken[world], with_step)
            of_step = np.searchsorted(with_step, taken[world][stepped])
            for c, rows in enumerate(steps if len(of_step) else ()):
                place = self._place(num_own + num_batched + c, world, rows, of_step, (), world)
                index[at.start + np.flatnonzero(stepped), num_own + num_batched + c] = place
            self._note_parts(world, taken[world], int(offsets[world]))
        _extend(self._index, self._written, index)
        self._written += len(index)

    def _note_parts(self, world: int, taken: np.ndarray, offset: int) -> None:
        """Adds the index rows that are about to be written to the `parts` of their runs."""
        for run in self._open[world]:
            first = np.searchsorted(taken, max(run.starts, 0))
            stop = np.searchsorted(taken, run.stops) if run.stops >= 0 else len(taken)
            if stop > first:
                run.parts.append((self._written + offset + int(first), int(stop - first)))

    def _place(self, c: int, world: int, rows: Rows, frames: np.ndarray, begins: Any, axis: int | None) -> Any:
        column = self._columns[c]
        before = column.written
        places, new = column.place(world, rows, frames, begins, axis)
        if new is not None and (new[0].size or not before):
            self._arrays[c] = _with_rows(self._opened, self._names[c], self._arrays[c], before, new)
        return places


def _with_rows(file: Any, name: str, array: Any, before: int, rows: np.ndarray) -> Any:
    """Appends rows to an array of the file, which is created, or converted to chunks, where necessary.

    A single row is stored without chunks. Rows without numbers count as one row.
    """
    if array is None and len(rows) == 1 and rows.nbytes < INDEX:
        return file.create_dataset(name, data=rows)
    if array is None or array.chunks is None:
        if array is not None:
            rows, before = np.concatenate([array[:], rows]), 0
            del file[name]
        row = rows.shape[1:]
        noise = rows.dtype.kind == "f" and len(rows) > 1 and bool((rows[1:] != rows[:-1]).mean() > MOSTLY)
        packing = packing_of(name, row, noise)
        count = min(max(CHUNK_BYTES // rows[0].nbytes, 1), FLUSH)
        shapes = {"shape": (0, *row), "maxshape": (None, *row), "chunks": (count, *row)}
        array = file.create_dataset(name, dtype=rows.dtype, **shapes, **packing)
    _extend(array, before, rows)
    return array


def packing_of(name: str, row: tuple[int, ...], noise: bool) -> dict[str, Any]:
    """Options of an array in the file. `row`: shape of a row. `noise`: most numbers change from row to row."""
    if name.startswith(OBSERVED) and len(row) > 1:
        return OBSERVATION_PACKING
    return {} if noise else PACKED


def _extend(array: Any, before: int, rows: np.ndarray) -> None:
    import h5py

    array.id.set_extent((before + len(rows), *rows.shape[1:]))
    place, memory = array.id.get_space(), h5py.h5s.create_simple(rows.shape)
    place.select_hyperslab((before, *(0 for _ in rows.shape[1:])), rows.shape)
    array.id.write(memory, place, np.ascontiguousarray(rows))


def _created(file: pathlib.Path) -> Any:
    """Creates a file in the newest form that stays readable if its writer is killed; later forms are marked as open."""
    import h5py

    try:
        return h5py.File(file, "w", libver=("v108", "v108"))
    except OSError as e:
        raise InputError(file, f"cannot be written: {_why(e)}", fix="choose another place") from e


def _why(error: OSError) -> str:
    """What the system says, without HDF5's text around it."""
    if "already open" in str(error) or (error.errno in (errno.EAGAIN, errno.EACCES) and "lock" in str(error)):
        return "it is open already, here or in another program"
    return os.strerror(error.errno) if error.errno else " ".join(str(error).split())
