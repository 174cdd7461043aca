"""Exporting recordings to robomimic's HDF5, with observations made anew by a replay.

    /data                 attributes: total, env_args (JSON)
        /demo_0           attribute: num_samples
            /actions /rewards /dones /states [T, ...]   /obs/<name> /next_obs/<name> [T, ...]

`states` are the frames' `qpos` and `qvel`, for people; thin recordings have none. What a world goes on from is in the
recording. Runs of a single frame are left out.

Axis: T steps of a run.
"""

from __future__ import annotations

import json
import os
from typing import Any

import numpy as np

from ig2mj.demos.observing import exported_runs, observe
from ig2mj.demos.reader import Run
from ig2mj.demos.replay import Replayed, Replayer

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

    env = replayer.env
    with h5py.File(file, "w") as out:
        done = observe(replayer, lambda n, run, seen: _write(out.create_group(f"data/demo_{n}"), run, seen))
        about = {
            "env_name": f"ig2mj/{env.task.name}-v0",
            "type": GYM_TYPE,
            "env_kwargs": {"robot": env.robot, "grasping": env.grasping, "observations": list(env.observation_spaces)},
        }
        data = out.require_group("data")
        data.attrs["total"] = sum(run.frames - 1 for run in exported_runs(replayer))
        data.attrs["env_args"] = json.dumps(about)
    return done


def _write(group: Any, run: Run, seen: dict[str, np.ndarray]) -> None:
    group.attrs["num_samples"] = run.frames - 1
    steps = {name: run.all_rows(f"steps/{name}") for name in ("action", "reward/total")}
    ends = [run.all_rows(f"steps/{name}") for name in ("terminated", "truncated")]
    group["actions"], group["rewards"] = steps["action"], steps["reward/total"]
    group["dones"] = (ends[0] | ends[1]).astype(np.int64)
    if run.kept(1, 2).all():  # a thin recording has none
        _write_states(group, run)
    for name, array in seen.items():
        packed = {"compression": "gzip", "compression_opts": 1} if array.ndim > 2 else {}
        group.create_dataset(f"obs/{name}", data=array[:-1], **packed)
        group.create_dataset(f"next_obs/{name}", data=array[1:], **packed)


def _write_states(group: Any, run: Run) -> None:
    parts = [f"frames/physics/{part}/{name}" for name in ("qpos", "qvel") for part in ("scene", "agents")]
    group["states"] = np.concatenate([run.all_rows(name)[:-1] for name in parts], axis=1)
