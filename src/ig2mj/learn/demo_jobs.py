"""Collection of demonstrations by jobs: each plays an expert for some episodes from a seed of its own, and
gives a file; the files of all jobs become one, run after run.
"""

from __future__ import annotations

import pathlib
import tempfile
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from ig2mj.cluster.jobs import Job, WholeRunError
from ig2mj.envs.experts import expert_of
from ig2mj.envs.registry import make
from ig2mj.envs.shared_starts import keep_pool
from ig2mj.errors import Ig2mjError
from ig2mj.files.hdf5 import Hdf5File
from ig2mj.learn.demos import DemoWriter, collect_demos
from ig2mj.process.progress import progress

EPISODES_PER_JOB = 32
"""Episodes of a job."""

FAILED = "failed"
"""Attribute of a file: episodes that failed and are left out."""


def collection_jobs(settings: Mapping[str, Any], episodes: int, seed: int) -> list[Job]:
    """Jobs of a collection. `settings`: the arguments of `collect_job` but `episodes`, `seed` and `shared`."""
    found = []
    for number, first in enumerate(range(0, episodes, EPISODES_PER_JOB)):
        own = seed if number == 0 else int(np.random.SeedSequence([seed, number]).generate_state(1)[0] >> 1)
        arguments = {**settings, "episodes": min(EPISODES_PER_JOB, episodes - first), "seed": own}
        found.append(Job(f"episodes_{first:07d}", arguments))
    return found


def collect_job(
    env: str,
    robot: str | None,
    grasping: str | None,
    engine: str,
    worlds: int,
    observations: list[str],
    split: str,
    pool_size: int | None,
    noise: float,
    disturbed: float,
    episodes: int,
    seed: int,
    shared: Mapping[str, bytes] | None = None,
) -> bytes:
    """A file of demonstrations. Arguments: of `ig2mj.make` and of `collect_demos`.

    Raises:
      Ig2mjError: nearly all episodes fail. WholeRunError: there is no such environment.
    """
    try:
        keep_pool(shared or {}, env, split, pool_size)
        starts: dict[str, Any] = {"split": split, "pool_size": pool_size}
        played = make(env, robot, worlds, engine, grasping, observations=observations, **starts)
    except Ig2mjError as e:
        raise WholeRunError(e) from e
    with tempfile.TemporaryDirectory(prefix="ig2mj-") as folder:
        file = pathlib.Path(folder) / "demos.h5"
        with DemoWriter(file, played) as writer, progress(f"the expert plays {env}") as report:
            options: dict[str, Any] = {"seed": seed, "noise": noise, "disturbed": disturbed, "progress": report}
            found = collect_demos(played, expert_of(played), writer, episodes, **options)
            writer.note(FAILED, found[FAILED])
        return file.read_bytes()


def join_demos(parts: Iterable[bytes], file: pathlib.Path) -> tuple[int, int]:
    """Writes the runs of all parts to one file; how many there are, and how many episodes failed. Raises OSError, and
    InputError: a part is broken, or takes anything from another file."""
    import h5py

    runs = failed = 0
    beside = file.with_name(f".{file.name}.part")
    with h5py.File(beside, "w") as whole, tempfile.TemporaryDirectory(prefix="ig2mj-") as folder:
        for packed in parts:
            part = pathlib.Path(folder) / "part.h5"
            part.write_bytes(packed)
            with Hdf5File(part) as opened:
                header = opened.attributes()
                try:
                    failed += int(str(header[FAILED]))
                except (KeyError, ValueError) as e:
                    raise opened.broken(f"attribute {FAILED}", "is no number") from e
                if not whole.attrs:
                    for name, value in header.items():
                        whole.attrs[name] = value
                for name in opened.names():
                    opened.copy(name, whole, f"run_{runs:06d}")
                    runs += 1
        if runs:
            whole.attrs[FAILED] = failed
    beside.replace(file)
    return runs, failed
