"""`sample`: many initial states of a scene that fulfil conditions, on several processes, as a pool.

Every row has a random stream of its own, which belongs to (seed, row, attempt), and is a job of its own
(`ig2mj.cluster.job_runner`): the rows are the same for any number of processes, and on a cluster. A row that cannot be
sampled within its budget is tried again with another stream, and the reasons are counted.
"""

from __future__ import annotations

import collections
import dataclasses
import functools
import math
import time
from collections.abc import Mapping, Sequence

import jax
import numpy as np

from ig2mj.callbacks import ProgressCallback, no_progress
from ig2mj.cluster.job_runner import Where, map_jobs
from ig2mj.cluster.jobs import Job, JobSet, WholeRunError
from ig2mj.cluster.journal import Journal
from ig2mj.errors import EngineError
from ig2mj.predicates.logic import Expression
from ig2mj.process import entry_point
from ig2mj.sampling.budget import Budget
from ig2mj.sampling.conditions import Condition, bind, read_conditions
from ig2mj.sampling.placement import Rejections
from ig2mj.sampling.query import SceneQuery
from ig2mj.sampling.row import Row, RowSampler
from ig2mj.sampling.scene_refs import check_of, lent, named, scene_named
from ig2mj.scene.scene import Scene
from ig2mj.states.initial import states_of_manifest
from ig2mj.states.model import StateModel
from ig2mj.worlds.archive import pack, unpack
from ig2mj.worlds.pool import Pool, pool_of_arrays, stack, states_like

ROW_BUDGET = 600
"""Units of work (see `Budget`) of one attempt at a row."""

ATTEMPTS = 3
"""Attempts at a row before it is given up."""

SETTLE_SECONDS = 10.0
"""Simulated seconds within which the scene itself must come to rest before anything is sampled in it."""


@dataclasses.dataclass(frozen=True)
class Sampled:
    """Result of `sample`.

    Attributes:
      pool: the rows that succeeded; None where none did. rows: their numbers. requested: their requested number.
      rejected: number of rejected candidates by reason, in all attempts. seconds: wall time.
      failed: by the number of a row, why it could not even be tried (only where a journal was given).
    """

    pool: Pool | None
    rows: tuple[int, ...]
    requested: int
    rejected: collections.Counter
    seconds: float
    failed: dict[str, str] = dataclasses.field(default_factory=dict)

    @property
    def complete(self) -> bool:
        """Whether every requested row was made."""
        return len(self.rows) == self.requested


@entry_point
def sample(
    scene: Scene,
    conditions: Sequence[str | Expression],
    count: int,
    seed: int = 0,
    *,
    first: int = 0,
    jobs: int = 1,
    seconds_per_row: float = math.inf,
    progress: ProgressCallback = no_progress,
    where: Where | None = None,
    journal: Journal | None = None,
) -> Sampled:
    """Samples rows.

    Args:
      scene: without agents: a pool describes the household alone.
      conditions: expressions or their text (see `ig2mj.sampling.conditions`); they hold together in every row.
      count: rows. seed: the same seed gives the same rows. first: number of the first row.
      jobs: processes; 0: one per processor. where: more of that, such as a cluster; it takes the place of `jobs`.
      seconds_per_row: wall time after which an attempt at a row ends; it makes results depend on the machine's speed.
      journal: keeps finished rows, and takes rows that fail; without one they end everything.

    Raises:
      StateError, AbilityError, UnknownNameError, ExpressionError: a condition can never be made true.
      EngineError: the scene itself does not come to rest. ClusterError: see `ig2mj.cluster.job_runner.map_jobs`.
    """
    asked = read_conditions(conditions)
    bind(asked, scene.tables, np.random.default_rng(0))  # errors before any work

    work = row_jobs(scene, asked, range(first, first + count), seed, seconds_per_row)
    return sampled_rows(scene, work, first, where or Where(jobs), journal, progress)


def sampled_rows(
    scene: Scene,
    work: JobSet[list[Job]],
    first: int,
    where: Where,
    journal: Journal | None = None,
    progress: ProgressCallback = no_progress,
) -> Sampled:
    """Runs jobs that each make one row, as `packed_row` gives it, and puts the rows together.

    Args:
      work: one job for each row. first: number of the first one's row. The others: as of `sample`.

    Raises:
      EngineError: a job failed, and there is no journal. ClusterError: see `ig2mj.cluster.job_runner.map_jobs`.
    """
    began = time.monotonic()
    try:
        with lent(scene):
            store, failed = map_jobs(work, where, journal, progress)
    finally:
        _sampler.cache_clear()
    if failed and journal is None:
        raise EngineError(next(iter(failed.values())))
    numbers, pools, rejected = [], [], collections.Counter()
    like = states_like(scene)
    for number, job in enumerate(work.jobs, first):
        if job.name in failed:
            continue
        arrays, header = unpack(store.get(job.name))
        rejected.update(header["rejected"])
        if arrays:
            numbers.append(number)
            pools.append(pool_of_arrays(arrays, like, job.name))
    return Sampled(
        pool=dataclasses.replace(stack(pools), digest=scene.digest) if pools else None,
        rows=tuple(numbers),
        requested=len(work.jobs),
        rejected=rejected,
        seconds=time.monotonic() - began,
        failed=failed,
    )


def packed_row(row: Row | None, rejected: Mapping[str, int]) -> bytes:
    """What a job returns: a row with the reasons why candidates were turned down; no arrays where there is no row."""
    return pack({} if row is None else _as_pool(row), {"rejected": dict(rejected)})


def row_jobs(
    scene: Scene, asked: Sequence[Condition], numbers: Sequence[int], seed: int, seconds: float = math.inf
) -> JobSet:
    """Jobs that sample one row each."""
    common = {
        **named(scene),
        "conditions": [[c.predicate, list(c.arguments), c.value] for c in asked],
        "seed": seed,
        "seconds": None if math.isinf(seconds) else seconds,
    }
    return JobSet(
        "ig2mj.sampling.many:row_job",
        f"sampling in {scene.name}",
        [Job(f"row_{n:06d}", {**common, "number": n}) for n in numbers],
        check=check_of(scene),
    )


@entry_point
def row_job(
    scene: str, objects: Sequence[str], conditions: Sequence[Sequence], seed: int, seconds: float | None, number: int
) -> bytes:
    """One row, packed, with the reasons why candidates were turned down; no arrays where it was given up."""
    asked = [Condition(predicate, tuple(arguments), value) for predicate, arguments, value in conditions]
    with jax.default_device(jax.local_devices(backend="cpu")[0]):  # one world, and the same rows with and without a GPU
        try:
            sampler = _sampler(scene, tuple(objects))
        except EngineError as e:
            raise WholeRunError(e) from e
        row, rejected = sample_row(sampler, asked, seed, number, math.inf if seconds is None else seconds)
    return packed_row(row, rejected)


@functools.lru_cache(maxsize=1)
def _sampler(name: str, objects: tuple[str, ...]) -> RowSampler:
    return make_sampler(scene_named(name, objects))


def make_sampler(scene: Scene) -> RowSampler:
    """A sampler whose rows begin with the scene at rest. Raises EngineError where it does not come to rest."""
    query = SceneQuery(scene)
    if not query.settle(SETTLE_SECONDS):
        raise EngineError(
            f"'{scene.name}' does not come to rest within {SETTLE_SECONDS:g} s (convert it with its checks)"
        )
    model = StateModel.of_manifest(scene.tables, scene.manifest)
    bodies = {scene.model.body(b).name: b for b in range(scene.model.nbody)}
    return RowSampler(query, model, states_of_manifest(model, scene.manifest, bodies))


def sample_row(
    sampler: RowSampler, asked: Sequence[Condition], seed: int, number: int, seconds: float = float("inf")
) -> tuple[Row | None, Rejections]:
    """One row by its number, and the reasons why candidates were turned down."""
    rejected: Rejections = collections.Counter()
    end = time.monotonic() + seconds
    for attempt in range(ATTEMPTS):
        rng = np.random.default_rng([seed, number, attempt])
        bound = bind(asked, sampler.model.tables, rng)
        row = sampler.sample(bound, rng, Budget(ROW_BUDGET, end - time.monotonic()), rejected)
        if row is not None:
            return row, rejected
    return None, rejected


def _as_pool(row: Row) -> Pool:
    return Pool(physics=jax.tree.map(lambda a: np.asarray(a)[None], row.physics), states=row.states)
