"""`convert`: demonstrations files of ig2mj 0.1.0 to recordings.

Those files hold actions, labels, rewards, ends and observations, but not the world. So a converted file can be learned
from (`ig2mj train --demos`), and cannot be replayed, measured or exported.

Axes: T steps of a run.
"""

from __future__ import annotations

import json
import os
from typing import Any

import numpy as np

from ig2mj.demos.reader import DEMONSTRATIONS, Recording
from ig2mj.demos.whole_output import whole_output
from ig2mj.demos.writer import FORMAT, RunWriter
from ig2mj.errors import InputError
from ig2mj.files.content import decode_json
from ig2mj.files.hdf5 import Hdf5File

CONVERTED = "converted_from"
"""Attribute of a converted file: what it was."""

STEPS = ("action", "label", "reward", "terminated", "truncated")
"""Arrays of a run of an old file, next to its observations."""

_FIX = "`ig2mj demos collect` of ig2mj 0.1.0 writes such files"


def convert(old: str | os.PathLike, new: str | os.PathLike) -> int:
    """Converts a demonstrations file of ig2mj 0.1.0 to a recording without the frames of the world.

    Returns:
      The number of runs.

    Raises:
      InputError: the file is broken, is a recording already, or is of another version; or `new` cannot be written.
    """
    with Hdf5File(old, fix=_FIX) as found:
        header = found.attributes()
        if header.get("format") == FORMAT:
            with Recording(old) as recording:
                problem = f"is a recording of format {recording.version}, which this version of ig2mj reads"
                raise InputError(old, problem, fix="use it as it is")
        if not found.is_of(DEMONSTRATIONS, 1):
            raise InputError(old, "is no demonstrations file of ig2mj 0.1.0", element="format", fix=_FIX)
        world, spaces = (decode_json(str(header.get(name)), found.file, kind=dict) for name in ("world", "spaces"))
        runs = found.names()
        found.claim(f"{run}/{name}" for run in runs for name in (*STEPS, *(f"obs/{name}" for name in spaces)))
        steps = ["action", "label", "reward/total", "terminated", "truncated", "success"]
        about, observed = _about(world, spaces), list(spaces)
        with whole_output(new) as unfinished, RunWriter(unfinished, about, {}, [], steps, observed=observed) as writer:
            for run in runs:
                _convert_run(found, run, observed, writer)
        return len(runs)


def _about(world: dict[str, Any], spaces: dict[str, Any]) -> dict[str, Any]:
    unknown = dict.fromkeys(("mujoco", "scene", "scene_hash", "model_hash"), "unknown")
    own = {name: str(world.get(name, "")) for name in ("task", "robot", "grasping")}
    lists = {"action_names": world.get("actions", []), "privileged_names": world.get("privileged", [])}
    texts = {name: json.dumps(value) for name, value in (lists | {"spaces": spaces}).items()}
    return {**unknown, **own, **texts, "worlds": 1, CONVERTED: f"{DEMONSTRATIONS}, version 1"}


def _convert_run(found: Hdf5File, run: str, observed: list[str], writer: RunWriter) -> None:
    """Writes one run. Raises InputError: its arrays do not fit together."""
    steps = {name: found.read(f"{run}/{name}") for name in STEPS}
    obs = [found.read(f"{run}/obs/{name}") for name in observed]
    count = len(steps["action"])
    for name, array in [*((n, a[:count]) for n, a in steps.items()), *zip(observed, (a[1:] for a in obs), strict=True)]:
        if len(array) != count:
            raise found.broken(f"{run}/{name}", f"has {len(array)} rows of a run of {count} steps")
    success = found.attributes(run).get("success") is True
    writer.begin({0: {"success": success, "complete": True}}, [[]], [a[None, 0] for a in obs])
    for k in range(count):
        row = [steps[name][None, k] for name in STEPS]
        writer.add([[]], [a[None, k + 1] for a in obs], [*row, np.array([success and k == count - 1])])
    ends = {name: bool(steps[name][-1]) for name in ("terminated", "truncated")} if count else {}
    writer.end(0, success=success, complete=True, **ends)
