"""`RunWriter`: runs of worlds to HDF5, as they go on.

    /                    attributes: format, version, and what the file is of (`ig2mj.demos.origin`)
    /run_000000          one run of one world; attributes: world, seed, episode, row, frames, ended, success
        /frames/...      [T + 1, ...] the world at its start and after each step (`ig2mj.demos.frames.Frame`)
        /steps/...       [T, ...] the step that led to frame t + 1: action, reward and its terms, ends

An array that is the same in all frames of a run has one row. What is not written yet is at most `FLUSH` frames of each
world: that much a killed process loses.

Axis: T steps of a run.
"""

from __future__ import annotations

import dataclasses
import hashlib
import os
import pathlib
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ig2mj.errors import InputError

FORMAT, FORMAT_VERSION = "ig2mj recording", 1

FLUSH = 200
"""Frames of a run that are kept in memory at most (iGibson's figure)."""

INDEX = 8192
"""Bytes below which an array is not worth the index of a packed one."""

MOSTLY = 0.5

PACKED = {"compression": "gzip", "compression_opts": 1, "shuffle": True}


class RunWriter:
    """Writes runs to a file; a context manager. `runs`: how many were begun."""

    def __init__(
        self,
        file: str | os.PathLike,
        attributes: Mapping[str, Any],
        frame_names: Sequence[str],
        step_names: Sequence[str],
    ):
        """Makes the file. `frame_names`, `step_names`: of the arrays that `begin` and `add` take, in their order.

        Raises:
          InputError: it cannot be written there.
        """
        self.file = pathlib.Path(file)
        self._opened = _created(self.file)
        self._opened.attrs["format"], self._opened.attrs["version"] = FORMAT, FORMAT_VERSION
        for name, value in attributes.items():
            self._opened.attrs[name] = value
        self._names = {"frames": list(frame_names), "steps": list(step_names)}
        self._open: dict[int, _Run] = {}
        self._single: dict[tuple[str, bytes], str] = {}  # arrays of one row that are in the file, and where
        self.runs = 0
        self._opened.flush()

    def begin(self, world: int, frame: list[np.ndarray], attributes: Mapping[str, Any]) -> None:
        """A new run of a world, from this frame; a run of it that goes on ends."""
        self.end(world)
        group = self._opened.create_group(f"run_{self.runs:06d}")
        for name, value in {"world": world, "frames": 0, "ended": False, **attributes}.items():
            group.attrs[name] = value
        self._open[world] = _Run(group, {part: [_Column() for _ in names] for part, names in self._names.items()})
        self._put(self._open[world], "frames", frame)
        self.runs += 1

    def add(self, world: int, frame: list[np.ndarray], step: list[np.ndarray]) -> None:
        """The next frame of a world's run, and the step that led to it; nothing where no run of it is open."""
        run = self._open.get(world)
        if run is None:
            return
        if len(run.columns["steps"][0].rows) >= FLUSH:
            self._write(run, closed=False)
            self._opened.flush()
        self._put(run, "frames", frame)
        self._put(run, "steps", step)

    def end(self, world: int, **attributes: Any) -> None:
        """Ends the run of a world, if there is one."""
        run = self._open.pop(world, None)
        if run is None:
            return
        self._write(run, closed=True)
        for name, value in {**attributes, "ended": True}.items():
            run.group.attrs[name] = value
        self._opened.flush()

    def close(self) -> None:
        """Ends all runs and closes the file; may be called twice."""
        for world in list(self._open):
            self.end(world)
        if self._opened:
            self._opened.close()

    def __enter__(self) -> RunWriter:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def _put(self, run: _Run, part: str, values: list[np.ndarray]) -> None:
        for column, value in zip(run.columns[part], values, strict=True):
            column.add(value)

    def _write(self, run: _Run, closed: bool) -> None:
        for part, columns in run.columns.items():
            for name, column in zip(self._names[part], columns, strict=True):
                if column.rows:
                    self._append(run.group, f"{part}/{name}", column, closed)
        run.group.attrs["frames"] = run.columns["frames"][0].written

    def _append(self, group: Any, name: str, column: _Column, closed: bool) -> None:
        """Writes a column's rows. `closed`: no more will come."""
        rows, first, before = column.rows, column.rows[0], column.written
        column.rows = []
        same = all(row is first for row in rows)
        column.written += len(rows)
        if same and before == 0:
            column.only = first
            self._write_single(group, name, first)
            return
        if column.only is not None:
            only = column.only
            if same and (first is only or first.tobytes() == only.tobytes()):
                return
            del group[name]
            path = f"{group.name}/{name}"
            self._single = {key: at for key, at in self._single.items() if at != path}
            made = _growing(group, name, np.stack(rows), before + len(rows), closed=False)
            for start in range(0, before, FLUSH):
                stop = min(start + FLUSH, before)
                made[start:stop] = np.broadcast_to(only, (stop - start, *only.shape))
            column.only = None
        elif before == 0:
            made = _growing(group, name, np.stack(rows), len(rows), closed)
        else:
            made = group[name]
            made.resize(before + len(rows), axis=0)
        made[before:] = np.stack(rows)

    def _write_single(self, group: Any, name: str, row: np.ndarray) -> None:
        """An array of one row; where an earlier run has the same one, a second link to it."""
        digest = hashlib.blake2b(row.tobytes() + f"{row.dtype}{row.shape}".encode(), digest_size=16).digest()
        known = self._single.get((name, digest))
        if known is not None:
            group[name] = self._opened[known]
            return
        packed = PACKED | {"chunks": (1, *row.shape)} if row.nbytes > 1024 else {}
        group.create_dataset(name, data=row[None], **packed)
        self._single[name, digest] = f"{group.name}/{name}"


@dataclasses.dataclass(eq=False)
class _Column:
    """One array of a run: rows that are not written yet, and how many are.

    Attributes:
      last, content: the last row, and its bytes. only: of all rows so far, where they are the same.
    """

    rows: list[np.ndarray] = dataclasses.field(default_factory=list)
    last: np.ndarray | None = None
    content: bytes = b""
    written: int = 0
    only: np.ndarray | None = None
    _given: np.ndarray | None = None

    def add(self, value: np.ndarray) -> None:
        """Adds a row: the last one again where it has the same bytes."""
        if self.last is None or value is not self._given:
            content = value.tobytes()
            if self.last is None or content != self.content:
                self.last, self.content = np.frombuffer(content, value.dtype).reshape(value.shape), content
            self._given = value
        self.rows.append(self.last)


@dataclasses.dataclass(eq=False)
class _Run:
    group: Any
    columns: dict[str, list[_Column]]


def _growing(group: Any, name: str, rows: np.ndarray, count: int, closed: bool) -> Any:
    """A new array of `count` rows like these. Numbers most of which change in every frame are not packed: their last
    digits are noise. `closed`: it never grows."""
    row = rows.shape[1:]
    noise = rows.dtype.kind == "f" and len(rows) > 1 and (rows[1:] != rows[:-1]).mean() > MOSTLY
    if closed and (noise or rows.nbytes < INDEX):
        return group.create_dataset(name, (count, *row), rows.dtype)
    shapes = {"shape": (count, *row), "maxshape": (None, *row), "chunks": (FLUSH, *row)}
    if closed:
        shapes = {"shape": (count, *row), "chunks": (count, *row)}
    return group.create_dataset(name, dtype=rows.dtype, **shapes, **({} if noise else PACKED))


def _created(file: pathlib.Path) -> Any:
    """A new file, of the newest form that can be read after its writer was killed; later ones are marked as open."""
    import h5py

    try:
        return h5py.File(file, "w", libver=("v108", "v108"))
    except OSError as e:
        raise InputError(file, f"cannot be written: {' '.join(str(e).split())}", fix="choose another place") from e
