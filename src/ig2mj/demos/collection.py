"""Collects demonstrations: recordings of an expert's successful episodes, with its labels and observations.

The expert is the scripted one of the task, or the planner (`ig2mj.envs.planned_expert`).

A collection is divided into jobs (`ig2mj.cluster.job_runner`). Each plays some episodes from its own seed and returns a
recording; `join_recordings` makes one of them.
"""

from __future__ import annotations

import contextlib
import functools
import os
import pathlib
import tempfile
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from ig2mj.callbacks import ProgressCallback, no_progress
from ig2mj.cluster.jobs import Job, WholeRunError
from ig2mj.demos.compact import write_runs
from ig2mj.demos.environments import record
from ig2mj.demos.reader import Recording
from ig2mj.engine.view import Array
from ig2mj.envs.environment import Environment
from ig2mj.envs.experts import expert_of
from ig2mj.envs.registry import make
from ig2mj.envs.shared_starts import keep_pool
from ig2mj.errors import Ig2mjError
from ig2mj.process import entry_point
from ig2mj.process.progress import progress as show_progress

EPISODES_PER_JOB = 32
"""Episodes of a job; of the planner's, which take minutes, 1."""

DISTURBED_STEPS = 5
"""Steps of one random action that a disturbance lasts."""

HOPELESS, HOPELESS_PLANS = 50, 12
"""Failed episodes, of a scripted expert and of the planner, whose episodes take minutes, after which a success rate
below one in eleven ends a collection."""

FAILED = "failed"
"""Attribute of a file: number of failed episodes, which are left out."""


@entry_point
def collect(
    env: Environment,
    expert: Callable[[Any], Array],
    file: str | os.PathLike,
    episodes: int,
    *,
    seed: int = 0,
    noise: float = 0.0,
    disturbed: float = 0.0,
    observations: bool = True,
    progress: ProgressCallback = no_progress,
) -> dict[str, int]:
    """Plays an expert and records its successful episodes.

    On the native engine the file is compact (`ig2mj.demos.compact`), as a replay by action gives the same bytes.

    Args:
      episodes: number of successful episodes to record.
      noise: standard deviation of the noise added to the expert's actions; labels stay noise-free.
      disturbed: probability per step that a disturbance starts: one random action for `DISTURBED_STEPS` steps, from
        which the expert recovers.
      observations: record observations, so that learning needs no replay.
      progress: called after every step with successful and all episodes.

    Returns:
      Numbers of episodes: "kept" and "failed".

    Raises:
      Ig2mjError: nearly all episodes fail. InputError: the file cannot be written.
    """
    with tempfile.TemporaryDirectory(prefix="ig2mj-", dir=pathlib.Path(file).absolute().parent) as folder:
        whole = pathlib.Path(folder) / "runs.h5"
        played = record(env, whole, labels=True, observations=observations)
        try:
            failed = _play(played, expert, episodes, seed, noise, disturbed, progress)
        finally:
            if played.writer is not None:
                played.writer.close()
        with Recording(whole) as recording:
            runs = [run for run in recording.runs if run.attributes.get("success") is True][:episodes]
            compact = env.core.engine.reproducible
            about = {"noise": noise, "disturbed": disturbed, FAILED: failed}
            write_runs([(recording, runs)], file, compact, **about)
    return {"kept": len(runs), "failed": failed}


def _play(
    env: Any,
    expert: Callable[[Any], Array],
    episodes: int,
    seed: int,
    noise: float,
    disturbed: float,
    progress: ProgressCallback,
) -> int:
    """Plays until enough episodes have succeeded; the number of failed ones."""
    rng, worlds, size = np.random.default_rng(seed), env.num_worlds, env.action_space.shape[0]
    state, step = env.reset(seed), np.zeros(env.num_worlds, int)
    wild, left, kept, failed = np.zeros((worlds, size)), np.zeros(worlds, int), 0, 0
    noisy = getattr(expert, "noisy", np.ones(size, bool))
    hopeless = HOPELESS_PLANS if hasattr(expert, "given_up") else HOPELESS
    while kept < episodes:
        label = np.clip(np.asarray(expert(state)), -1, 1)
        begins = (left <= 0) & (rng.random(worlds) < disturbed)
        wild[begins], left[begins] = rng.uniform(-1, 1, (int(begins.sum()), size)), DISTURBED_STEPS
        disturbed_now = (left > 0)[:, None] & noisy
        action = np.where(disturbed_now, wild, label + noise * noisy * rng.standard_normal(label.shape))
        left, step = left - 1, step + 1
        env.label = label.astype(np.float32)
        state = env.step_autoreset(state, np.clip(action, -1, 1).astype(np.float32))
        done, success = np.asarray(state.done), np.asarray(state.info["success"])
        kept += int((done & success).sum())
        failed += int((done & ~success).sum())
        if failed >= hopeless and kept * 10 < failed:
            raise Ig2mjError(f"the expert failed in {failed} of {failed + kept} episodes")
        lost = np.asarray(getattr(expert, "given_up", done & ~done)) & ~done
        if lost.any():  # the planner has no plan left: the rest of the episode would be of no use
            failed += int(lost.sum())
            state = env.reset(state, lost)
        left[done | lost] = step[done | lost] = 0
        text = f"{min(kept, episodes)} of {episodes} successful episodes, {failed} failed, step {step.max()}"
        progress(min(kept, episodes), episodes, text)
    return failed


def collection_jobs(settings: Mapping[str, Any], episodes: int, seed: int, each: int = EPISODES_PER_JOB) -> list[Job]:
    """Jobs of a collection. `settings`: the arguments of `collect_job` but `episodes`, `seed` and `shared`. `each`:
    episodes of a job."""
    found = []
    for number, first in enumerate(range(0, episodes, each)):
        own = seed if number == 0 else int(np.random.SeedSequence([seed, number]).generate_state(1)[0] >> 1)
        arguments = {**settings, "episodes": min(each, episodes - first), "seed": own}
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
    objects: Sequence[str] = (),
    doors: str = "shut",
    horizon: int | None = None,
) -> bytes:
    """The bytes of a recording. Arguments: of `ig2mj.make` and of `collect`.

    Raises:
      Ig2mjError: nearly all episodes fail. WholeRunError: there is no such environment.
    """
    try:
        keep_pool(shared or {}, env, split, pool_size, objects)
        starts: dict[str, Any] = {"split": split, "pool_size": pool_size, "objects": tuple(objects)}
        starts |= {"doors": doors, "horizon": horizon}
        played = _environment(env, robot, worlds, engine, grasping, tuple(observations), **starts)
    except Ig2mjError as e:
        raise WholeRunError(e) from e
    with tempfile.TemporaryDirectory(prefix="ig2mj-") as folder:
        file = pathlib.Path(folder) / "demos.h5"
        with show_progress(f"the expert plays {env}") as report:
            options: dict[str, Any] = {"seed": seed, "noise": noise, "disturbed": disturbed, "progress": report}
            collect(played, expert_of(played), file, episodes, **options)
        return file.read_bytes()


@functools.lru_cache(maxsize=1)
def _environment(*arguments: Any, **options: Any) -> Environment:
    """The environment of all jobs, made once in each process. `arguments`: of `make`, observations last."""
    *common, observations = arguments
    return make(*common, observations=observations, **options)


def join_recordings(parts: Iterable[bytes], file: pathlib.Path) -> tuple[int, int]:
    """Joins the recordings of all jobs; the numbers of runs and of failed episodes.

    Raises:
      InputError: a part is broken, or the file cannot be written.
    """
    with tempfile.TemporaryDirectory(prefix="ig2mj-") as folder, contextlib.ExitStack() as stack:
        recordings = []
        for number, packed in enumerate(parts):
            part = pathlib.Path(folder) / f"{number:06d}.h5"
            part.write_bytes(packed)
            recordings.append(stack.enter_context(Recording(part)))
        failed = sum(recording.value(FAILED, int) for recording in recordings)
        write_runs([(recording, recording.runs) for recording in recordings], file, compact=False, **{FAILED: failed})
        return sum(len(recording.runs) for recording in recordings), failed
