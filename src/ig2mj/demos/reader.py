"""`Recording`: reads files of `RunWriter`, and refuses all others.

Files are untrusted: no array is read before its shape, type and place are checked, and at most some hundred rows are
read at a time. No pickle, no links out of the file.
"""

from __future__ import annotations

import functools
import json
import math
import os
import pathlib
from collections.abc import Mapping
from typing import Any

import numpy as np

from ig2mj.demos.writer import COLUMN_GROUPS, FLUSH, FORMAT, OBSERVED, READABLE_VERSIONS
from ig2mj.envs.names import refuse_path
from ig2mj.errors import InputError
from ig2mj.files.content import decode_json
from ig2mj.files.hdf5 import Hdf5File
from ig2mj.files.shell import command
from ig2mj.worlds.plugin_states import KEY

FIX = "`ig2mj demos collect`, `ig2mj rollout --record FILE` and `ig2mj.demos.record` write recordings"

DEMONSTRATIONS = "ig2mj demonstrations"
"""Format of the files of `ig2mj demos collect` in version 0.1.0, which `ig2mj demos convert` reads."""

ATTRIBUTES = ("mujoco", "scene", "scene_hash", "model_hash")
"""Attributes that every recording has."""

LARGEST_ROWS = 2**28
"""Largest number of bytes that are read at a time."""


class Run:
    """One run of one world.

    Attributes:
      name: "run_000000". attributes: of the run. world: of the batch. row: of the pool. frames: T + 1.
      names, obs_names, step_names: of its arrays, without "frames/", "obs/" and "steps/".
      complete: the episode terminated or was truncated; else it was cut off, by a reset or by the end of the recording.
      success: the goal held at its end (for a run that continues past success: at any time).
    """

    def __init__(self, recording: Recording, name: str, attributes: dict[str, Any]):
        """Reads the attributes and no array. Raises InputError."""
        self.file, self.name, self._recording = recording.file, name, recording
        self.attributes = attributes
        self.frames = self._whole_number("frames")
        self.world, self.row = self._whole_number("world"), self._whole_number("row", 0)
        self.names = [name[7:] for name in recording.columns if name.startswith("frames/")]
        self.obs_names = [name[len(OBSERVED) :] for name in recording.columns if name.startswith(OBSERVED)]
        self.step_names = [name[6:] for name in recording.columns if name.startswith("steps/")]
        self._parts = self._read_parts(self.attributes.pop("parts", None))

    @functools.cached_property
    def complete(self) -> bool:
        """See the class. Raises InputError."""
        ends = [name for name in ("terminated", "truncated") if name in self.step_names]
        return self.frames > 1 and any(bool(self.all_rows(f"steps/{name}").any()) for name in ends)

    @functools.cached_property
    def success(self) -> bool:
        """See the class. Raises InputError."""
        if self.frames < 2 or "success" not in self.step_names:
            return False
        last = self.rows("steps/success", self.frames - 2, self.frames - 1)
        return self.attributes.get("success") is True or bool(last.all())

    def frame_rows(self, names: list[str], start: int, stop: int, like: list[Any] | None = None) -> list[np.ndarray]:
        """Rows of arrays of the world, [stop - start, ...] each.

        Args:
          like: arrays of one world's frame; other shapes or types are refused.

        Raises:
          InputError: an array is missing, or is another than it must be.
        """
        index, requested = self.index(start, stop), like or [None] * len(names)
        return [self._rows(f"frames/{name}", index, like) for name, like in zip(names, requested, strict=True)]

    def whole_frames(
        self, names: list[str], start: int, stop: int, like: list[Any], defaults: Mapping[str, np.ndarray]
    ) -> list[np.ndarray]:
        """As `frame_rows`; arrays of `defaults`, [1, ...], stand for those that the file lacks. Raises InputError."""
        there = [k for k, name in enumerate(names) if name not in defaults]
        found = self.frame_rows([names[k] for k in there], start, stop, [like[k] for k in there])
        rows = dict(zip(there, found, strict=True))
        return [rows[k] if k in rows else np.repeat(defaults[n], stop - start, axis=0) for k, n in enumerate(names)]

    def rows(self, name: str, start: int, stop: int, like: Any = None) -> np.ndarray:
        """Some rows of one array, [stop - start, ...]; row t of "steps/..." led from frame t to t + 1.

        Raises:
          InputError: the array is missing, or another than `like`. ValueError: more rows than are read at a time.
        """
        later = int(name.startswith("steps/"))
        return self._rows(name, self.index(start + later, stop + later), like)

    def all_rows(self, name: str, like: Any = None) -> np.ndarray:
        """All rows of one array. Raises InputError: it is missing, or another than `like`."""
        count = self.frames - int(name.startswith("steps/"))
        parts = [self.rows(name, k, min(k + FLUSH, count), like) for k in range(0, max(count, 1), FLUSH)]
        return np.concatenate(parts)

    def broken(self, name: str, problem: str) -> InputError:
        """The error that names an array of this run."""
        return InputError(self.file, " ".join(problem.split()), element=f"{self.name}/{name}", fix=FIX)

    def _whole_number(self, name: str, default: int | None = None) -> int:
        value = self.attributes.get(name, default)
        if not isinstance(value, int) or isinstance(value, bool) or value < 0:
            raise self.broken(f"attribute {name}", f"is {value!r}, and must be a whole number")
        return value

    def _read_parts(self, parts: Any) -> np.ndarray:
        """[n, 2] stretches of the file's index."""
        if not isinstance(parts, np.ndarray) or parts.dtype.kind not in "iu" or parts.shape != (len(parts), 2):
            raise self.broken("attribute parts", "must be pairs of whole numbers")
        parts = parts.astype(np.int64)
        count = self._recording.index.shape[0]
        if (parts < 0).any() or (parts[:, 0] > count).any() or (parts[:, 1] > count - parts[:, 0]).any():
            raise self.broken("attribute parts", f"names frames that are not there; the file has {count}")
        if parts[:, 1].sum() != self.frames or self.frames > count:
            there = min(parts[:, 1].sum(), count)
            raise self.broken("attribute frames", f"claims {self.frames} frames, and {there} are there")
        return parts

    def kept(self, start: int, stop: int) -> np.ndarray:
        """[stop - start] which frames the file has: a compact one has first and last (`demos.compact`)."""
        of_world = [k for name, k in self._recording.columns.items() if name.startswith("frames/")]
        return np.all(self.index(start, stop)[:, of_world[:1]] >= 0, axis=1, keepdims=True)[:, 0]

    def index(self, start: int, stop: int) -> np.ndarray:
        """[stop - start, C] rows that these frames have in the file's arrays; -1: none. Raises InputError."""
        if stop - start > 4 * FLUSH:
            raise ValueError(f"{stop - start} rows at a time")
        found, before = [], 0
        for first, count in self._parts:
            low, high = max(start - before, 0), min(stop - before, count)
            if high > low:
                found.append(self._recording.read("index", int(first + low), int(first + high)))
            before += count
        return np.concatenate(found) if found else np.zeros((0, len(self._recording.columns)), np.int32)

    def _rows(self, name: str, index: np.ndarray, like: Any) -> np.ndarray:
        recording = self._recording
        column = recording.columns.get(name)
        if column is None:
            raise self.broken(name, "is missing")
        if name not in recording.arrays:
            raise self.broken(name, "is missing")
        array, places = recording.arrays[name], index[:, column].astype(np.int64)
        if like is not None and (array.shape[1:] != like.shape or array.dtype != like.dtype):
            raise self.broken(name, f"is {array.dtype}{list(array.shape[1:])}, must be {like.dtype}{list(like.shape)}")
        if name.startswith("frames/") and (places == -1).any():
            raise self.broken(name, "is not of every frame: the recording has first and last frames only")
        if len(places) and not 0 <= places.min() <= places.max() < len(array):
            raise self.broken(name, f"has {len(array)} rows, and the index names others")
        known, inverse = np.unique(places, return_inverse=True)
        gaps = np.flatnonzero(np.diff(known) > 1) + 1  # what lies together is read together
        parts = [recording.read(name, int(p[0]), int(p[-1]) + 1) for p in np.split(known, gaps) if len(p)]
        return np.concatenate(parts)[inverse] if parts else np.zeros((0, *array.shape[1:]), array.dtype)


class Recording:
    """An open file; a context manager.

    Attributes:
      header: its attributes. version: of the format. runs: in the order of their beginning.
    """

    def __init__(self, file: str | os.PathLike):
        """Opens it. Raises InputError: it is missing, broken, of another kind, or not what it claims to be."""
        self.file = path = pathlib.Path(file)
        self._opened = Hdf5File(path, fix=FIX)
        try:
            self._read()
        except InputError:
            self.close()
            raise
        except (OSError, RuntimeError, KeyError, ValueError, TypeError) as e:
            self.close()
            raise InputError(path, f"is broken: {' '.join(str(e).split())}", fix=FIX) from e

    def _read(self) -> None:
        self.header: dict[str, Any] = self._opened.attributes()
        if self.header.get("format") == DEMONSTRATIONS:
            fix = f"`{command('demos', 'convert', self.file, 'NEW')}` converts it"
            raise InputError(self.file, "is a demonstrations file of ig2mj 0.1.0", element="format", fix=fix)
        if self.header.get("format") != FORMAT:
            raise InputError(self.file, f"is not {FORMAT}", element="format", fix=FIX)
        version: Any = self.header.get("version")
        if version not in READABLE_VERSIONS:
            known = " and ".join(map(str, READABLE_VERSIONS))
            problem = f"is {version!r}, and versions {known} can be read"
            raise InputError(self.file, problem, element="attribute version", fix="record it again")
        self.version: int = version
        for name in ATTRIBUTES:
            if not isinstance(self.header.get(name), str):
                raise InputError(self.file, "is missing", element=f"attribute {name}", fix=FIX)
        refuse_path(str(self.header.get("task", "")), self.file, "attribute task")
        columns = self.value("columns", list)
        if not all(isinstance(name, str) and name.startswith(COLUMN_GROUPS) for name in columns):
            raise InputError(self.file, "must be names of arrays", element="attribute columns", fix=FIX)
        self.columns: dict[str, int] = {name: k for k, name in enumerate(columns)}
        if len(self.columns) < len(columns):
            raise InputError(self.file, "names an array twice", element="attribute columns", fix=FIX)
        self.index = self._array("index", "i", 2)
        if self.index.shape[1] != len(columns):
            raise InputError(self.file, f"must have {len(columns)} columns", element="index", fix=FIX)
        # A process that was killed at once has written no array yet, and runs of one frame have no step.
        frames, runs = self.index.shape[0], sum(name.startswith("run_") for name in self._opened.names())
        needed = [n for n in columns if self._opened.has(n) or frames > (runs if n.startswith("steps/") else 0)]
        there = {name: self._array(name) for name in needed}
        self.arrays: dict[str, Any] = {name: array for name, array in there.items() if array is not None}
        self.runs: list[Run] = []
        for name in self._opened.names():
            if name not in ("index", *(group[:-1] for group in COLUMN_GROUPS)):
                self.runs.append(Run(self, name, self._opened.attributes(name)))

    def _array(self, name: str, kinds: str = "biuf", ndim: int | None = None) -> Any:
        """An array of numbers that is in this very file. Raises InputError."""
        array = self._opened.array(name, kinds=kinds, ndim=ndim)
        row = array.dtype.itemsize * math.prod(array.shape[1:])
        if row * FLUSH > LARGEST_ROWS:
            raise InputError(self.file, f"has rows of {row} bytes", element=name, fix=FIX)
        return array

    def read(self, name: str, start: int, stop: int) -> np.ndarray:
        """Rows of an array of the file, or of its index. Raises InputError."""
        try:
            return np.asarray((self.index if name == "index" else self.arrays[name])[start:stop])
        except (OSError, ValueError, RuntimeError) as e:
            raise InputError(self.file, f"cannot be read: {' '.join(str(e).split())}", element=name, fix=FIX) from e

    def value(self, name: str, kind: type) -> Any:
        """An attribute of the file of this type; lists and tables are written as JSON. Raises InputError."""
        value = self.header.get(name)
        if kind in (list, dict):
            value = decode_json(str(value), self.file, fix=FIX)
        if not isinstance(value, kind) or isinstance(value, bool):
            raise InputError(self.file, f"is not of type {kind.__name__}", element=f"attribute {name}", fix=FIX)
        return value

    def missing_states(self, here: Mapping[str, Any]) -> list[str]:
        """States of plug-ins that the file has, and that an origin of here lacks: a text for each, with its source.

        Raises InputError.
        """
        kept = self.value(KEY, dict) if KEY in self.header else {}
        own = json.loads(str(here.get(KEY, "{}")))
        lacking = [(field, source) for field, source in kept.items() if field not in own]
        return [
            f"the state '{str(field)[:80]}' of {str(source)[:80]} is not registered here" for field, source in lacking
        ]

    def close(self) -> None:
        """May be called twice."""
        self._opened.close()

    def __enter__(self) -> Recording:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()
