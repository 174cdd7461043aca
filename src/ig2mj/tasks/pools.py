"""Pools of start states of tasks: shipped with the package for the paper's activities, else sampled on first use.

Training and held-out pools come from different seeds and have no row in common. A pool is of the household alone, so
that it serves every robot. A pool of fewer rows is the first rows of a larger one (`ig2mj.tasks.pool_files`).
"""

from __future__ import annotations

import collections
import concurrent.futures
import contextlib
import hashlib
import json
import pathlib
import re
import sys
from collections.abc import Callable, Generator, Iterator
from pathlib import PurePath

import jax
import numpy as np
from jaxtyping import Bool

from ig2mj.callbacks import ProgressCallback, no_progress
from ig2mj.engine.registry import make_engine
from ig2mj.errors import EngineError, InputError, UnknownNameError
from ig2mj.files.shell import command
from ig2mj.process import entry_point
from ig2mj.process.processors import available
from ig2mj.process.progress import progress as shown
from ig2mj.process.spawning import processes_for, worker_processes
from ig2mj.sampling.many import sample
from ig2mj.scene import bare_scenes
from ig2mj.scene.scene import Scene
from ig2mj.tasks.custom.code import NOTEBOOK
from ig2mj.tasks.custom.code import shown as shown_file
from ig2mj.tasks.custom.start import start_rows
from ig2mj.tasks.pool_files import StartStates
from ig2mj.tasks.task import Task
from ig2mj.worlds.pool import Pool

VERSION = 3
"""Of the rules by which pools of tasks are made. Raise it when the sampler's results change."""

SEEDS = {"train": 1_000_003, "held_out": 2_000_003}
"""First seed of each split; further ones follow where rows are turned down."""

COUNT = {"train": 512, "held_out": 1000}
"""Rows unless another number is asked for."""

CHUNK = 32
"""Rows that are sampled from one seed, at least."""

HOPELESS = 8 * CHUNK
"""Candidates of which none is good, after which no more are tried."""

MAX_CHUNKS = 400
"""Seeds after which too many rows were turned down, of pools of the usual sizes; of larger ones `limit_of`."""

FLAT = 0.98
"""Cosine of the angle between an object's z axis and the vertical from which it lies flat: 11 degrees."""


def bare_scene(task: Task) -> Scene:
    """The task's household without a robot."""
    return bare_scenes.bare_scene(task.home, task.objects)


@entry_point
def pool_of(
    task: Task,
    split: str = "train",
    count: int | None = None,
    *,
    jobs: int | None = None,
    progress: ProgressCallback = no_progress,
    workers: concurrent.futures.Executor | None = None,
) -> Pool:
    """The pool, read from the cache or made now.

    Args:
      split: "train" or "held_out". count: rows; None: `COUNT`.
      jobs: processes; 0: one per processor; None: in a command of ig2mj as many as the rows are worth, else 1. More
        than one needs a script that may be imported (the guard `if __name__ == "__main__"`).
      workers: processes that several pools share (`sampling_processes`), instead.

    Raises:
      UnknownNameError: no such split. EngineError: its start states cannot be sampled.
    """
    return _pool(start_states(task, split), task, split, count, jobs, progress, workers)


def _hint(task: Task, split: str, count: int | None) -> str:
    """The command that samples the same pool on all processors; '' where there is none, as of a task of the user's."""
    from ig2mj.tasks.activities import ACTIVITIES
    from ig2mj.tasks.variants import variant, variants

    if task.code is not None and task.code.file != NOTEBOOK:
        options = [*(["--split", split] if split != "train" else []), *(["--count", str(count)] if count else [])]
        words = " ".join(["ig2mj sample-task", f"{shown_file(task.code.file)}:{task.name}", *options])
        return f" (on all processors: {words})"
    if task.name not in ACTIVITIES:
        return ""
    usual = ACTIVITIES[task.name]
    for number in range(variants(usual)):
        for mode in ("mitten", "physical"):
            other = variant(usual, number, mode)
            if other.home == task.home and _made_of(other) == _made_of(task):
                options = [
                    *(["--split", split] if split != "train" else []),
                    *(["--count", str(count)] if count else []),
                    *(["--variant", str(number)] if number else []),
                    *(["--grasping", mode] if mode != "mitten" else []),
                ]
                return f" (on all processors: {' '.join(['ig2mj sample-task', task.name, *options])})"
    return ""


def _made_of(task: Task) -> list[object]:
    """What of a task a pool depends on."""
    near = [[n.object, *n.pos, n.least, n.most] for n in task.near]
    upright = [task.upright] if task.upright else []
    code = task.code
    own = [] if code is None or code.start is None else [["start", code.digest]]
    return [task.objects, task.start, near, task.flat, *upright, *own]


def starts_digest(task: Task) -> str:
    """Hash of what determines the start states of a task in the household that it names."""
    objects = [PurePath(name).name if PurePath(name).is_absolute() else name for name in task.objects]
    text = json.dumps([VERSION, objects, *_made_of(task)[1:]], default=str)
    return hashlib.blake2b(text.encode(), digest_size=8).hexdigest()


def check_pool(task: Task, pool: Pool) -> None:
    """Raises InputError: the pool is of another version of a task in a user's code."""
    if task.code is not None and pool.starts is not None and pool.starts != starts_digest(task):
        problem = "what determines the start states has changed since the pool was made"
        fix = f"{command('sample-task', f'{shown_file(task.code.file)}:{task.name}')} makes another"
        raise InputError(shown_file(task.code.file), problem, element=task.name, fix=fix)


def start_states(task: Task, split: str = "train", scene: Scene | None = None) -> StartStates:
    """Where the pool's rows are kept, and what they are made of. Raises UnknownNameError: no such split."""
    if split not in SEEDS:
        raise UnknownNameError("split", split, SEEDS)
    own = {} if task.code is None else {**task.code.in_files, "starts": starts_digest(task)}
    return StartStates(
        f"{_file_name(task.name)}-{split}",
        bare_scene(task) if scene is None else scene,
        lambda digest: [VERSION, digest, *_made_of(task)],
        {"task": task.name, "split": split, "conditions": list(task.start), **own},
    )


def _file_name(task: str) -> str:
    """A task's name as part of a file's; of "goal/HOME GOAL" without the goal, on which no start state depends."""
    home, _, goal = task.partition(" (")
    return re.sub(r"[^\w.-]", "_", home)[-60:] if goal else task


@entry_point
def make_pool(
    task: Task,
    split: str = "train",
    count: int | None = None,
    *,
    file: pathlib.Path,
    jobs: int | None = None,
    progress: ProgressCallback = no_progress,
    workers: concurrent.futures.Executor | None = None,
) -> Pool:
    """As `pool_of`, but in this file alone: what ships or is in the cache is not read."""
    return _pool(start_states(task, split), task, split, count, jobs, progress, workers, file)


def _pool(
    states: StartStates,
    task: Task,
    split: str,
    count: int | None,
    jobs: int | None,
    progress: ProgressCallback,
    workers: concurrent.futures.Executor | None,
    file: pathlib.Path | None = None,
) -> Pool:
    requested = count or COUNT[split]

    def sample_rows(tried: int, rows: int) -> Iterator[tuple[int, Pool | None]]:
        # A process that starts takes as long as some fifty rows.
        processes = processes_for(rows // (2 * CHUNK)) if jobs is None else jobs or available()
        hint = _hint(task, split, count) if processes == 1 else ""
        print(f"sampling {rows} start states of {task.name}, once{hint}", file=sys.stderr)
        made, first, limit = 0, tried, CHUNK * limit_of(requested)
        with contextlib.ExitStack() as stack_of:
            shared = workers
            if shared is None and processes > 1:
                shared = stack_of.enter_context(sampling_processes(processes))
            batches = _batches(task, split, states.scene, shared, tried, limit, lambda: rows - made)
            report = stack_of.enter_context(shown(f"sampling start states of {task.name}"))
            report(0, rows, f"0 of {rows}")
            for tried, drawn in stack_of.enter_context(contextlib.closing(batches)):
                made += 0 if drawn is None else drawn.size
                report(min(made, rows), rows, f"{min(made, rows)} of {rows}")
                progress(requested - rows + min(made, rows), requested)
                yield tried, drawn
                if made >= rows or (tried - first >= HOPELESS and not made):
                    break
        if made < rows:
            raise EngineError(
                f"{task.name}: {tried - first} tries gave only {made} of {rows} start states within reach"
            )

    return states.pool(requested, sample_rows, file)


def sampling_processes(jobs: int) -> concurrent.futures.Executor:
    """Processes that sample parts of pools; 0: one per processor. Close it, or use it in a `with`."""
    return worker_processes(jobs or available(), ctrl_c=True)


def limit_of(requested: int) -> int:
    """Seeds after which too many rows were turned down: `MAX_CHUNKS`, or where less than one row in eight is good."""
    return max(MAX_CHUNKS, 8 * -(-requested // CHUNK))


def _batches(
    task: Task,
    split: str,
    scene: Scene,
    workers: concurrent.futures.Executor | None,
    tried: int,
    limit: int,
    missing: Callable[[], int],
) -> Generator[tuple[int, Pool | None], None, None]:
    """Candidates after `tried` of them in order, up to `limit`: how many were tried by then, and the good ones.

    Candidate n is row n % CHUNK of seed n // CHUNK, so that batches of any size hold the same rows.
    """
    if workers is None:
        while tried < limit:
            size = max(1, min(CHUNK - tried % CHUNK, missing()))
            drawn = _batch(task, scene, SEEDS[split] + tried // CHUNK, tried % CHUNK, size)
            tried += size
            yield tried, drawn
        return
    ahead = collections.deque[tuple[int, concurrent.futures.Future[Pool | None]]]()
    submitted, most = tried, 2 * -(-missing() // CHUNK)  # begun before they are known to be needed
    try:
        while submitted < limit or ahead:
            while submitted < limit and len(ahead) < most:
                size = CHUNK - submitted % CHUNK
                where = SEEDS[split] + submitted // CHUNK, submitted % CHUNK
                submitted += size
                ahead.append((submitted, workers.submit(_batch, task, None, *where, size)))
            tried, batch = ahead.popleft()
            yield tried, batch.result()
    finally:
        for _, batch in ahead:
            batch.cancel()


def _batch(task: Task, scene: Scene | None, seed: int, first: int, count: int) -> Pool | None:
    """Of these rows of a seed those in which every object is where the task wants it."""
    scene = bare_scene(task) if scene is None else scene
    if task.code is not None and task.code.start is not None:
        drawn = start_rows(task.code, scene, seed, first, count)
    else:
        drawn = sample(scene, task.start, count, seed, first=first).pool
    if drawn is None:
        return None
    good = np.flatnonzero(_near(task, scene, drawn))
    return drawn.rows(good) if len(good) else None


def _near(task: Task, scene: Scene, pool: Pool) -> Bool[np.ndarray, "P"]:
    """Rows in which every object is where the task wants it."""
    engine = make_engine("native", scene, 1)
    physics, good = engine.reset(), np.ones(pool.size, bool)
    for row in range(pool.size):
        snapshot = jax.tree.map(lambda a, r=row: np.asarray(np.asarray(a)[r]), pool.physics)
        physics = engine.load(physics, snapshot)
        view = engine.view(physics)
        com, quat = np.asarray(view.object_com)[0], np.asarray(view.object_quat)[0]
        for near in task.near:
            distance = np.linalg.norm(com[scene.object_index(near.object)] - near.pos)
            good[row] &= near.least <= distance <= near.most
        for name in (*task.flat, *task.upright):
            _, x, y, _ = quat[scene.object_index(name)]
            up = 1.0 - 2.0 * (x * x + y * y)
            good[row] &= (abs(up) if name in task.flat else up) >= FLAT
    return good
