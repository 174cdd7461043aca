"""Replays as jobs (`ig2mj.cluster.job_runner`): one run of each world at a time, as `Replayer` does it."""

from __future__ import annotations

import functools
import json
import pathlib
import tempfile
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import msgspec
import numpy as np

from ig2mj.cluster.jobs import Job, WholeRunError
from ig2mj.demos.reader import Recording, Run
from ig2mj.demos.replay import Replayer
from ig2mj.demos.whole_output import whole_output
from ig2mj.envs.environment import EnvState
from ig2mj.envs.registry import VECTORS
from ig2mj.envs.shared_starts import keep_pool
from ig2mj.errors import Ig2mjError
from ig2mj.files.content import decode_struct
from ig2mj.files.hdf5 import Hdf5File

TOLD = "told"
"""Attribute of a job's file: the result of the replay as JSON."""

FORMAT = "ig2mj observations"
"""Of files of observations."""

RECORDING = "recording"
"""Name of the recording in `JobSet.shared`, where jobs run on other machines."""


class _Told(msgspec.Struct):
    """What a job's `TOLD` holds."""

    runs: int
    frames: int
    differences: list[str]
    warnings: list[str]


def replay_jobs(recording: Recording, settings: Mapping[str, Any]) -> list[Job]:
    """Jobs of a replay. `settings`: the arguments of `replay_job` but `runs` and `shared`."""
    layers: list[list[str]] = []
    depth: dict[int, int] = {}
    for run in recording.runs:
        if run.frames:
            at = depth.get(run.world, 0)
            depth[run.world] = at + 1
            if at == len(layers):
                layers.append([])
            layers[at].append(run.name)
    return [Job(f"runs_{n:06d}", {**settings, "runs": names}) for n, names in enumerate(layers)]


def replay_job(
    file: str,
    by: str,
    check: bool,
    sensors: list[str],
    threads: int,
    starts: dict[str, Any],
    runs: list[str],
    shared: Mapping[str, bytes] | None = None,
) -> bytes:
    """Replays some runs; the bytes of an HDF5 file with the result and the requested observations.

    Args:
      sensors: names of observations. starts: arguments of `shared_pool`. The others: of `Replayer`.
    """
    import h5py

    try:
        keep_pool(shared or {}, **starts)
        replayer = _replayer(file, by, tuple(sensors), threads, (shared or {}).get(RECORDING))
    except Ig2mjError as e:
        raise WholeRunError(e) from e
    requested = [run for run in replayer.recording.runs if run.name in set(runs)]
    with tempfile.TemporaryDirectory(prefix="ig2mj-") as folder:
        out = pathlib.Path(folder) / "part.h5"
        with h5py.File(out, "w") as opened:
            watcher = Observing(opened, sensors)
            done = replayer(check, watcher.see if sensors else None, requested)
            told = {"runs": done.runs, "frames": done.frames, "differences": [str(d) for d in done.differences]}
            opened.attrs[TOLD] = json.dumps({**told, "warnings": replayer.warnings})
        return out.read_bytes()


class Observing:
    """Observations of all runs: `/run_000000/<name>` [T + 1, ...], written frame by frame."""

    def __init__(self, opened: Any, names: Sequence[str]):
        """`opened`: an HDF5 file."""
        self._opened, self._names, self._file, self._order = opened, names, None, []

    @classmethod
    def into(cls, file: pathlib.Path, names: Sequence[str], recording: Recording) -> Observing:
        """Writes to a new file with the same bytes as one of `join_replays`."""
        import h5py

        found = cls(h5py.File(_beside(file, "frames"), "w"), names)
        found._file, found._order = file, [job.arguments["runs"] for job in replay_jobs(recording, {})]
        return found

    def see(self, state: EnvState, runs: Mapping[int, Run], frame: int) -> None:
        """Writes a frame of each current run."""
        for world, run in runs.items():
            for name in self._names:
                row, path = np.asarray(state.obs[name])[world], f"{run.name}/{name}"
                if path not in self._opened:
                    self._opened.create_dataset(
                        path, (run.frames, *row.shape), row.dtype, chunks=(1, *row.shape), compression="gzip"
                    )
                self._opened[path][frame] = row

    def discard(self) -> None:
        """Closes the file of an interrupted replay, and removes it unless the caller opened it."""
        self._opened.close()
        if self._file is not None:
            _beside(self._file, "frames").unlink(missing_ok=True)
            self._file = None

    def close(self) -> None:
        """Closes the file. Its own file is copied run by run, so that its bytes do not depend on the order."""
        import h5py

        self._opened.close()
        if self._file is None:
            return
        frames = _beside(self._file, "frames")
        with whole_output(self._file) as beside, h5py.File(beside, "w") as whole, h5py.File(frames, "r") as opened:
            whole.attrs["format"] = FORMAT
            for names in self._order:
                _copy(opened, whole, set(names) & set(opened))
        frames.unlink()


def join_replays(parts: Iterable[bytes], out: pathlib.Path | None) -> dict[str, Any]:
    """Joins the results of all jobs; with `out`, their observations in one file.

    Raises:
      OSError. InputError: a part is broken, or refers to another file.
    """
    import h5py

    found: dict[str, Any] = {"runs": 0, "frames": 0, "differences": [], "warnings": []}
    beside = None if out is None else _beside(out, "part")
    whole = None if beside is None else h5py.File(beside, "w")
    if whole is not None:
        whole.attrs["format"] = FORMAT
    with tempfile.TemporaryDirectory(prefix="ig2mj-") as folder:
        for packed in parts:
            part = pathlib.Path(folder) / "part.h5"
            part.write_bytes(packed)
            with Hdf5File(part) as opened:
                text = str(opened.attributes().get(TOLD, ""))
                told = decode_struct(text.encode(), _Told, part)
                found["runs"] += told.runs
                found["frames"] += told.frames
                found["differences"] += told.differences
                found["warnings"] = told.warnings
                for name in opened.names() if whole is not None else ():
                    opened.copy(name, whole)
    if whole is not None and beside is not None and out is not None:
        whole.close()
        beside.replace(out)
    return found


def _beside(file: pathlib.Path, what: str) -> pathlib.Path:
    return file.with_name(f".{file.name}.{what}")


def _copy(opened: Any, whole: Any, names: set[str]) -> None:
    """Runs of one HDF5 file into another."""
    for name in sorted(names):
        opened.copy(opened[name], whole, name)


@functools.lru_cache(maxsize=1)
def _replayer(file: str, by: str, sensors: tuple[str, ...], threads: int, content: bytes | None) -> Replayer:
    options: dict[str, Any] = {"threads": threads} if threads else {}
    if content is not None:
        folder = tempfile.TemporaryDirectory(prefix="ig2mj-")
        path = pathlib.Path(folder.name) / pathlib.Path(file).name
        path.write_bytes(content)
        replayer = Replayer(Recording(path), by, observations=sensors or VECTORS, **options)
        _folders.append(folder)  # as long as the process
        return replayer
    return Replayer(Recording(file), by, observations=sensors or VECTORS, **options)


_folders: list[tempfile.TemporaryDirectory] = []
