"""Goal states of a bound activity, sampled: a start state in which everything that the goal asks for has been done.

A goal has many ground readings (`ig2mj.predicates.readings`): which dish a tomato is in, which two of three shoes are
under the table. Each attempt takes one and makes its literals true in the start state, with what holds already left
as it is. The first attempt takes one that changes little, later ones any.
"""

from __future__ import annotations

import collections
import dataclasses
import functools
import itertools
import math
import time
from collections.abc import Mapping, Sequence

import jax
import numpy as np

from ig2mj.callbacks import ProgressCallback, no_progress
from ig2mj.cluster.job_runner import Where
from ig2mj.cluster.jobs import Job, JobSet, WholeRunError
from ig2mj.cluster.journal import Journal
from ig2mj.errors import EngineError, StateError
from ig2mj.predicates.cheapest import cheapest
from ig2mj.predicates.logic import Atom, Expression
from ig2mj.predicates.readings import Reading, readings
from ig2mj.predicates.registry import OF_SUBSTANCES
from ig2mj.process import entry_point
from ig2mj.sampling.budget import Budget
from ig2mj.sampling.conditions import MUTUAL, Condition
from ig2mj.sampling.many import Sampled, make_sampler, packed_row, sample_row, sampled_rows
from ig2mj.sampling.placement import Rejections
from ig2mj.sampling.row import Row, RowSampler
from ig2mj.sampling.scene_refs import check_of, named, scene_named
from ig2mj.scene.manifest import load_manifest
from ig2mj.scene.paths import scene_folder
from ig2mj.scene.scene import Scene
from ig2mj.states.model import StateModel
from ig2mj.tasks.bddl.binding import Binding, bind
from ig2mj.tasks.bddl.definitions import load_activity
from ig2mj.tasks.bddl.goal import conditions
from ig2mj.tasks.bddl.start import start_conditions, world_of

ATTEMPTS = 12
"""Attempts at a goal state before it is given up."""

ATTEMPT_BUDGET = 400
"""Units of work (see `ig2mj.sampling.budget.Budget`) of one attempt."""

STREAM = 1
"""Of random numbers, next to that of starts."""

LOOKED_AT = 20_000
"""Literals that are looked at for a reading in which each object is in one place."""

ELSEWHERE = ("inside", "on_top", "on_floor")
"""Predicates of which an object fulfils one at a time, and of one second argument."""


def sample_goals(
    binding: Binding,
    scene: Scene,
    count: int,
    seed: int = 0,
    *,
    name: str | None = None,
    first: int = 0,
    jobs: int = 1,
    seconds: float = math.inf,
    progress: ProgressCallback = no_progress,
    where: Where | None = None,
    journal: Journal | None = None,
) -> Sampled:
    """Samples goal states: row n is reached from row n of `ig2mj.tasks.bddl.start.sample_start` with the same seed.

    Args:
      scene: as `ig2mj.tasks.bddl.start.load_bound` gives it. count, first, jobs, where, journal, progress: as of
        `ig2mj.sampling.many.sample`.
      name: what `load_activity` finds the activity by, where that is not its name but a file; every machine of a
        cluster must have it.
      seconds: processor time for each goal state; it makes results depend on the machine's speed.

    Raises:
      StateError: no reading of the goal can be made true. EngineError: the scene does not come to rest.
      ClusterError: see `ig2mj.cluster.job_runner.map_jobs`.
    """
    activity = binding.activity
    common = {
        **named(scene),
        "activity": name or activity.name,
        "behavior1k": activity.behavior_1k,
        "seed": seed,
        "seconds": None if math.isinf(seconds) else seconds,
    }
    work = JobSet(
        "ig2mj.tasks.bddl.goal_states:goal_job",
        f"sampling goals of {activity.name} in {scene.name}",
        [Job(f"row_{n:06d}", {**common, "number": n}) for n in range(first, first + count)],
        check=check_of(scene),
    )
    try:
        return sampled_rows(scene, work, first, where or Where(jobs), journal, progress)
    finally:
        _sampler.cache_clear()


@entry_point
def goal_job(
    scene: str,
    objects: Sequence[str],
    activity: str,
    behavior1k: bool,
    seed: int,
    seconds: float | None,
    number: int,
) -> bytes:
    """One goal state, packed (`ig2mj.sampling.many.packed_row`); no arrays where none was found."""
    with jax.default_device(jax.local_devices(backend="cpu")[0]):  # one world, and the same rows with and without a GPU
        try:
            sampler = _sampler(scene, tuple(objects), activity, behavior1k)
        except (EngineError, StateError) as e:
            raise WholeRunError(e) from e
        start, rejected = sampler.start(seed, number)
        if start is None:
            return packed_row(None, {f"start: {reason}": n for reason, n in rejected.items()})
        found = sampler.goal(start, seed, number, math.inf if seconds is None else seconds)
    return packed_row(found.row, found.rejected)


@functools.lru_cache(maxsize=1)
def _sampler(scene: str, objects: tuple[str, ...], activity: str, behavior1k: bool) -> GoalSampler:
    loaded = scene_named(scene, objects)
    binding = bind(load_activity(activity, behavior1k), load_manifest(scene_folder(scene)))
    return GoalSampler(binding, loaded)


@dataclasses.dataclass(frozen=True)
class GoalState:
    """Result of the search for a goal state from one start.

    Attributes:
      row: the goal state; None: not found. rejected: why candidates were turned down. attempts: how many were made.
      reading: conditions of the last one tried.
    """

    row: Row | None
    rejected: Rejections
    attempts: int
    reading: tuple[Condition, ...]


class GoalSampler:
    """Samples goal states of one bound activity in a sampler's world."""

    def __init__(self, binding: Binding, scene: Scene, sampler: RowSampler | None = None):
        """Binds a scene. Raises EngineError: it does not come to rest; StateError, AbilityError: see `RowSampler`."""
        self.binding, self.sampler = binding, sampler or make_sampler(scene)
        self._scene_start = self.sampler.start
        self._start = start_conditions(binding, scene)
        self._goal = conditions(binding).compile_goal(self.model)

    @property
    def model(self) -> StateModel:
        """Of the scene."""
        return self.sampler.model

    def compile(self) -> None:
        """Compiles the predicates of start and goal; else the first start and the first goal do."""
        world = world_of(self.sampler.query, self._scene_start[1])
        self._goal.literals_of(world)
        self.sampler.holds(self._start, self._scene_start[1])

    def start(self, seed: int, number: int) -> tuple[Row | None, Rejections]:
        """A start state by its number, as `ig2mj.tasks.bddl.start.sample_start` gives it."""
        self.sampler.start_from(*self._scene_start)
        return sample_row(self.sampler, self._start, seed, number)

    def goal(self, start: Row, seed: int, number: int, seconds: float = float("inf")) -> GoalState:
        """A goal state that is reached from a start state, which the world need not be in.

        Args:
          seed, number: of the random stream. seconds: processor time after which no attempt begins; it makes results
            depend on the machine's speed.
        """
        sampler = self.sampler
        rejected: Rejections = collections.Counter()
        sampler.query.load(start.physics)
        sampler.start_from(start.physics, start.states)
        truth = self._truth(start)
        end = time.process_time() + seconds
        reading: tuple[Condition, ...] = ()
        attempt = 0
        for attempt in range(1, ATTEMPTS + 1):
            rng = np.random.default_rng([seed, number, attempt, STREAM])
            left = end - time.process_time()
            if left <= 0:
                break
            literals = self.reading(truth, rng, few_changes=attempt == 1)
            if literals is None:
                rejected["no reading of the goal is possible"] += 1
                break
            reading = self._conditions(literals)
            requested, again = reading, ()
            if attempt % 2 == 0:
                requested, again = self._with_help(reading)
            budget = Budget(ATTEMPT_BUDGET, left, time.process_time)
            row = sampler.sample(requested, rng, budget, rejected, keep=True, again=again)
            if row is not None and self._goal(world_of(sampler.query, row.states))[0]:
                return GoalState(row, rejected, attempt, reading)
            if row is not None:
                rejected["goal false although its reading holds"] += 1
        return GoalState(None, rejected, attempt, reading)

    def reading(self, truth: Mapping[Atom, bool], rng: np.random.Generator, few_changes: bool) -> Reading | None:
        """A reading of the goal at random, each object in one place if there is such a reading; None: there is none.

        Args:
          truth: of the goal's atoms in the start. few_changes: alternatives that change least come first.
        """
        return choose_reading(self._goal.ground, truth, rng, few_changes, self._fixed)

    def _with_help(self, reading: tuple[Condition, ...]) -> tuple[tuple[Condition, ...], tuple[str, ...]]:
        """A reading with what makes it easier: containers stand open, and loose supports are put down flat.

        Returns:
          Conditions, and objects that must be placed again.
        """
        self.sampler.query.load(self.sampler.start[0])
        tables = self.model.tables
        openable = {tables.object_names[o] for o in tables.openable_object}
        said = {c.arguments[0] for c in reading if c.predicate == "open"}
        placed = {c.arguments[0] for c in reading if c.is_placement and c.value}
        needed = [
            c for c in reading if c.value and c.is_placement and not self.sampler.holds((c,), self.sampler.start[1])
        ]
        inside = {c.arguments[1] for c in needed if c.predicate == "inside"} & openable - said
        found = [Condition("open", (name,)) for name in sorted(inside)]
        bearing = {c.arguments[1] for c in needed if c.predicate == "on_top"} - self._fixed - placed
        where = [c for c in self._start if c.is_placement and c.value and c.arguments[0] in bearing]
        return (*reading, *found, *where), tuple({c.arguments[0]: None for c in where})

    @property
    def _fixed(self) -> frozenset[str]:
        tables = self.model.tables
        return frozenset(n for n, fixed in zip(tables.object_names, tables.object_fixed, strict=True) if fixed)

    def _truth(self, row: Row) -> dict[Atom, bool]:
        world = world_of(self.sampler.query, row.states)
        return dict(zip(self._goal.atoms, np.asarray(self._goal.literals_of(world))[0].tolist(), strict=True))

    def _conditions(self, literals: Reading) -> tuple[Condition, ...]:
        """Literals as conditions; where a whole is to be cut, those about its place are of its halves."""
        index = {name: n for n, name in enumerate(self.model.tables.object_names)}
        names = self.model.tables.object_names
        cut = {a.arguments[0] for a, value in literals.items() if a.predicate == "sliced" and value}

        def parts(name: str) -> tuple[str, ...]:
            halves = self.model.parameters.halves_of(index[name]) if name in cut else ()
            return tuple(names[h] for h in halves) or (name,)

        found = []
        for atom, value in literals.items():
            condition = Condition(atom.predicate, atom.arguments, value)
            split = parts(atom.arguments[0]) if condition.is_placement else (atom.arguments[0],)
            found += [dataclasses.replace(condition, arguments=(p, *atom.arguments[1:])) for p in split]
        return tuple(dict.fromkeys(found))


def choose_reading(
    goal: Expression,
    truth: Mapping[Atom, bool],
    rng: np.random.Generator,
    few_changes: bool,
    fixed: frozenset[str] = frozenset(),
) -> Reading | None:
    """See `GoalSampler.reading`. `goal`: ground. `fixed`: objects that cannot be moved."""

    def rank(options: Sequence[Expression], value: bool) -> list[Expression]:
        shuffled = [options[n] for n in rng.permutation(len(options))]
        if not few_changes:
            return shuffled
        return sorted(shuffled, key=lambda e: cheapest(e, changes, value)[0])

    def possible(chosen: Mapping[Atom, bool], atom: Atom, value: bool) -> bool:
        if truth[atom] == value or len(atom.arguments) == 1 or atom.predicate in OF_SUBSTANCES:
            return True
        first, second = atom.arguments
        return first != second and (first not in fixed or (atom.predicate in MUTUAL and second not in fixed))

    def changes(atom: Atom, value: bool) -> float:
        return float(truth[atom] != value) if possible({}, atom, value) else math.inf

    looked_at = itertools.count()

    def in_one_place(chosen: Mapping[Atom, bool], atom: Atom, value: bool) -> bool:
        if next(looked_at) > LOOKED_AT or not possible(chosen, atom, value):
            return False
        if not value or atom.predicate not in ELSEWHERE:
            return True
        return not any(
            held
            and other.predicate in ELSEWHERE
            and other.arguments[0] == atom.arguments[0]
            and (other.predicate == atom.predicate or "on_floor" in (other.predicate, atom.predicate))
            for other, held in chosen.items()
        )

    for accepts in (in_one_place, possible):
        found = next(readings(goal, accepts, rank), None)
        if found is not None:
            return found
    return None
