"""Exporting recordings to robomimic's HDF5, with observations made anew by a replay.

    /data                 attributes: total, env_args (JSON)
        /demo_0           attribute: num_samples
            /actions /rewards /dones /states [T, ...]   /obs/<name> /next_obs/<name> [T, ...]

`states` are the frames' `qpos` and `qvel`, for people; what a world goes on from is in the recording. Runs of a single
frame are left out.

Axis: T steps of a run.
"""

from __future__ import annotations

import json
import os
from typing import Any

import numpy as np

from ig2mj.demos.reader import Run
from ig2mj.demos.replay import Replayed, Replayer
from ig2mj.envs.environment import EnvState
from ig2mj.errors import InputError

GYM_TYPE = 2
"""robomimic's `EnvType.GYM_TYPE`."""


def export_robomimic(replayer: Replayer, file: str | os.PathLike) -> Replayed:
    """Writes all runs of a recording, in their order.

    Args:
      replayer: of the recording; its environment's observations are written.

    Returns:
      What came of the replay.

    Raises:
      InputError: the recording is broken, or does not come out the same by action.
      OSError: the file cannot be written.
    """
    import h5py

    env, runs = replayer.env, [run for run in replayer.recording.runs if run.frames > 1]
    places = {run.name: f"data/demo_{number}" for number, run in enumerate(runs)}
    with h5py.File(file, "w") as out:
        seen: dict[str, dict[str, list[np.ndarray]]] = {}

        def watch(state: EnvState, now: dict[int, Run], frame: int) -> None:
            for world, run in now.items():
                of_run = seen.setdefault(run.name, {name: [] for name in state.obs})
                for name, array in state.obs.items():
                    of_run[name].append(np.asarray(array)[world])
                if frame == run.frames - 1:
                    _write(out.create_group(places[run.name]), run, seen.pop(run.name))

        done = replayer(check=True, watch=watch, runs=runs)
        if done.differences:
            fix = "export it by state (--by state)"
            raise InputError(replayer.recording.file, str(done.differences[0]), fix=fix)
        about = {
            "env_name": f"ig2mj/{env.task.name}-v0",
            "type": GYM_TYPE,
            "env_kwargs": {"robot": env.robot, "grasping": env.grasping, "observations": list(env.observation_spaces)},
        }
        data = out.require_group("data")
        data.attrs["total"] = sum(run.frames - 1 for run in runs)
        data.attrs["env_args"] = json.dumps(about)
    return done


def _write(group: Any, run: Run, seen: dict[str, list[np.ndarray]]) -> None:
    group.attrs["num_samples"] = run.frames - 1
    steps = {name: _all(run, f"steps/{name}", run.frames - 1) for name in ("action", "reward/total")}
    ends = [_all(run, f"steps/{name}", run.frames - 1) for name in ("terminated", "truncated")]
    group["actions"], group["rewards"] = steps["action"], steps["reward/total"]
    group["dones"] = (ends[0] | ends[1]).astype(np.int64)
    parts = [f"frames/physics/{part}/{name}" for name in ("qpos", "qvel") for part in ("scene", "agents")]
    group["states"] = np.concatenate([_all(run, name, run.frames)[:-1] for name in parts], axis=1)
    for name, rows in seen.items():
        array = np.stack(rows)
        packed = {"compression": "gzip", "compression_opts": 1} if array.ndim > 2 else {}
        group.create_dataset(f"obs/{name}", data=array[:-1], **packed)
        group.create_dataset(f"next_obs/{name}", data=array[1:], **packed)


def _all(run: Run, name: str, count: int) -> np.ndarray:
    """All rows of an array."""
    parts = [run.rows(name, k, min(k + 200, count)) for k in range(0, count, 200)]
    array = np.concatenate(parts[:1] if len(parts[0]) == 1 and count > 1 else parts)
    return np.broadcast_to(array, (count, *array.shape[1:]))
