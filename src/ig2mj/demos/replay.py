"""Replaying recordings of environments: by their actions, bit for bit, or by their states.

By action, a run starts at its first frame and repeats every action. On the native engine all bytes of all frames are
reproduced, with any number of threads and in another process: one thread steps a world, a snapshot has the complete
state of MuJoCo (including sleep and warm start), and random numbers come from the episode's key. A run is replayed at
its row of the batch, in a batch of the same size, since compiled programs may treat rows differently.

By state, every frame is loaded as it was written. That is exact on any machine, for viewing and for other sensors.

Axes: W worlds.
"""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import jax
import numpy as np

from ig2mj.demos.frames import (
    Difference,
    Frame,
    FrameRows,
    Labels,
    first_difference,
    frame_of,
    names_of,
    plugin_columns,
    resumed,
    stacked,
)
from ig2mj.demos.origin import BINDING, LOOSE, WHOLE_HASHES, differences, missing_objects, origin_of
from ig2mj.demos.reader import Recording, Run
from ig2mj.demos.shipped import find_recording
from ig2mj.demos.writer import FLUSH
from ig2mj.envs.config import current_names
from ig2mj.envs.environment import Environment, EnvState
from ig2mj.envs.registry import VECTORS, find_task, make
from ig2mj.errors import EngineError, InputError, UnknownNameError
from ig2mj.process import entry_point
from ig2mj.scene.changes import added
from ig2mj.scene.found_again import requests_again
from ig2mj.scene.scene import PLAIN
from ig2mj.tasks.custom.files import refuse_unknown
from ig2mj.tasks.task import Task

MODES = ("action", "state")

MOST_WORLDS = 65536
"""Largest number of worlds of a recording; a larger one is taken for a damaged or hostile file."""

MOST_PIXELS = 16384
"""Largest number of pixels along an edge of an image, or of rays of a sensor, for the same reason."""

_NAMED_BY = {
    "environment": "task",
    "robot": "robot",
    "grasping mode": "grasping",
    "engine": "engine",
    "split": "made_with",
    "setting of sensors": "sensors",
}
"""Attributes of a file that give names, by the kind of the name."""

FIX_ENV = "make the environment yourself, and hand it over: `Replayer(recording, env=...)`"

Watch = Callable[[EnvState, dict[int, Run], int], None]
"""Called with the environment's state, the run of each replayed world, and the index of the frame. The state is
invalidated by the next frame; copy what you keep."""


@dataclasses.dataclass(frozen=True)
class Replayed:
    """Result of a replay.

    Attributes:
      runs, frames: numbers of replayed runs and frames. differences: the first one of each run that differs.
      warnings: what differs between this machine and that of the recording.
    """

    runs: int
    frames: int
    differences: list[Difference]
    warnings: list[str]


@entry_point
class Replayer:
    """Replays the runs of a file in one environment.

    Attributes:
      env: the environment. here: attributes that a recording of it would have (`ig2mj.demos.origin`). warnings: see
        `Replayed`.
    """

    def __init__(
        self,
        recording: Recording,
        by: str = "action",
        env: Environment | None = None,
        observations: str | Sequence[str] = VECTORS,
        **options: Any,
    ):
        """Makes the environment that the file was recorded in.

        Args:
          by: one of `MODES`. env: the environment, where `ig2mj.make` cannot make it: a task of one's own.
          observations, options: of the environment; they may change observations, not the course of events.

        Raises:
          InputError: the file is broken; or, by action, something that determines the outcome differs on this machine.
        """
        self.recording, self.by = recording, by
        if not any(name.startswith("frames/") for name in recording.columns):
            fix = "`ig2mj train --demos` learns from it; `ig2mj demos collect` records the world, too"
            raise InputError(recording.file, "holds no frames of the world: it was converted", fix=fix)
        self.env = env if env is not None else _environment(recording, observations, options)
        here = origin_of(self.env, recording.version)
        if recording.version == WHOLE_HASHES:  # a task's text has names of classes, which mean nothing
            binding, loose = tuple(name for name in BINDING if name != "task_hash"), ("task_hash", *LOOSE)
        else:
            binding, loose = BINDING, LOOSE
        bound = differences(recording.header, here, binding) + recording.missing_states(here)
        if bound and by == "action":
            raise InputError(
                recording.file,
                f"cannot be replayed by action: {'; '.join(missing_objects(recording.header, here) + bound)}",
                fix="replay it by state (--by state)",
            )
        self.warnings, self.here = bound + differences(recording.header, here, loose), here
        if recording.header.get("engine") != "native" and by == "action":
            self.warnings.append(f"engine {recording.header.get('engine')} is not bit-exact")
        worlds = recording.value("worlds", int)
        if worlds != self.env.num_worlds:
            raise EngineError(f"the recording is of {worlds} worlds, the environment has {self.env.num_worlds}")
        state = self.env.reset(0)
        frame = frame_of(self.env.core.engine, state)
        self._names, self._tree = names_of(frame), jax.tree.structure(frame)
        self._rows = FrameRows(self.env.core.engine, range(worlds), state).rows
        self._like = self._rows(state)[0]
        self._labels = Labels(self.env.scene)
        rules, columns = self.env.core.rules, [name.removeprefix("frames/") for name in recording.columns]
        self._lacking = plugin_columns(None if rules is None else rules.initial, columns)
        # Measures of the task that are younger than the recording: as an episode begins with them.
        younger = [k for k, n in enumerate(self._names) if n.startswith("measures/") and n not in columns]
        self._lacking |= {self._names[k]: np.asarray(self._like[k])[None] for k in younger}
        for run in recording.runs:
            if run.world >= worlds:
                raise run.broken("attribute world", f"is {run.world}, and the file is of {worlds} worlds")
            if run.frames and (missing := [n for n in self._names if n not in (*run.names, *self._lacking)]):
                raise run.broken(f"frames/{missing[0]}", "is missing")

    def __call__(self, check: bool = False, watch: Watch | None = None, runs: Sequence[Run] | None = None) -> Replayed:
        """Replays.

        Args:
          check: compare every byte of every frame. runs: which; None: all.

        Raises:
          InputError: an array of the file is broken.
        """
        requested = self.recording.runs if runs is None else runs
        found: list[Difference] = []
        frames = 0
        for now in self.rounds(requested):
            frames += sum(run.frames for run in now.values())
            found += self._by_action(now, check, watch) if self.by == "action" else self._by_state(now, watch)
        return Replayed(sum(1 for r in requested if r.frames), frames, found, self.warnings)

    def at(self, run: Run, frame: int, used: EnvState | None = None) -> EnvState:
        """The environment at a frame of a run as it was written; every world stands where that one did.

        Args:
          used: an earlier state that is no longer stepped; its worlds are reused.

        Raises:
          InputError: an array of the file is broken.
        """
        rows = [array[0, ...] for array in self._read(run, frame, frame + 1)]
        return self._put({run.world: rows if frame else self._start(rows, run)}, {run.world: run}, used)

    def rounds(self, runs: Sequence[Run]) -> Iterator[dict[int, Run]]:
        """Runs that are replayed side by side, by their worlds."""
        queues: dict[int, list[Run]] = {}
        for run in runs:
            if run.frames:
                queues.setdefault(run.world, []).append(run)
        while queues:
            yield {world: queue.pop(0) for world, queue in queues.items()}
            queues = {world: queue for world, queue in queues.items() if queue}

    def all_at(self, now: dict[int, Run], place: str) -> EnvState:
        """The environment with each run's world at the "first" or "last" of its frames. Raises InputError."""
        frames = {world: 0 if place == "first" else run.frames - 1 for world, run in now.items()}
        rows = {w: self._read(run, frames[w], frames[w] + 1) for w, run in now.items()}
        return self._put({w: [array[0, ...] for array in arrays] for w, arrays in rows.items()}, now)

    def _by_action(self, now: dict[int, Run], check: bool, watch: Watch | None) -> list[Difference]:
        found: dict[int, Difference] = {}
        readers = {world: self._frames(run) for world, run in now.items()}
        actions = {world: self._actions(run) for world, run in now.items()}
        recorded = {world: next(reader) for world, reader in readers.items()}
        state = self._put({world: self._start(rows, now[world]) for world, rows in recorded.items()}, now)
        longest, zero = max(run.frames for run in now.values()), np.zeros(self.env.action_space.shape, np.float32)
        for k in range(longest):
            if k:
                given = [next(actions[w], zero) if w in actions else zero for w in range(self.env.num_worlds)]
                state = self.env.step(state, np.stack(given))
            going = {w: run for w, run in now.items() if k < run.frames}
            if check:
                if k:
                    recorded = {world: next(readers[world]) for world in going if world not in found}
                came = self._rows(state)
                for world, rows in recorded.items():
                    if rows is None:
                        continue
                    run = now[world].name
                    one = first_difference(self._labels, run, k, self._names, rows, came[world], self._lacking)
                    if one is not None:
                        found[world] = one
                if len(found) == len(now):
                    break
            if watch is not None:
                watch(state, going, k)
        return [found[world] for world in sorted(found)]

    def _by_state(self, now: dict[int, Run], watch: Watch | None) -> list[Difference]:
        readers = {world: self._frames(run) for world, run in now.items()}
        last: dict[int, list[np.ndarray]] = {}
        state = None
        for k in range(max(run.frames for run in now.values())):
            there = {world: rows for world, reader in readers.items() if (rows := next(reader, None)) is not None}
            if not there:
                continue
            last |= there if k else {world: self._start(rows, now[world]) for world, rows in there.items()}
            state = self._put(last, now, state)
            if watch is not None:
                watch(state, {w: now[w] for w in there}, k)
        return []

    def _start(self, rows: list[np.ndarray] | None, run: Run) -> list[np.ndarray]:
        """A first frame. Raises InputError: there is none, or a world cannot begin with it."""
        if rows is None:
            raise run.broken("frames", "has no first frame")
        for name, row in zip(self._names, rows, strict=True):
            if name.startswith("physics/") and row.dtype.kind == "f" and not np.isfinite(row).all():
                raise run.broken(f"frames/{name}", "begins with numbers that are not finite")
        return rows

    def _put(self, rows: dict[int, list[np.ndarray]], now: dict[int, Run], used: EnvState | None = None) -> EnvState:
        """The environment at these frames; worlds without a run are copies of the first."""
        some = next(iter(rows.values()))
        each = [rows.get(world, some) for world in range(self.env.num_worlds)]
        frame: Frame = jax.tree.unflatten(self._tree, stacked(each))
        size = self.env.core.starts.pool.size
        begun = [now[w].row if w in now else 0 for w in range(self.env.num_worlds)]
        return resumed(self.env, frame, np.clip(begun, 0, size - 1), used)

    def _read(self, run: Run, start: int, stop: int) -> list[np.ndarray]:
        """Frames of a run; what the file may lack is as at the start. Raises InputError."""
        return run.whole_frames(self._names, start, stop, self._like, self._lacking)

    def _frames(self, run: Run) -> Iterator[list[np.ndarray] | None]:
        """The arrays of one frame after the other; None where the frame is not in the file."""
        for start in range(0, run.frames, FLUSH):
            stop = min(start + FLUSH, run.frames)
            kept = run.kept(start, stop)
            if kept.all():
                rows = self._read(run, start, stop)
                yield from ([array[k, ...] for array in rows] for k in range(stop - start))
                continue
            for k, there in enumerate(kept, start):
                yield [a[0, ...] for a in self._read(run, k, k + 1)] if there else None

    def _actions(self, run: Run) -> Iterator[np.ndarray]:
        like = np.zeros(self.env.action_space.shape, np.float32)
        for start in range(0, run.frames - 1, FLUSH):
            stop = min(start + FLUSH, run.frames - 1)
            rows = run.rows("steps/action", start, stop, like)
            if not np.isfinite(rows).all():
                raise run.broken("steps/action", "has numbers that are not finite")
            yield from rows


def objects_again(recording: Recording, requested: Any) -> tuple[str, ...]:
    """What was added to the home, where it is now. Raises InputError: it is missing."""
    if not isinstance(requested, list) or not all(isinstance(text, str) for text in requested):
        raise InputError(recording.file, "has objects that are no list of texts", element="attribute made_with")
    known = recording.value("additions_found_by", list)
    replaced = recording.value("replacements_found_by", list) if "replacements_found_by" in recording.header else []
    return requests_again(requested, [*replaced, *known[len(known) - len(added(requested)) :]], recording.file)


def recorded_observations(recording: Recording) -> tuple[str, ...]:
    """Names of the observations that the recorded environment made. Raises InputError."""
    if "observations" not in recording.header:
        return VECTORS
    return tuple(map(str, recording.value("observations", list))) or VECTORS


def replay(file: str | os.PathLike, by: str = "action", check: bool = True, **options: Any) -> Replayed:
    """Replays all runs of a file, or of demonstrations that ship. Arguments and errors as of `Replayer`."""
    with Recording(find_recording(file)) as recording:
        return Replayer(recording, by, **options)(check)


def _environment(recording: Recording, observations: str | Sequence[str], options: dict[str, Any]) -> Environment:
    """The environment that a file was recorded in.

    Runs start at recorded frames, so activities need a pool of one row, and no minutes of sampling. Navigation tasks
    need the whole pool, which holds the goals.
    """
    made = current_names(recording.value("made_with", dict))
    if recording.header.get("not_made_with", "[]") != "[]":
        missing = ", ".join(map(str, recording.value("not_made_with", list)))
        raise InputError(recording.file, f"does not have what its environment was made with: {missing}", fix=FIX_ENV)
    if made.get("objects"):
        made = {**made, "objects": objects_again(recording, made["objects"])}
    if "sensors" in recording.header and "sensors" not in options:
        sensors = recording.value("sensors", dict)
        large = [name for name, value in sensors.items() if isinstance(value, int) and value > MOST_PIXELS]
        if large:
            problem = f"{large[0]} = {sensors[large[0]]}, and {MOST_PIXELS} is the most"
            raise InputError(recording.file, problem, element="attribute sensors")
        options = {**options, "sensors": {"looks": PLAIN, **sensors}}  # 0.1.0 has no other looks
    robot, grasping = recording.value("robot", str), recording.value("grasping", str)
    worlds, engine = recording.value("worlds", int), recording.value("engine", str)
    if not 0 < worlds <= MOST_WORLDS:
        problem = f"is {worlds}, and a recording has 1 to {MOST_WORLDS} worlds"
        raise InputError(recording.file, problem, element="attribute worlds")
    try:
        name = recording.value("task", str)
        refuse_unknown(name, recording.header.get("task_file"), recording.file)
        task = find_task(name)
        if isinstance(task, Task):
            made = {**made, "pool_size": 1, "augment_starts": 0}
        env = make(task, robot, worlds, engine, grasping, observations=observations, **(made | options))
    except UnknownNameError as e:
        if e.kind.startswith("option of "):
            raise InputError(recording.file, f"makes no environment: {e}", element="attribute made_with") from e
        if e.kind not in _NAMED_BY:
            raise
        raise InputError(recording.file, str(e), element=f"attribute {_NAMED_BY[e.kind]}") from e
    except EngineError as e:
        raise InputError(recording.file, f"its environment cannot be made here: {e}") from e
    except TypeError as e:
        if not made.keys() - options.keys():
            raise
        raise InputError(recording.file, f"makes no environment: {e}", element="attribute made_with") from e
    return env.with_horizon(recording.value("horizon", int))
