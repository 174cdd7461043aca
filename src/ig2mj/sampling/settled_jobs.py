"""`sample_settled`: the rows of `make_pool`, sampled by jobs: on several processes, on a cluster, with a journal.

A job is one turn of `ig2mj.sampling.settled.Disturber`. How many turns are needed shows only as they come: jobs are
run until there are enough rows; the first rows in the order of the turns are the pool.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Sequence

import jax

from ig2mj.callbacks import ProgressCallback, no_progress
from ig2mj.cluster.job_runner import Where, map_jobs
from ig2mj.cluster.jobs import Job, JobSet, WholeRunError
from ig2mj.cluster.journal import Journal, MemoryStore
from ig2mj.errors import EngineError
from ig2mj.sampling.scene_refs import check_of, lent, named, scene_named
from ig2mj.sampling.settled import Disturber, most_turns, too_few, width_of
from ig2mj.scene.scene import Scene
from ig2mj.states.model import StateModel
from ig2mj.states.world import ExtendedStates
from ig2mj.worlds.archive import pack, unpack
from ig2mj.worlds.pool import Pool, pool_of_arrays, stack, states_like


def sample_settled(
    scene: Scene,
    count: int,
    seed: int = 0,
    share: float = 0.3,
    *,
    where: Where | None = None,
    journal: Journal | None = None,
    progress: ProgressCallback = no_progress,
) -> tuple[Pool | None, dict[str, str]]:
    """Samples rows. The pool equals that of `make_pool`, wherever the jobs run.

    Args:
      scene: without agents. count, seed, share: as `make_pool` has them.
      journal: keeps finished turns, and takes turns that fail; without one they end everything.

    Returns:
      The pool, None where turns failed; and by the name of a turn, why it failed.

    Raises:
      EngineError: too few rows come to rest. ClusterError: see `ig2mj.cluster.job_runner.map_jobs`.
    """
    width, store = width_of(count), MemoryStore() if journal is None else journal
    common = {**named(scene), "seed": seed, "share": share, "width": width}
    jobs: list[Job] = []
    pools: list[Pool] = []
    made = 0
    like = states_like(scene)
    try:
        while made < count and len(jobs) < most_turns(count):
            yielded = made / len(jobs) if jobs else width  # rows a turn
            more = -(-(count - made) // max(yielded, 1.0))
            until = min(len(jobs) + int(more), most_turns(count))
            jobs += [Job(f"turn_{n:06d}", {**common, "turn": n}) for n in range(len(jobs), until)]
            title = f"settling {scene.name}"
            work = JobSet("ig2mj.sampling.settled_jobs:turn_job", title, jobs, check=check_of(scene))
            with lent(scene):
                _, failed = map_jobs(work, where or Where(), store, progress)
            if failed and journal is None:
                raise EngineError(next(iter(failed.values())))
            if failed:
                return None, failed
            pools = [pool for job in jobs for pool in _unpacked(store.get(job.name), job.name, like)]
            made = sum(pool.size for pool in pools)
    finally:
        _disturber.cache_clear()
    if made < count:
        raise too_few(scene, count, made)
    return dataclasses.replace(jax.tree.map(lambda a: a[:count], stack(pools)), digest=scene.digest), {}


def turn_job(scene: str, objects: Sequence[str], seed: int, share: float, width: int, turn: int) -> bytes:
    """The rows of one turn, packed as a pool; no arrays where there are none."""
    try:
        rows = _disturber(scene, tuple(objects), width).rows(turn, seed, share)
    except EngineError as e:
        raise WholeRunError(e) from e
    return pack(stack(rows) if rows else {}, {})


def _unpacked(packed: bytes, name: str, like: ExtendedStates | None) -> list[Pool]:
    arrays, _ = unpack(packed)
    return [pool_of_arrays(arrays, like, name)] if arrays else []


@functools.lru_cache(maxsize=1)
def _disturber(name: str, objects: tuple[str, ...], width: int) -> Disturber:
    scene = scene_named(name, objects)
    return Disturber(scene, StateModel.of_manifest(scene.tables, scene.manifest), width, threads=1)
