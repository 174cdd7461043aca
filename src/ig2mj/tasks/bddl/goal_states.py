"""Goal states of a bound activity, sampled: a start state in which everything that the goal asks for has been done.

A goal has many ground readings (`ig2mj.predicates.readings`): which dish a tomato is in, which two of three shoes are
under the table. Each attempt takes one and makes its literals true in the start state, with what holds already left
as it is. The first attempt takes one that changes little, later ones any.
"""

from __future__ import annotations

import collections
import dataclasses
import time
from collections.abc import Mapping, Sequence
from typing import Any

import jax
import numpy as np

from ig2mj.callbacks import ProgressCallback, no_progress
from ig2mj.cluster.job_runner import Where, map_jobs
from ig2mj.cluster.jobs import Job, JobSet
from ig2mj.cluster.journal import Journal
from ig2mj.errors import EngineError, StateError
from ig2mj.predicates import logic
from ig2mj.predicates.compile import CompiledExpression
from ig2mj.predicates.logic import Atom, Expression
from ig2mj.predicates.readings import Literals, fewest_changes, readings
from ig2mj.process import entry_point
from ig2mj.sampling.conditions import Condition
from ig2mj.sampling.many import make_sampler, packed_row, sample_row, sampled_rows, Sampled
from ig2mj.sampling.placement import Budget, Rejections
from ig2mj.sampling.row import Row, RowSampler
from ig2mj.scene.scene import Scene
from ig2mj.states.model import StateModel
from ig2mj.tasks.bddl.binding import Binding
from ig2mj.tasks.bddl.goal import conditions
from ig2mj.tasks.bddl.start import start_conditions, world_of

ATTEMPTS = 12
"""Attempts at a goal state before it is given up."""

ATTEMPT_BUDGET = 400
"""Units of work (see `ig2mj.sampling.placement.Budget`) of one attempt."""

SEARCHED = 200
"""Readings that are looked at for one whose objects are in one place each."""

STREAM = 1
"""Of random numbers, next to that of starts."""

ELSEWHERE = ("inside", "on_top", "on_floor")
"""Predicates of which an object fulfils one at a time, and of one second argument."""


@dataclasses.dataclass(frozen=True)
class GoalState:
    """What came of one start.

    Attributes:
      row: the goal state; None: not found. rejected: why candidates were turned down. attempts: how many were made.
      reading: the last one tried. missing: literals of it that could not be made true, as far as is known.
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
        sampler, rejected = self.sampler, collections.Counter()
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
            literals = self.reading(truth, rng, cheapest=attempt == 1)
            if literals is None:
                rejected["no reading of the goal is possible"] += 1
                break
            reading = self._conditions(literals)
            row = sampler.sample(reading, rng, Budget(ATTEMPT_BUDGET, left, time.process_time), rejected, keep=True)
            if row is not None and self._goal(world_of(sampler.query, row.states))[0]:
                return GoalState(row, rejected, attempt, reading)
            if row is not None:
                rejected["goal false although its reading holds"] += 1
        return GoalState(None, rejected, attempt, reading)

    def reading(self, truth: Mapping[Atom, bool], rng: np.random.Generator, cheapest: bool) -> Literals | None:
        """A reading of the goal at random, each object in one place if there is such a reading; None: there is none.

        Args:
          truth: of the goal's atoms in the start. cheapest: alternatives that change least come first.
        """
        return choose_reading(self._goal, truth, rng, cheapest, self._fixed)

    @property
    def _fixed(self) -> frozenset[str]:
        tables = self.model.tables
        return frozenset(n for n, fixed in zip(tables.object_names, tables.object_fixed, strict=True) if fixed)

    def _truth(self, row: Row) -> dict[Atom, bool]:
        world = world_of(self.sampler.query, row.states)
        return dict(zip(self._goal.atoms, np.asarray(self._goal.literals_of(world))[0].tolist(), strict=True))

    def _conditions(self, literals: Literals) -> tuple[Condition, ...]:
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
    goal: CompiledExpression,
    truth: Mapping[Atom, bool],
    rng: np.random.Generator,
    cheapest: bool,
    fixed: frozenset[str] = frozenset(),
) -> Literals | None:
    """See `GoalSampler.reading`. `fixed`: objects that cannot be moved."""

    def rank(options: Sequence[Expression], value: bool) -> list[Expression]:
        shuffled = [options[n] for n in rng.permutation(len(options))]
        if not cheapest:
            return shuffled
        return sorted(shuffled, key=lambda e: fewest_changes(e, value, truth.__getitem__))

    def possible(chosen: Mapping[Atom, bool], atom: Atom, value: bool) -> bool:
        if truth[atom] == value or len(atom.arguments) == 1:
            return True
        first, second = atom.arguments
        if first == second or (
            first in fixed and (second in fixed or atom.predicate not in ("next_to", "in_contact_with"))
        ):
            return False
        return True

    def in_one_place(chosen: Mapping[Atom, bool], atom: Atom, value: bool) -> bool:
        if not possible(chosen, atom, value):
            return False
        if not value or atom.predicate not in ELSEWHERE:
            return True
        for other, held in chosen.items():
            if held and other.predicate in ELSEWHERE and other.arguments[0] == atom.arguments[0]:
                if other.predicate == atom.predicate or "on_floor" in (other.predicate, atom.predicate):
                    return False
        return True

    for accepts in (in_one_place, possible):
        found = next(readings(goal.ground, accepts, rank), None)
        if found is not None:
            return found
    return None
