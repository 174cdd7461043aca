"""Pools of start states of tasks: sampled on first use from fixed seeds, and kept in the user's cache.

Training and held-out pools come from different seeds and have no row in common. A pool is of the household alone, so
that it serves every robot. What it is made of is part of its file's name: a pool of another scene, object library,
condition or version of the sampler's rules is another file.
"""

from __future__ import annotations

import collections
import concurrent.futures
import contextlib
import hashlib
import json
import multiprocessing
import os
import pathlib
import sys
import threading
from collections.abc import Callable, Generator

import jax
import numpy as np
from jaxtyping import Bool

from ig2mj.engine.registry import make_engine
from ig2mj.errors import EngineError, UnknownNameError
from ig2mj.files.unfinished import unfinished
from ig2mj.process import use_processor_only
from ig2mj.process.compilation import cache_folder
from ig2mj.sampling.many import sample
from ig2mj.scene.scene import Scene, load_scene
from ig2mj.tasks.task import Task
from ig2mj.worlds.pool import Pool, load_pool, save_pool, stack

VERSION = 3
"""Of the rules by which pools of tasks are made. Raise it when the sampler's results change."""

SEEDS = {"train": 1_000_003, "held_out": 2_000_003}
"""First seed of each split; further ones follow where rows are turned down."""

COUNT = {"train": 512, "held_out": 1000}
"""Rows unless another number is asked for."""

CHUNK = 32
"""Rows that are sampled from one seed, at least."""

MAX_CHUNKS = 400
"""Seeds after which too many rows were turned down, of pools of the usual sizes; of larger ones `limit_of`."""

FLAT = 0.98
"""Cosine of the angle between an object's z axis and the vertical from which it lies flat: 11 degrees."""

HASHES = pathlib.Path(__file__).with_name("pool_hashes.json")
"""Of the activities' pools of the usual sizes, by the names of their files. `ig2mj sample-task all` checks them."""

Progress = Callable[[int, int], None]
"""Called with the number of rows made and wanted."""


_loading = threading.Lock()
"""Pools may be made in threads (`ig2mj sample-task all`); MuJoCo does not promise that two may parse XML at a time."""


def bare_scene(task: Task) -> Scene:
    """The task's household without a robot."""
    with _loading:
        return load_scene(task.home, objects=task.objects)


def pool_of(
    task: Task,
    split: str = "train",
    count: int | None = None,
    *,
    jobs: int = 1,
    progress: Progress = lambda made, wanted: None,
    workers: concurrent.futures.Executor | None = None,
) -> Pool:
    """The pool, read from the cache or made now.

    Args:
      split: "train" or "held_out". count: rows; None: `COUNT`.
      jobs: processes; 0: one per processor. More than one needs a script that may be imported (the guard
        `if __name__ == "__main__"`). workers: processes that several pools share (`sampling_processes`), instead.

    Raises:
      UnknownNameError: no such split. EngineError: its start states cannot be sampled.
    """
    scene = bare_scene(task)
    file = pool_file(task, scene, split, count)
    if file.exists():
        return load_pool(file, scene)
    print(
        f"sampling {count or COUNT[split]} start states of {task.name}, once (on all processors: ig2mj sample-task "
        f"{task.name})",
        file=sys.stderr,
    )
    pool = make_pool(task, split, count, scene=scene, jobs=jobs, progress=progress, workers=workers)
    file.parent.mkdir(parents=True, exist_ok=True)
    beside = unfinished(file)
    save_pool(pool, beside, scene, {"task": task.name, "split": split, "conditions": list(task.start)})
    beside.replace(file)  # never half a file, even if two processes make it
    return pool


def pool_file(task: Task, scene: Scene, split: str = "train", count: int | None = None) -> pathlib.Path:
    """Where the pool is kept. Raises UnknownNameError."""
    if split not in SEEDS:
        raise UnknownNameError("split", split, SEEDS)
    near = [[n.object, *n.pos, n.least, n.most] for n in task.near]
    upright = [task.upright] if task.upright else []

    def made_of(digest: str) -> list[object]:
        return [VERSION, digest, task.objects, task.start, near, task.flat, *upright]

    return cached_file(f"{task.name}-{split}-{count or COUNT[split]}", scene, made_of)


def cached_file(name: str, scene: Scene, made_of: Callable[[str], list[object]]) -> pathlib.Path:
    """The file of a pool in the cache; one that is bound to every byte of the scene's files is used where it is there.

    Args:
      made_of: what determines the pool, from a digest of the scene.
    """
    found = []
    for digest in (scene.digest, scene.files_digest):
        mark = hashlib.blake2b(json.dumps(made_of(digest), default=str).encode(), digest_size=6).hexdigest()
        found.append(cache_folder() / "pools" / f"{name}-{mark}.npz")
    return found[1] if found[1].exists() and not found[0].exists() else found[0]


def pool_hash(file: pathlib.Path) -> str:
    """sha256 of a pool's file."""
    return hashlib.sha256(file.read_bytes()).hexdigest()


def known_hash(file: pathlib.Path) -> str | None:
    """sha256 of a pool of the usual size as it was first made, by the name of its file; None for any other."""
    return json.loads(HASHES.read_text()).get(file.name)


def make_pool(
    task: Task,
    split: str = "train",
    count: int | None = None,
    *,
    scene: Scene | None = None,
    jobs: int = 1,
    progress: Progress = lambda made, wanted: None,
    workers: concurrent.futures.Executor | None = None,
) -> Pool:
    """Samples the pool anew: the same rows for any number of processes. Arguments and errors as `pool_of`."""
    if split not in SEEDS:
        raise UnknownNameError("split", split, SEEDS)
    scene = bare_scene(task) if scene is None else scene
    wanted, made, pools, tried = count or COUNT[split], 0, [], 0
    processes = jobs or os.cpu_count() or 1
    with contextlib.ExitStack() as stack_of:
        if workers is None and processes > 1:
            workers = stack_of.enter_context(sampling_processes(processes))
        for drawn in stack_of.enter_context(contextlib.closing(_chunks(task, split, scene, workers, wanted))):
            tried += 1
            if drawn is not None:
                pools.append(drawn)
                made += drawn.size
            progress(min(made, wanted), wanted)
            if made >= wanted:
                return stack(pools).rows(np.arange(wanted))
            if tried == 8 and not made:
                break
    raise EngineError(f"{task.name}: of {tried * CHUNK} start states only {made} of {wanted} have all within reach")


def sampling_processes(jobs: int) -> concurrent.futures.Executor:
    """Processes that sample parts of pools; 0: one per processor. Close it, or use it in a `with`."""
    context = multiprocessing.get_context("spawn")  # forking a process that has threads can hang
    return concurrent.futures.ProcessPoolExecutor(jobs or os.cpu_count(), context, initializer=use_processor_only)


def limit_of(wanted: int) -> int:
    """Seeds after which too many rows were turned down: `MAX_CHUNKS`, or where less than one row in eight is good."""
    return max(MAX_CHUNKS, 8 * -(-wanted // CHUNK))


def _chunks(
    task: Task, split: str, scene: Scene, workers: concurrent.futures.Executor | None, wanted: int
) -> Generator[Pool | None, None, None]:
    """The good rows of one seed after the other, in order; None: there was none."""
    limit = limit_of(wanted)
    if workers is None:
        for k in range(limit):
            yield _chunk(task, scene, SEEDS[split] + k)
        return
    ahead = collections.deque[concurrent.futures.Future[Pool | None]]()
    submitted, most = 0, 2 * -(-wanted // CHUNK)  # begun before they are known to be needed
    try:
        while submitted < limit or ahead:
            while submitted < limit and len(ahead) < most:
                ahead.append(workers.submit(_chunk, task, None, SEEDS[split] + submitted))
                submitted += 1
            yield ahead.popleft().result()
    finally:
        for future in ahead:
            future.cancel()


def _chunk(task: Task, scene: Scene | None, seed: int) -> Pool | None:
    """Of `CHUNK` rows of a seed those in which every object is where the task wants it."""
    scene = bare_scene(task) if scene is None else scene
    drawn = sample(scene, task.start, CHUNK, seed).pool
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
