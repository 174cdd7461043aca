"""Exporting recordings to robomimic's HDF5, with observations computed by a replay.

    /data                 attributes: total, env_args (JSON)
        /demo_0           attribute: num_samples
            /actions /rewards /dones /states [T, ...]   /obs/<name> /next_obs/<name> [T, ...]
    /mask                 names of demonstrations, robomimic's filter keys
        /success          those that succeeded      /complete      those that terminated or were truncated
        /train /valid     nine in ten, and the rest

`states` are `qpos` and `qvel` of the frames, for inspection; compact recordings have none. The complete state of a
world is in the recording. `env_kwargs` in `env_args` are the arguments of `ig2mj.make` for these observations.

Axis: T steps of a run.
"""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from typing import Any

import numpy as np

from ig2mj.demos.observing import made_again, observe
from ig2mj.demos.reader import Run
from ig2mj.demos.replay import Replayed, Replayer
from ig2mj.demos.selection import some_runs
from ig2mj.demos.whole_output import whole_output

GYM_TYPE = 2
"""robomimic's `EnvType.GYM_TYPE`."""

VALID = 10
"""One demonstration in so many is for validation, robomimic's default."""


def export_robomimic(
    replayer: Replayer, file: str | os.PathLike, success_only: bool = False, incomplete: bool = False
) -> Replayed:
    """Writes the complete runs of a recording, in their order; the file appears when all are written.

    Args:
      replayer: of the recording; its environment's observations are written.
      success_only, incomplete: see `ig2mj.demos.selection.chosen_runs`.

    Returns:
      Result of the replay.

    Raises:
      InputError: as of `observe`; or the file cannot be written.
    """
    import h5py

    env = replayer.env
    runs = some_runs(replayer.recording, success_only, incomplete)
    with whole_output(file) as unfinished, h5py.File(unfinished, "w") as out:
        done = observe(replayer, lambda n, run, seen: _write(out.create_group(f"data/demo_{n}"), run, seen), runs=runs)
        about = {
            "env_name": f"ig2mj/{env.task.name}-v0",
            "type": GYM_TYPE,
            "env_kwargs": made_again(env),
            "horizon": env.task.horizon,
        }
        data = out.require_group("data")
        data.attrs["total"] = sum(run.frames - 1 for run in runs)
        data.attrs["env_args"] = json.dumps(about)
        for name, numbers in _masks(runs).items():
            out[f"mask/{name}"] = np.array([f"demo_{n}" for n in numbers], "S")
    return done


def _masks(runs: Sequence[Run]) -> dict[str, list[int]]:
    """Numbers of demonstrations by filter key. Of two to nine the last one is for validation."""
    count = len(runs)
    valid = [n for n in range(count) if n % VALID == VALID - 1] or [count - 1] * (count > 1)
    found = {
        "success": [n for n, run in enumerate(runs) if run.success],
        "complete": [n for n, run in enumerate(runs) if run.complete],
        "train": [n for n in range(count) if n not in valid],
        "valid": valid,
    }
    return {name: numbers for name, numbers in found.items() if numbers}


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
