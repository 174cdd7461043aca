"""`Recording`: reading files that `RunWriter` wrote, and refusing all others.

Nothing is believed: no array is read before its shape, type and place are what they must be, and no more is read at a
time than a chunk. No pickle, no links out of the file.
"""

from __future__ import annotations

import json
import os
import pathlib
from typing import Any

import numpy as np

from ig2mj.demos.writer import FLUSH, FORMAT, FORMAT_VERSION
from ig2mj.errors import InputError

FIX = "`ig2mj rollout --record FILE` and `ig2mj.demos.record` write such files"

ATTRIBUTES = ("mujoco", "ig2mj", "scene", "scene_hash", "model_hash")
"""What every recording says of itself."""


class Run:
    """One run of one world.

    Attributes:
      name: "run_000000". attributes: of the run. world: of the batch. row: of the pool. frames: T + 1.
      names, step_names: of its arrays, without "frames/" and "steps/".
    """

    def __init__(self, file: pathlib.Path, group: Any):
        """Looks at every array, and reads none. Raises InputError."""
        self.file, self.name, self._group = file, str(group.name).strip("/"), group
        self.attributes: dict[str, Any] = {name: _plain(value) for name, value in group.attrs.items()}
        self.frames = self._whole_number("frames")
        self.world, self.row = self._whole_number("world"), self._whole_number("row", 0)
        self.names, self.step_names = self._arrays("frames", self.frames), self._arrays("steps", self.frames - 1)

    def frame_rows(self, names: list[str], start: int, stop: int, like: list[Any] | None = None) -> list[np.ndarray]:
        """Rows of arrays of "frames/", [stop - start, ...] each, or [1, ...] where all are the same.

        Args:
          like: arrays of one world's frame; other shapes or types are refused.

        Raises:
          InputError: an array is missing, or is another than it must be.
        """
        return [
            self.rows(f"frames/{name}", start, stop, None if like is None else like[k]) for k, name in enumerate(names)
        ]

    def rows(self, name: str, start: int, stop: int, like: Any = None) -> np.ndarray:
        """Some rows of one array; [1, ...] where it has only one for the whole run. Raises InputError."""
        array = self._array(name)
        if like is not None and (array.shape[1:] != like.shape or array.dtype != like.dtype):
            raise self.broken(name, f"is {array.dtype}{list(array.shape[1:])}, must be {like.dtype}{list(like.shape)}")
        if stop - start > 4 * FLUSH:
            raise ValueError(f"{stop - start} rows at a time")
        constant = len(array) == 1
        try:
            return np.asarray(array[:1] if constant else array[start:stop])
        except (OSError, ValueError, RuntimeError) as e:
            raise self.broken(name, f"cannot be read: {e}") from e

    def broken(self, name: str, problem: str) -> InputError:
        """The error that names an array of this run."""
        return InputError(self.file, " ".join(problem.split()), element=f"{self.name}/{name}", fix=FIX)

    def _whole_number(self, name: str, default: int | None = None) -> int:
        value = self.attributes.get(name, default)
        if not isinstance(value, int) or isinstance(value, bool) or value < 0:
            raise self.broken(f"attribute {name}", f"is {value!r}, and must be a whole number")
        return value

    def _arrays(self, part: str, count: int) -> list[str]:
        """Names of the arrays of a part, in the order in which they were written; each has `count` rows, or 1."""
        if self.frames == 0 or (part == "steps" and count == 0):
            return []
        import h5py

        folder = _hard(self._group, part)
        if not isinstance(folder, h5py.Group):
            raise self.broken(part, "is missing")
        names: list[str] = []
        _walk(folder, "", names, self)
        for name in names:
            rows = len(self._array(f"{part}/{name}"))
            if rows not in (1, count):
                raise self.broken(f"{part}/{name}", f"has {rows} rows, and the run {count}")
        return names

    def _array(self, name: str) -> Any:
        import h5py

        array: Any = self._group
        for part in name.split("/"):
            array = _hard(array, part) if isinstance(array, h5py.Group) else None
        if not isinstance(array, h5py.Dataset) or array.ndim < 1:
            raise self.broken(name, "is missing")
        if array.is_virtual or array.external or array.dtype.kind not in "biuf":
            raise self.broken(name, f"is no array of numbers in this file ({array.dtype})")
        if array.shape[0] and array.size and not _there(array):
            raise self.broken(name, f"claims {array.shape[0]} rows that are not there")
        return array


class Recording:
    """An open file; a context manager. Attributes: header: its attributes. runs: in the order of their beginning."""

    def __init__(self, file: str | os.PathLike):
        """Opens it. Raises InputError: it is missing, broken, of another kind, or not what it claims to be."""
        import h5py

        self.file = path = pathlib.Path(file)
        if not path.is_file():
            raise InputError(path, "there is no such file", fix=FIX)
        try:
            self._opened = h5py.File(path, "r")
        except OSError as e:
            raise InputError(path, "is no HDF5 file, or a broken one", fix=FIX) from e
        try:
            self._read()
        except InputError:
            self.close()
            raise
        except (OSError, RuntimeError, KeyError, ValueError, TypeError) as e:
            self.close()
            raise InputError(path, f"is broken: {' '.join(str(e).split())}", fix=FIX) from e

    def _read(self) -> None:
        import h5py

        self.header: dict[str, Any] = {name: _plain(value) for name, value in self._opened.attrs.items()}
        if self.header.get("format") != FORMAT or self.header.get("version") != FORMAT_VERSION:
            raise InputError(self.file, f"is no {FORMAT}, version {FORMAT_VERSION}", element="format", fix=FIX)
        for name in ATTRIBUTES:
            if not isinstance(self.header.get(name), str):
                raise InputError(self.file, "is missing", element=f"attribute {name}", fix=FIX)
        self.runs: list[Run] = []
        for name in sorted(self._opened):
            group = _hard(self._opened, name)
            if not isinstance(group, h5py.Group):
                raise InputError(self.file, "is no run", element=name, fix=FIX)
            self.runs.append(Run(self.file, group))

    def value(self, name: str, kind: type) -> Any:
        """An attribute of the file of this type; lists and tables are written as JSON. Raises InputError."""
        value = self.header.get(name)
        if kind in (list, dict):
            try:
                value = json.loads(str(value))
            except ValueError:
                value = None
        if not isinstance(value, kind) or isinstance(value, bool):
            raise InputError(self.file, f"is no {kind.__name__}", element=f"attribute {name}", fix=FIX)
        return value

    def close(self) -> None:
        """May be called twice."""
        if self._opened:
            self._opened.close()

    def __enter__(self) -> Recording:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()


def _hard(group: Any, name: str) -> Any:
    """What a group has under a name in this very file, or None."""
    import h5py

    link = group.get(name, getlink=True)
    return group[name] if isinstance(link, h5py.HardLink) else None


def _walk(group: Any, before: str, names: list[str], run: Run, depth: int = 0) -> None:
    """Names of all arrays below a group."""
    import h5py

    if depth > 8:
        raise run.broken(before, "is nested too deeply")
    for name in group:
        inner = _hard(group, name)
        if isinstance(inner, h5py.Group):
            _walk(inner, f"{before}{name}/", names, run, depth + 1)
        else:
            names.append(before + name)


def _there(array: Any) -> bool:
    """Whether all rows of an array are in the file, and none is of more than a reasonable size."""
    if array.chunks is None:
        return array.id.get_storage_size() == array.nbytes
    if array.chunks[0] > 4 * FLUSH or array.chunks[1:] != array.shape[1:]:
        return False
    return array.id.get_num_chunks() * array.chunks[0] >= array.shape[0]


def _plain(value: Any) -> Any:
    return value.item() if isinstance(value, np.generic) else value
