"""One initial state that fulfils a set of conditions: objects are placed one after another, with backtracking.

Order: joints (those of an object that is to be placed, once it stands), cuts of wholes whose halves are to be placed,
placements from supports to the objects on them, then states without a placement. If an object finds no position, the
sampler backtracks to the one before it. At the end all conditions are checked together: they hold, everything sleeps,
no object penetrates another.
"""

from __future__ import annotations

import collections
import dataclasses
from collections.abc import Collection, Sequence

import jax
import numpy as np

from ig2mj.engine.snapshot import Snapshot
from ig2mj.engine.writes import teleports
from ig2mj.errors import StateError
from ig2mj.predicates.literals import object_index
from ig2mj.sampling.areas import areas_for
from ig2mj.sampling.attaching import attach, number_of
from ig2mj.sampling.budget import Budget
from ig2mj.sampling.bystanders import Bystanders
from ig2mj.sampling.conditions import Condition, order
from ig2mj.sampling.joints import JointMover
from ig2mj.sampling.placement import NOWHERE, RESTING_PENETRATION, Placer, Rejections
from ig2mj.sampling.query import SceneQuery
from ig2mj.sampling.setters import Change, set_by_name
from ig2mj.sampling.truths import Truths
from ig2mj.states.model import StateModel
from ig2mj.states.world import ExtendedStates

SHARE = 3
"""An object may spend 1/SHARE of the remaining budget of the row before the sampler backtracks to the one before it."""

OPENINGS = 12
"""Positions sampled for an object's joints until it stays at rest."""

KEPT_TRUTHS = 256
"""Lists of conditions whose evaluation is kept."""


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
        tables = model.tables
        self._fixed = frozenset(n for n, fixed in zip(tables.object_names, tables.object_fixed, strict=True) if fixed)
        self._ranks = {name: -_volume(model, index) for index, name in enumerate(tables.object_names)}
        self.start_from(query.save(), states)

    @property
    def start(self) -> tuple[Snapshot, ExtendedStates]:
        """The state that rows begin with."""
        return self._start, self._initial

    def start_from(self, start: Snapshot, states: ExtendedStates) -> None:
        """Lets the next rows begin with another state of the scene."""
        self._start, self._initial = start, jax.tree.map(np.asarray, states)

    def sample(
        self,
        conditions: Sequence[Condition],
        rng: np.random.Generator,
        budget: Budget,
        rejected: Rejections,
        keep: bool = False,
        again: Collection[str] = (),
        around: Sequence[Condition] = (),
        carried: Collection[str] = (),
    ) -> Row | None:
        """A row, or None where the budget did not suffice; the world is left in it.

        Args:
          conditions: of objects' names (see `conditions.bind`). rejected: counts of reasons are added to it.
          keep: leave objects as they are of which everything holds already, place larger objects first, and let objects
            that have been placed be pushed so long as their conditions hold; else every object is placed again.
          again: objects that are placed again nevertheless, on their flattest side.
          around: placements that hold, of objects that may be pushed so long as these hold.
          carried: objects that go along with what is placed, in or on which they lie.

        Raises:
          StateError, AbilityError, UnknownNameError: a condition that can never be made true.
        """
        self._truths_of(tuple(conditions))  # refuses what can never hold
        plan = order(conditions, self._fixed, self._ranks if keep else None)
        self.query.load(self._start)
        self._states, self._keep, self._again = self._initial, keep, frozenset(again)
        self._around, self._carried = tuple(around), [object_index(self.model, n) for n in carried]
        self._others = Bystanders(self.query, self._start)
        placed = {name for name, requested in plan.placements if requested[0].value}
        self._joints = [c for c in plan.joints if c.arguments[0] in placed]
        for condition in plan.joints:
            if condition not in self._joints and not self._open(condition, rng, rejected):
                return None
        cuts = [c for c in plan.states if c.predicate == "sliced" and c.value and self._halves(c.arguments[0]) & placed]
        self._set_all(cuts, rng)
        if not self._place_all(plan.placements, rng, budget, rejected):
            return None
        joints = [c for c in plan.states if c.predicate == "attached"]
        self._set_all([c for c in plan.states if c not in cuts and c not in joints], rng)
        for condition in joints:
            if not self._attach(condition, rng):
                rejected[f"{condition.arguments[0]}: no place to attach it"] += 1
                return None
        problem = self._problem((*conditions, *around), [name for name, _ in plan.placements])
        if problem:
            rejected[problem] += 1
            return None
        return Row(self.query.save(), self._states)

    def _attach(self, condition: Condition, rng: np.random.Generator) -> bool:
        """Attaches an object to another, or detaches it; whether that was possible."""
        if self._holds((condition,)):
            return True
        number = number_of(self.model, *condition.arguments)
        made = attach(self.query, self.model, self._states, number, condition.value, rng)
        if made is not None:
            self._states = made
        return made is not None

    def _set_all(self, conditions: Sequence[Condition], rng: np.random.Generator) -> None:
        for condition in conditions:
            if not (self._keep and self._holds((condition,))):
                self._set(condition, rng)
        if any(c.predicate == "sliced" for c in conditions):
            self.query.settle()

    def holds(self, conditions: Sequence[Condition], states: ExtendedStates) -> bool:
        """Whether conditions hold in the world as it is now, with the given extended states."""
        return self._truths_of(tuple(conditions)).hold(conditions, states, self.query.view)

    def _truths_of(self, conditions: tuple[Condition, ...]) -> Truths:
        if conditions not in self._truths:
            if len(self._truths) >= KEPT_TRUTHS:
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
            name, requested = placements[k]
            self._placed = placements[:k] if self._keep else ()
            before.append(self.query.save())
            part = budget if len(placements) == 1 else budget.part(SHARE)
            left = part.work
            reasons: Rejections = collections.Counter()
            placed = self._place(name, requested, rng, part, reasons)
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
        self,
        name: str,
        requested: tuple[Condition, ...],
        rng: np.random.Generator,
        budget: Budget,
        rejected: Rejections,
    ) -> bool:
        """Places one object, if it is not where it shall be already and negations are all that is asked."""
        index = object_index(self.model, name)
        rule = requested[0]
        if self._keep and name not in self._again and self._holds(requested):
            return True
        if self.model.tables.object_fixed[index]:
            if self._holds(requested):
                return True
            raise StateError(f"'{name}' is fixed: it cannot be moved so that {rule} becomes true")
        if not rule.value and self._holds(requested):
            return True
        areas = areas_for(self.query, self.model, name, requested)
        before = self.query.save()
        along = -1
        if rule.value and rule.predicate != "on_floor":
            along = object_index(self.model, rule.other_than(name))
        for involved in {index, along} - {-1}:
            if not (self.model.tables.piece_object == involved).any():
                nothing = f"'{self.model.tables.object_names[involved]}' has no collision geometry"
                raise StateError(f"{nothing}: {rule} cannot be made true by placing '{name}'")
        earlier = (*(c for _, placed in self._placed for c in placed), *self._around)
        moving = (*(n for n, _ in self._placed), *(c.arguments[0] for c in self._around))
        pushable = {object_index(self.model, n) for n in moving if n not in self._fixed and n != name}
        done = self._placer.place(
            index,
            areas,
            lambda: self._holds(requested) and (not earlier or self._holds(earlier)),
            rng,
            budget,
            rejected,
            along,
            flat=name in self._again,
            pushable=pushable,
            carried=self._carried,
        )
        if not done:
            return False
        opened = [c for c in self._joints if c.arguments[0] == name]
        if all(self._open(c, rng, rejected) for c in opened) and (not opened or self._holds(requested)):
            return True
        self.query.load(before)
        return False

    def _open(self, condition: Condition, rng: np.random.Generator, rejected: Rejections) -> bool:
        """Moves an object's joints so that a condition about `open` holds when everything has come to rest.

        What is to stand open is tried wider each time: a lid that stands half open may fall shut.
        """
        name = condition.arguments[0]
        mover = JointMover(self.query, object_index(self.model, name))
        for tries in range(OPENINGS):
            change = self._change(condition, rng)
            assert change.joints is not None
            positions, moves = change.joints
            if condition.value:
                wider = tries / (OPENINGS - 1)
                positions = positions + wider * (self.model.tables.openable_open - positions)
            problem = mover.problem(mover.plan(positions, moves))
            if not problem and self._holds((condition,)):
                return True
            rejected[f"{name}: {problem or 'joints do not rest'}"] += 1
            self.query.load(mover.before)
        return False

    def _halves(self, whole: str) -> set[str]:
        names = self.model.tables.object_names
        return {names[h] for h in self.model.parameters.halves_of(object_index(self.model, whole))}

    def _holds(self, conditions: Sequence[Condition]) -> bool:
        return self.holds(conditions, self._states)

    def _change(self, condition: Condition, rng: np.random.Generator) -> Change:
        name, *others = condition.arguments
        wanted, view = condition.predicate, self.query.view
        substance = others[0] if others else None
        return set_by_name(self.model, self._states, view, wanted, name, condition.value, rng, substance)

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


def _volume(model: StateModel, index: int) -> float:
    """Of the boxes of an object's pieces, cubic metres: how hard it is to find room for it."""
    tables = model.tables
    boxes = np.ptp(tables.piece_vertices[tables.piece_object == index], axis=1)
    return float(np.prod(boxes, axis=1).sum())
