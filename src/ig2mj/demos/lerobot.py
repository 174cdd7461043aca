"""Exporting recordings to LeRobot's dataset format, version 3.0, with observations computed by a replay.

    meta/info.json, stats.json, ig2mj.json, tasks.parquet, episodes/chunk-000/file-000.parquet
    data/chunk-000/file-000.parquet                      one row a step
    videos/<camera>/chunk-000/file-000.mp4               images of many episodes, one after the other

An episode is a run; its row t has the observations before step t, the action, and reward and ends after it. Colours are
videos (`observation.images.rgb`), depths columns of whole millimetres, all other observations columns of floats.
`meta/ig2mj.json` says how `ig2mj.make` makes an environment with these observations.
Source of the layout: LeRobot's documentation of datasets v3.0 and the files of LeRobot 0.4.4.

Axes: T steps of a run, N steps of all runs.
"""

from __future__ import annotations

import dataclasses
import json
import os
import pathlib
from typing import Any

import numpy as np

from ig2mj.demos.observing import made_again, observe
from ig2mj.demos.reader import Run
from ig2mj.demos.replay import Replayed, Replayer
from ig2mj.demos.selection import some_runs
from ig2mj.demos.whole_output import whole_output
from ig2mj.envs.environment import Environment
from ig2mj.envs.lerobot import camera_key as key_of_camera
from ig2mj.errors import InputError
from ig2mj.install_hint import require_extras
from ig2mj.sensors.cameras import HEAD, split_name

VERSION = "v3.0"
CHUNK_FILES, DATA_MB, VIDEO_MB = 1000, 100, 200
"""Files of a folder, and how large they grow: LeRobot's defaults."""

DATA_PATH = "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
VIDEO_PATH = "videos/{video_key}/chunk-{chunk_index:03d}/file-{file_index:03d}.mp4"
EPISODES_PATH = "meta/episodes/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"

NAMES = {"proprioception": "observation.state", "privileged_state": "observation.environment_state"}
"""Observations that LeRobot's policies look for under a name of their own; others are `observation.<name>`."""

QUANTILES = {"q01": 0.01, "q10": 0.1, "q50": 0.5, "q90": 0.9, "q99": 0.99}

DEEPEST = 65.535
"""m, the largest depth in whole millimetres of 16 bits."""

PIXEL_STRIDE = 4
"""Of the pixels that statistics of images are made of, in each direction."""


def export_lerobot(
    replayer: Replayer,
    folder: str | os.PathLike,
    codec: str = "h264",
    success_only: bool = False,
    incomplete: bool = False,
) -> Replayed:
    """Writes the complete runs of a recording; the folder appears when all are written.

    Args:
      replayer: of the recording; its environment's observations are written. folder: must not be there yet.
      codec: of the videos, as PyAV names it. success_only, incomplete: see `ig2mj.demos.selection.chosen_runs`.

    Returns:
      Result of the replay.

    Raises:
      MissingDependencyError: pyarrow or av is not installed. InputError: as of `observe`; or the folder is there; or
      the format cannot hold the period or the depths.
    """
    require_extras("lerobot")
    runs = some_runs(replayer.recording, success_only, incomplete)
    with whole_output(folder, folder=True) as unfinished:
        writer = DatasetWriter(unfinished, replayer, codec)
        try:
            done = observe(replayer, lambda number, run, seen: writer.add(run, seen), runs=runs)
            writer.finish()
        finally:
            writer.close()
    return done


@dataclasses.dataclass
class _Place:
    """Chunk and file that are written now, and what is in it."""

    chunk: int = 0
    file: int = 0
    size: float = 0.0

    def grow(self, size: float, limit: int) -> bool:
        """Adds so many MB; true where a new file begins for them."""
        new = self.size > 0 and self.size + size > limit
        if new:
            self.file, self.size = self.file + 1, 0.0
            if self.file == CHUNK_FILES:
                self.chunk, self.file = self.chunk + 1, 0
        self.size += size
        return new

    @property
    def indices(self) -> dict[str, int]:
        return {"chunk_index": self.chunk, "file_index": self.file}


class DatasetWriter:
    """Writes episodes, and what is known of all of them at the end."""

    def __init__(self, folder: pathlib.Path, replayer: Replayer, codec: str):
        """`folder`: an empty one. Raises InputError: the format cannot hold the recording."""
        from ig2mj.demos.videos import EpisodeVideos

        env = replayer.env
        self.folder, self._fps, self._made = folder, _whole_rate(replayer), made_again(env)
        self._name, self._horizon = env.task.name, env.task.horizon
        self._robot, self._task = env.robot, env.instruction()[0]
        self._features = _features(env)
        self._videos = {
            name: EpisodeVideos(lambda place, name=name: self._at(VIDEO_PATH, place, video_key=name), self._fps, codec)
            for name, feature in self._features.items()
            if feature["dtype"] == "video"
        }
        self._data = _Place()
        self._waiting: list[dict[str, Any]] = []
        self._episodes: list[dict[str, Any]] = []
        self._kept: dict[str, list[np.ndarray]] = {}  # of all steps, for statistics
        self._frames = 0

    def add(self, run: Run, seen: dict[str, np.ndarray]) -> None:
        """One episode, with its observations [T + 1, ...]."""
        length, number = run.frames - 1, len(self._episodes)
        columns, videos = self._columns(run, seen, number)
        if self._data.grow(sum(c.nbytes for c in columns.values()) / 2**20, DATA_MB):
            self._write_data(_Place(*_before(self._data)))
        self._waiting.append(columns)
        episode = {
            "episode_index": number,
            "tasks": [self._task],
            "length": length,
            "dataset_from_index": self._frames,
            "dataset_to_index": self._frames + length,
            **{f"data/{k}": v for k, v in self._data.indices.items()},
            **{f"meta/episodes/{k}": 0 for k in ("chunk_index", "file_index")},
        }
        for name, images in videos.items():
            place, start = self._videos[name].add(images, VIDEO_MB)
            of_film = {**place, "from_timestamp": start, "to_timestamp": start + length / self._fps}
            episode |= {f"videos/{name}/{k}": v for k, v in of_film.items()}
        for name, rows in (columns | videos).items():
            statistics = _statistics(_for_statistics(rows, name in videos))
            episode |= {f"stats/{name}/{k}": v.tolist() for k, v in statistics.items()}
            self._kept.setdefault(name, []).append(_for_statistics(rows, name in videos))
        self._episodes.append(episode)
        self._frames += length

    def close(self) -> None:
        """Closes the videos; may be called twice."""
        for video in self._videos.values():
            video.close()

    def finish(self) -> None:
        """Writes what is left, and the folder `meta`, after at least one episode."""
        self.close()
        self._write_data(self._data)
        import pyarrow as pa
        import pyarrow.parquet as pq

        pq.write_table(pa.Table.from_pylist(self._episodes), self._at(EPISODES_PATH, _Place().indices))
        pq.write_table(_tasks_table([self._task]), self.folder / "meta" / "tasks.parquet")
        for name, video in self._videos.items():
            self._features[name]["info"] = video.about
        info = {
            "codebase_version": VERSION,
            "robot_type": self._robot,
            "total_episodes": len(self._episodes),
            "total_frames": self._frames,
            "total_tasks": 1,
            "chunks_size": CHUNK_FILES,
            "data_files_size_in_mb": DATA_MB,
            "video_files_size_in_mb": VIDEO_MB,
            "fps": self._fps,
            "splits": {"train": f"0:{len(self._episodes)}"},
            "data_path": DATA_PATH,
            "video_path": VIDEO_PATH if self._videos else None,
            "features": self._features,
        }
        stats = {name: _statistics(np.concatenate(rows)) for name, rows in self._kept.items()}
        listed = {name: {k: v.tolist() for k, v in of.items()} for name, of in stats.items()}
        made = {"env": f"ig2mj/{self._name}-v0", "make": self._made, "horizon": self._horizon}
        for name, content in (("info", info), ("stats", listed), ("ig2mj", made)):
            text = json.dumps(content, indent=4, ensure_ascii=False)
            (self.folder / "meta" / f"{name}.json").write_text(text, encoding="utf-8")

    def _columns(
        self, run: Run, seen: dict[str, np.ndarray], number: int
    ) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
        """Columns [T, ...] and images [T, height, width, 3] of an episode."""
        length = run.frames - 1
        columns: dict[str, np.ndarray] = {"action": run.all_rows("steps/action")}
        videos: dict[str, np.ndarray] = {}
        for name, rows in seen.items():
            known = _name(name)
            (videos if known in self._videos else columns)[known] = _column(name, rows[:-1])
        ends = run.all_rows("steps/terminated") | run.all_rows("steps/truncated")
        columns["next.reward"] = run.all_rows("steps/reward/total").astype(np.float32)
        columns["next.done"], columns["next.success"] = ends, run.all_rows("steps/success")
        columns["timestamp"] = (np.arange(length) / self._fps).astype(np.float32)
        columns["frame_index"] = np.arange(length)
        columns["episode_index"] = np.full(length, number)
        columns["index"] = self._frames + np.arange(length)
        columns["task_index"] = np.zeros(length, np.int64)
        return columns, videos

    def _write_data(self, place: _Place) -> None:
        import pyarrow as pa
        import pyarrow.parquet as pq

        whole = {name: np.concatenate([c[name] for c in self._waiting]) for name in self._waiting[0]}
        table = pa.table({name: _arrow(rows) for name, rows in whole.items()})
        pq.write_table(table, self._at(DATA_PATH, place.indices), compression="snappy")
        self._waiting = []

    def _at(self, pattern: str, indices: dict[str, int], **more: str) -> pathlib.Path:
        file = self.folder / pattern.format(**indices, **more)
        file.parent.mkdir(parents=True, exist_ok=True)
        (self.folder / "meta").mkdir(exist_ok=True)
        return file


def _whole_rate(replayer: Replayer) -> int:
    """Frames a second. Raises InputError: they are no whole number, or depths are too large."""
    env, file = replayer.env, replayer.recording.file
    rate = 1 / env.period
    if abs(rate - round(rate)) > 1e-6:
        problem = f"has {rate:.6g} steps a second, and LeRobot's datasets have a whole number"
        raise InputError(file, problem, element="attribute period", fix="export it to robomimic")
    if any(_is_depth(name) for name in env.observation_spaces) and env.sensor_options.depth_high > DEEPEST:
        problem = f"depth_high = {env.sensor_options.depth_high:g}: whole millimetres go up to {DEEPEST} m"
        raise InputError(file, problem, element="attribute sensors", fix="export it to robomimic")
    return round(rate)


def _before(place: _Place) -> tuple[int, int]:
    """Chunk and file before these."""
    return (place.chunk, place.file - 1) if place.file else (place.chunk - 1, CHUNK_FILES - 1)


def _name(observation: str) -> str:
    if _is_rgb(observation):
        return f"observation.images.{camera_key(observation)}"
    return NAMES.get(observation, f"observation.{observation.replace('/', '.')}")


def camera_key(observation: str) -> str:
    """Of images in colour in LeRobot's datasets and environments: `rgb` of the camera `head`, else the camera's."""
    camera, _ = split_name(observation)
    return key_of_camera(camera if observation != camera else HEAD)


def _is_rgb(observation: str) -> bool:
    return split_name(observation)[1] == "rgb"


def _is_depth(observation: str) -> bool:
    return split_name(observation)[1] == "depth"


def _features(env: Environment) -> dict[str, dict[str, Any]]:
    """Every column and video, as `info.json` lists it."""
    names = {"privileged_state": list(env.privileged_names), "proprioception": list(env.proprioception_names)}
    features: dict[str, dict[str, Any]] = {"action": _feature(np.float32, env.action_space.shape, env.action_names)}
    for name, space in env.observation_spaces.items():
        if _is_rgb(name):
            listed = ["height", "width", "channels"]
            features[_name(name)] = {"dtype": "video", "shape": [*space.shape[:2], 3], "names": listed}
            continue
        dtype = _column(name, np.zeros((1, *space.shape), space.dtype)).dtype
        listed = names.get(name, [])
        features[_name(name)] = _feature(dtype, space.shape, listed if len(listed) == space.shape[0] else None)
    scalars = {"next.reward": np.float32, "next.done": np.bool_, "next.success": np.bool_, "timestamp": np.float32}
    scalars |= dict.fromkeys(("frame_index", "episode_index", "index", "task_index"), np.int64)
    return features | {name: _feature(dtype, (1,), None) for name, dtype in scalars.items()}


def _feature(dtype: Any, shape: tuple[int, ...], names: Any) -> dict[str, Any]:
    listed = list(names) if names is not None else None
    return {"dtype": np.dtype(dtype).name, "shape": list(shape), "names": listed}


def _column(name: str, rows: np.ndarray) -> np.ndarray:
    """As it is written: depths in whole millimetres, other floats in single precision."""
    if _is_depth(name):
        return (rows * 1000.0).round().astype(np.uint16)
    return rows.astype(np.float32) if rows.dtype.kind == "f" else rows


def _arrow(rows: np.ndarray) -> Any:
    """[N, ...] as an array of Arrow's; fixed lists where rows are vectors, lists of lists where they are images."""
    import pyarrow as pa

    array = pa.array(np.ascontiguousarray(rows).reshape(-1))
    if rows.ndim == 2 and rows.shape[1] > 1:
        return pa.FixedSizeListArray.from_arrays(array, rows.shape[1])
    for size in reversed(rows.shape[1:] if rows.ndim > 2 else ()):
        array = pa.ListArray.from_arrays(np.arange(0, len(array) + 1, size, dtype=np.int32), array)
    return array


def _for_statistics(rows: np.ndarray, images: bool) -> np.ndarray:
    """[n, k] values of which statistics are made: of images those of some pixels by channel, 0..1."""
    if images:
        return (rows[:, ::PIXEL_STRIDE, ::PIXEL_STRIDE].reshape(-1, 3) / 255.0).astype(np.float32)
    if rows.ndim > 3:
        return rows[:, ::PIXEL_STRIDE, ::PIXEL_STRIDE].reshape(-1, rows.shape[-1]).astype(np.float32)
    if rows.ndim > 2:
        return rows[:, ::PIXEL_STRIDE].reshape(-1, rows.shape[-1]).astype(np.float32)
    return rows.reshape(len(rows), -1).astype(np.float64 if rows.dtype.kind in "fi" else np.float32)


def _statistics(values: np.ndarray) -> dict[str, np.ndarray]:
    """Of [n, k] values; those of images and depths have the shape [k, 1, 1] in LeRobot's files."""
    found = {"min": values.min(0), "max": values.max(0), "mean": values.mean(0), "std": values.std(0)}
    found |= {name: np.quantile(values, q, axis=0) for name, q in QUANTILES.items()}
    if values.dtype == np.float32 and values.shape[1] == 3:
        found = {name: value.reshape(3, 1, 1) for name, value in found.items()}
    return {**found, "count": np.array([len(values)])}


def _tasks_table(tasks: list[str]) -> Any:
    """The table that pandas reads as one column `task_index`, with the tasks' sentences as its index."""
    import pyarrow as pa

    index = "__index_level_0__"
    kinds = {"task_index": ("int64", "int64"), index: ("unicode", "object")}
    columns = [
        {
            "name": None if name == index else name,
            "field_name": name,
            "pandas_type": kind,
            "numpy_type": numpy_type,
            "metadata": None,
        }
        for name, (kind, numpy_type) in kinds.items()
    ]
    about = {"index_columns": [index], "column_indexes": [], "columns": columns, "pandas_version": "2.0.0"}
    table = pa.table({"task_index": pa.array(range(len(tasks)), pa.int64()), index: tasks})
    return table.replace_schema_metadata({"pandas": json.dumps(about)})
