"""`write_compact`: runs with all their steps but only the first and last frame of the world.

A replay by action reproduces the omitted frames bit for bit. A compact run takes a hundredth of the space.

Axis: N frames of all kept runs.
"""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from typing import Any

import numpy as np

from ig2mj.demos.reader import Recording, Run
from ig2mj.demos.whole_output import whole_output
from ig2mj.demos.writer import FLUSH, FORMAT, PACKED


def write_compact(recording: Recording, file: str | os.PathLike, runs: Sequence[Run], **attributes: Any) -> None:
    """Writes some runs of a recording, renumbered in this order. The file appears once it is complete.

    Args:
      attributes: further attributes of the file.

    Raises:
      InputError: the recording is broken, or the file cannot be written.
    """
    import h5py

    names, of_world = list(recording.columns), [name.startswith("frames/") for name in recording.columns]
    parts = []
    for run in runs:
        places = np.concatenate([run.index(k, min(k + FLUSH, run.frames)) for k in range(0, run.frames, FLUSH)])
        places[1:-1, of_world] = -1
        parts.append(places)
    index = np.concatenate(parts)
    with whole_output(file) as unfinished, h5py.File(unfinished, "w", libver=("v108", "v108")) as out:
        about = {"format": FORMAT, "version": recording.version, "columns": json.dumps(names)}
        for name, value in (recording.header | about | attributes).items():
            out.attrs[name] = value
        for column, name in enumerate(names):
            used, found = np.unique(index[:, column], return_inverse=True)
            rows = [recording.read(name, int(row), int(row) + 1) for row in used if row >= 0]
            index[:, column] = found - int(used[0] < 0)
            array = np.concatenate(rows) if rows else np.zeros((0, *recording.arrays[name].shape[1:]))
            chunks = (min(len(array), FLUSH), *array.shape[1:])
            packed = PACKED | {"compression_opts": 9, "chunks": chunks} if array.nbytes > 1024 else {}
            out.create_dataset(name, data=array, **packed)
        out.create_dataset("index", data=index, chunks=(FLUSH, len(names)), maxshape=(None, len(names)), **PACKED)
        first = 0
        for number, run in enumerate(runs):
            group = out.create_group(f"run_{number:06d}")
            for name, value in run.attributes.items():
                group.attrs[name] = value
            group.attrs["parts"] = np.array([[first, run.frames]])
            first += run.frames
