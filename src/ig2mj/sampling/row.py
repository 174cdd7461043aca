"""One initial state that fulfils a set of conditions: objects are placed one after another, with backtracking.

Order: joints (those of an object that is to be placed, once it stands), placements from supports to the objects on
them, then states without a placement. If an object finds no position, the sampler backtracks to the one before it. At
the end all conditions are checked together: they hold, everything sleeps, no object penetrates another."""

from __future__ import annotations

import collections
import dataclasses
from collections.abc import Sequence

import jax
import numpy as np

from ig2mj.engine.snapshot import Snapshot
from ig2mj.engine.writes import teleports
from ig2mj.errors import StateError
from ig2mj.predicates.literals import object_index, room_index
from ig2mj.sampling.bystanders import Bystanders
from ig2mj.sampling.conditions import Condition, order
from ig2mj.sampling.joints import JointMover
from ig2mj.sampling.placement import NOWHERE, RESTING_PENETRATION, Areas, Budget, Placer, Rejections
from ig2mj.sampling.query import SceneQuery
from ig2mj.sampling.rules import PLACEMENTS, elsewhere, on_floor
from ig2mj.sampling.setters import Change, set_by_name
from ig2mj.sampling.truths import Truths
from ig2mj.states.model import StateModel
from ig2mj.states.world import ExtendedStates

SHARE = 3
"""An object may spend 1/SHARE of the remaining budget of the row before the sampler backtracks to the one before it."""

OPENINGS = 12
"""Positions sampled for an object's joints until it stays at rest: a half-open lid may fall shut."""


@dataclasses.dataclass(frozen=True)
class Row:
    """A sampled state of one world: physics without the world axis, extended states with one of length 1."""

    physics: Snapshot
    states: ExtendedStates


class RowSampler:
    """Samples rows of one scene."""

    def __init__(self, query: SceneQuery, model: StateModel, states: ExtendedStates):
        """Binds a world at rest: rows begin there.

        Args:
          query: its present state is the start of every row. states: those of the start.
        """
        self.query, self.model = query, model
        self._placer = Placer(query)
        self._truths: dict[tuple[Condition, ...], Truths] = {}
        self.start_from(query.save(), states)

    @property
    def start(self) -> tuple[Snapshot, ExtendedStates]:
        """The state that rows begin with."""
        return self._start, self._initial

    def start_from(self, start: Snapshot, states: ExtendedStates) -> None:
        """Lets the next rows begin with another state of the scene."""
        self._start, self._initial = start, jax.tree.map(np.asarray, states)

    def sample(
        self, conditions: Sequence[Condition], rng: np.random.Generator, budget: Budget, rejected: Rejections
    ) -> Row | None:
        """A row, or None where the budget did not suffice; the world is left in it.

        Args:
          conditions: of objects' names (see `conditions.bind`). rejected: counts of reasons are added to it.

        Raises:
          StateError, AbilityError, UnknownNameError: a condition that can never be made true.
        """
        plan = order(conditions)
        self._truth = self._truths_of(tuple(conditions))
        self.query.load(self._start)
        self._states = self._initial
        self._others = Bystanders(self.query, self._start)
        placed = {name for name, wanted in plan.placements if wanted[0].value}
        self._joints = [c for c in plan.joints if c.arguments[0] in placed]
        for condition in plan.joints:
            if condition not in self._joints and not self._open(condition, rng, rejected):
                return None
        if not self._place_all(plan.placements, rng, budget, rejected):
            return None
        for condition in plan.states:
            self._set(condition, rng)
        if any(c.predicate == "sliced" for c in plan.states):
            self.query.settle()
        problem = self._problem(conditions, [name for name, _ in plan.placements])
        if problem:
            rejected[problem] += 1
            return None
        return Row(self.query.save(), self._states)

    def holds(self, conditions: Sequence[Condition], states: ExtendedStates) -> bool:
        """Whether conditions hold in the world as it is now, with the given extended states."""
        return self._truths_of(tuple(conditions)).hold(conditions, states, self.query.view)

    def _truths_of(self, conditions: tuple[Condition, ...]) -> Truths:
        if conditions not in self._truths:
            if len(self._truths) >= 64:
                self._truths.clear()
            self._truths[conditions] = Truths(self.model, conditions)
        return self._truths[conditions]

    def _place_all(
        self,
        placements: Sequence[tuple[str, tuple[Condition, ...]]],
        rng: np.random.Generator,
        budget: Budget,
        rejected: Rejections,
    ) -> bool:
        """Places every object; where one finds no place, goes back to the one before."""
        before: list[Snapshot] = []
        k = 0
        while k < len(placements):
            if budget.spent():
                return False
            name, wanted = placements[k]
            before.append(self.query.save())
            part = budget if len(placements) == 1 else budget.part(SHARE)
            left = part.work
            reasons: Rejections = collections.Counter()
            placed = self._place(name, wanted, rng, part, reasons)
            if part is not budget:
                budget.work -= left - part.work + 1
            if placed:
                k += 1
            else:
                for reason, count in reasons.items():
                    rejected[f"{name}: {reason}"] += count
                back = max(k - 1, 0)
                self.query.load(before[back])
                del before[back:]
                if k == 0 and NOWHERE.issuperset(reasons):
                    return False
                k = back
        return True

    def _place(
        self, name: str, wanted: tuple[Condition, ...], rng: np.random.Generator, budget: Budget, rejected: Rejections
    ) -> bool:
        """Places one object, if it is not where it shall be already and negations are all that is asked."""
        index = object_index(self.model, name)
        rule = wanted[0]
        if self.model.tables.object_fixed[index]:
            if self._holds(wanted):
                return True
            raise StateError(f"'{name}' is fixed: it cannot be moved so that {rule} becomes true")
        if not rule.value and self._holds(wanted):
            return True
        areas = self._areas(index, rule)
        for other in wanted[1:]:
            if other.value and other.predicate == "on_floor":
                areas = on_floor.within(areas, self.query, room_index(self.model, other.arguments[1]))
        before = self.query.save()
        along = -1
        if rule.value and rule.predicate != "on_floor":
            along = object_index(self.model, rule.arguments[1])
        if not self._placer.place(index, areas, lambda: self._holds(wanted), rng, budget, rejected, along):
            return False
        opened = [c for c in self._joints if c.arguments[0] == name]
        if all(self._open(c, rng, rejected) for c in opened) and (not opened or self._holds(wanted)):
            return True
        self.query.load(before)
        return False

    def _open(self, condition: Condition, rng: np.random.Generator, rejected: Rejections) -> bool:
        """Moves an object's joints so that a condition about `open` holds when everything has come to rest."""
        name = condition.arguments[0]
        mover = JointMover(self.query, object_index(self.model, name))
        for _ in range(OPENINGS):
            change = self._change(condition, rng)
            assert change.joints is not None
            problem = mover.problem(mover.plan(*change.joints))
            if not problem and self._holds((condition,)):
                return True
            rejected[f"{name}: {problem or 'joints do not rest'}"] += 1
            self.query.load(mover.before)
        return False

    def _areas(self, index: int, rule: Condition) -> Areas:
        if rule.predicate == "on_floor":
            second = room_index(self.model, rule.arguments[1])
        else:
            second = object_index(self.model, rule.arguments[1])
        return (PLACEMENTS[rule.predicate] if rule.value else elsewhere.areas)(self.query, index, second)

    def _holds(self, conditions: Sequence[Condition]) -> bool:
        return self._truth.hold(conditions, self._states, self.query.view)

    def _change(self, condition: Condition, rng: np.random.Generator) -> Change:
        (name,) = condition.arguments
        view = self.query.view
        return set_by_name(self.model, self._states, view, condition.predicate, name, condition.value, rng)

    def _set(self, condition: Condition, rng: np.random.Generator) -> None:
        """Makes a condition of one object hold that needs neither place nor joints; halves take the whole's place."""
        change = self._change(condition, rng)
        self._states = change.states
        if change.swap is not None:
            pos, quat, mask = (np.asarray(field)[0] for field in (change.swap.pos, change.swap.quat, change.swap.mask))
            self.query.write(teleports(self.model.tables.num_objects, self.model.swap_objects, pos, quat, mask))

    def _problem(self, conditions: Sequence[Condition], placed: Sequence[str]) -> str:
        """Why the finished row is no good, or ''."""
        if not self._holds(conditions):
            return "predicate false at the end"
        if np.asarray(self.query.view.awake).any() and not self.query.settle() and self._others.restless().any():
            return "not at rest at the end"
        if not self._holds(conditions):
            return "predicate false at the end"
        deepest = self.query.penetrations()
        if any(deepest[object_index(self.model, name)] > RESTING_PENETRATION for name in placed):
            return "stands in something at the end"
        return ""
