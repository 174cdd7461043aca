"""`sample`: many initial states of a scene that fulfil conditions, on several processes, as a pool.

Every row has a random stream of its own, which belongs to (seed, row, attempt): the rows are the same for any number of
processes. A row that cannot be sampled within its budget is tried again with another stream, and the reasons are
counted.
"""

from __future__ import annotations

import collections
import concurrent.futures
import dataclasses
import functools
import multiprocessing
import os
import time
from collections.abc import Callable, Iterator, Sequence

import jax
import numpy as np

from ig2mj.errors import EngineError
from ig2mj.predicates.logic import Expression
from ig2mj.process import use_processor_only
from ig2mj.sampling.conditions import Condition, bind, read_conditions
from ig2mj.sampling.placement import Budget, Rejections
from ig2mj.sampling.query import SceneQuery
from ig2mj.sampling.row import Row, RowSampler
from ig2mj.scene.scene import Scene, load_scene
from ig2mj.states.initial import states_of_manifest
from ig2mj.states.model import StateModel
from ig2mj.worlds.pool import Pool, stack

ROW_BUDGET = 600
"""Units of work (see `Budget`) of one attempt at a row."""

ATTEMPTS = 3
"""Attempts at a row before it is given up."""

SETTLE_SECONDS = 10.0
"""Simulated seconds within which the scene itself must come to rest before anything is sampled in it."""

Progress = Callable[[int, int], None]
"""Called with the number of rows done and of rows given up."""


@dataclasses.dataclass(frozen=True)
class Sampled:
    """What `sample` made.

    Attributes:
      pool: the rows that succeeded; None where none did. rows: their numbers. requested: how many were wanted.
      rejected: how often which reason turned a candidate down, in all attempts. seconds: wall time.
    """

    pool: Pool | None
    rows: tuple[int, ...]
    requested: int
    rejected: collections.Counter
    seconds: float

    @property
    def complete(self) -> bool:
        """Whether every requested row was made."""
        return len(self.rows) == self.requested


def sample(
    scene: Scene,
    conditions: Sequence[str | Expression],
    count: int,
    seed: int = 0,
    *,
    jobs: int = 1,
    seconds_per_row: float = float("inf"),
    progress: Progress = lambda done, failed: None,
) -> Sampled:
    """Samples rows.

    Args:
      scene: without agents: a pool describes the household alone.
      conditions: expressions or their text (see `ig2mj.sampling.conditions`); they hold together in every row.
      count: rows. seed: the same seed gives the same rows.
      jobs: processes; 0: one per processor.
      seconds_per_row: wall time after which an attempt at a row ends; it makes results depend on the machine's speed.

    Raises:
      StateError, AbilityError, UnknownNameError, ExpressionError: a condition can never be made true.
      EngineError: the scene itself does not come to rest.
    """
    began = time.monotonic()
    wanted = read_conditions(conditions)
    bind(wanted, scene.tables, np.random.default_rng(0))  # errors before any work
    rows: list[Row | None] = []
    rejected: Rejections = collections.Counter()
    numbers = range(count)
    with jax.default_device(jax.local_devices(backend="cpu")[0]):  # one world, and the same rows with and without a GPU
        for row, reasons in _run(scene, wanted, numbers, seed, jobs or os.cpu_count() or 1, seconds_per_row):
            rows.append(row)
            rejected.update(reasons)
            made = sum(r is not None for r in rows)
            progress(made, len(rows) - made)
    good = [n for n, row in zip(numbers, rows, strict=True) if row is not None]
    pools = [_as_pool(row) for row in rows if row is not None]
    return Sampled(
        pool=stack(pools) if pools else None,
        rows=tuple(good),
        requested=count,
        rejected=rejected,
        seconds=time.monotonic() - began,
    )


def _run(
    scene: Scene, wanted: Sequence[Condition], numbers: Sequence[int], seed: int, jobs: int, seconds: float
) -> Iterator[tuple[Row | None, Rejections]]:
    """Rows and reasons, in the order of their numbers."""
    if jobs == 1 or len(numbers) == 1:
        sampler = make_sampler(scene)
        for n in numbers:
            yield sample_row(sampler, wanted, seed, n, seconds)
        return
    context = multiprocessing.get_context("spawn")
    objects = tuple(a.wanted for a in scene.additions)
    with concurrent.futures.ProcessPoolExecutor(
        min(jobs, len(numbers)), context, initializer=_load, initargs=(os.fspath(scene.folder), objects)
    ) as pool:
        yield from pool.map(functools.partial(_row_here, tuple(wanted), seed, seconds), numbers)


_here: list[RowSampler] = []
"""The sampler of a worker process."""


def _load(folder: str, objects: tuple[str, ...]) -> None:
    use_processor_only()  # many processes would fill a GPU's memory
    _here.append(make_sampler(load_scene(folder, objects=objects)))


def _row_here(wanted: tuple[Condition, ...], seed: int, seconds: float, number: int) -> tuple[Row | None, Rejections]:
    return sample_row(_here[0], wanted, seed, number, seconds)


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
    sampler: RowSampler, wanted: Sequence[Condition], seed: int, number: int, seconds: float = float("inf")
) -> tuple[Row | None, Rejections]:
    """One row by its number, and the reasons why candidates were turned down."""
    rejected: Rejections = collections.Counter()
    end = time.monotonic() + seconds
    for attempt in range(ATTEMPTS):
        rng = np.random.default_rng([seed, number, attempt])
        bound = bind(wanted, sampler.model.tables, rng)
        row = sampler.sample(bound, rng, Budget(ROW_BUDGET, end - time.monotonic()), rejected)
        if row is not None:
            return row, rejected
    return None, rejected


def _as_pool(row: Row) -> Pool:
    return Pool(physics=jax.tree.map(lambda a: np.asarray(a)[None], row.physics), states=row.states)
