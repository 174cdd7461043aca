"""`IncrementalGoal`: the status of a goal, evaluated where something that it reads has changed.

A goal reads the rows of the objects that it names (`ig2mj.predicates.goal_rows`) and few states. Where none of them has
changed its status is that of the last step. Where only temperatures have, all steps that were computed ahead
(`TemperatureSteps`) are evaluated in one call.

Axes: W worlds, O objects, N = `AHEAD` steps.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Set
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Int, Shaped

from ig2mj.engine.native.execution import HostFunction
from ig2mj.engine.view import Array, PhysicsView, but_agents, read_field
from ig2mj.predicates.compile import CompiledExpression, GoalStatus
from ig2mj.predicates.goal_rows import GoalRows
from ig2mj.predicates.host_queries import HostQueries
from ig2mj.predicates.registry import find
from ig2mj.states.initial import initial_states
from ig2mj.states.update import heat_fields
from ig2mj.states.world import ExtendedStates

MANY = 24
"""Relations of a goal from which on one world asks the host's questions."""

AHEAD = 16
"""Steps of temperatures that one call computes: a call takes 40 us, and what it computes hardly counts. Steps that
something overtakes are discarded."""

GOALS = 8
"""Goals whose programs are kept: those stepped last."""


class TemperatureSteps(NamedTuple):
    """Steps of temperatures, as long as nothing else changes.

    Attributes:
      made: leaves of the states that temperatures are, after each step. changed: which of them each step changes.
    """

    made: list[Shaped[Array, "W N ..."]]
    changed: list[tuple[int, ...]]


class IncrementalGoal:
    """The status of a goal in one batch of worlds, evaluated where something that it reads has changed."""

    def __init__(self, programs: GoalPrograms):
        self._programs, self._status = programs, programs.none
        self._view: PhysicsView | None = None  # of which `_status` is, or one that is the same in all that is read
        self._ahead: TemperatureSteps | None = None  # the steps of which `_of_ahead` are the statuses
        self._of_ahead: Callable[[int], GoalStatus] = lambda k: programs.none

    def evaluate(self, view: PhysicsView, leaves: list[Array]) -> GoalStatus:
        """The status of a view and of states."""
        self._view, self._ahead = view, None
        self._status = self._programs.status(view, leaves)
        return self._status

    def goes_on(self, view: PhysicsView) -> bool:
        """Whether the goal reads nothing of the view that has changed since the last call."""
        before = self._view
        if view is before:
            return True
        if before is None:
            return False
        scene = but_agents(view)
        only_agents_moved = scene is not None and scene is but_agents(before)
        if not (only_agents_moved and not self._programs.reads_agents) and not self._programs.reads_same(view, before):
            return False
        self._view = view
        return True

    def after_heat(
        self, view: PhysicsView, leaves: list[Array], ahead: TemperatureSteps, k: int, changed: list[str]
    ) -> GoalStatus:
        """The status after step k of temperatures.

        Args:
          leaves: of the states after it. changed: names of the fields that it changed.
        """
        if not self.goes_on(view):
            return self.evaluate(view, leaves)
        if not self._programs.heat_reads.isdisjoint(changed):
            if self._ahead is not ahead:
                self._ahead, self._of_ahead = ahead, self._programs.statuses(view, leaves, ahead.made)
            self._status = self._of_ahead(k)
        return self._status

    def after_change(self, view: PhysicsView, leaves: list[Array], changed: Set[str]) -> GoalStatus:
        """The status after a step that changed these fields of the states."""
        if not self.goes_on(view) or not self._programs.state_reads.isdisjoint(changed):
            return self.evaluate(view, leaves)
        return self._status


class GoalPrograms:
    """A goal's status, compiled.

    One world with a goal of many relations asks the host's questions, whose programs the goals of a scene share: a
    program of the goal's own would take seconds to compile.

    Attributes:
      none: the status without a goal.
    """

    def __init__(self, goal: CompiledExpression | None, num_worlds: int):
        self._goal, self.none = goal, GoalStatus.empty(num_worlds)
        self._questions: HostQueries | None = None
        if goal is not None:
            named, self._structure = jax.tree_util.tree_flatten_with_path(initial_states(goal.model, num_worlds))
            names, late = [path[0].name for path, _ in named], heat_fields(goal.model)
            self._names = names
            self._heat_places = [place for place, name in enumerate(names) if name in late and named[place][1].size]
            self._heat_names = [names[place] for place in self._heat_places]
            self._arguments = jax.tree.structure((0, [0] * len(names), [0] * len(self._heat_places), 0))
            starts = [np.asarray(named[place][1]) for place in self._heat_places]
            self._one_step: list[Array] = [np.zeros((num_worlds, AHEAD, *x.shape[1:]), x.dtype) for x in starts]
            self._rows = GoalRows(goal.model, goal.literals)
            if num_worlds == 1 and len(set(goal.queries)) > MANY:
                self._questions = HostQueries.of(goal.model)
        self._statuses = HostFunction(self._statuses_fn)

    @staticmethod
    @functools.lru_cache(maxsize=GOALS)
    def of(goal: CompiledExpression | None, num_worlds: int) -> GoalPrograms:
        """Those of a goal; asked again, the same object."""
        return GoalPrograms(goal, num_worlds)

    def status(self, view: PhysicsView, leaves: list[Array]) -> GoalStatus:
        """Of states with these leaves."""
        if self._goal is None:
            return self.none
        for steps, place in zip(self._one_step, self._heat_places, strict=True):
            steps[:, 0] = leaves[place]
        return self._called(view, leaves, self._one_step, 1)(0)

    def statuses(
        self, view: PhysicsView, leaves: list[Array], made: list[Shaped[Array, "W N ..."]]
    ) -> Callable[[int], GoalStatus]:
        """Of the states with each of some steps of temperatures, by number of the step."""
        return self._called(view, leaves, made, AHEAD)

    def _called(
        self, view: PhysicsView, leaves: list[Array], made: list[Shaped[Array, "W N ..."]], count: int
    ) -> Callable[[int], GoalStatus]:
        goal, questions = self._goal, self._questions
        assert goal is not None
        if questions is not None:

            def ask(k: int) -> GoalStatus:
                states = self._states(leaves, [steps[:, k] for steps in made])
                return goal.status_of(questions.facts(goal.literals, states, view), states)

            return ask
        holds, fraction, literals = self._statuses.flat(
            [view, *leaves, *made, np.array(count, np.int32)], self._arguments
        )
        return lambda k: GoalStatus(holds[k], fraction[k], literals[k])

    @functools.cached_property
    def _reads(self) -> frozenset[str]:
        """Paths of what it depends on, "view.touching" or "states.temperature"; known after the first call."""
        if self._goal is None:
            return frozenset()
        if self._questions is not None:
            reads = (self._questions.reads(find(name)) for name in self._goal.literals.instances)
            return frozenset(name for names in reads for name in names)
        first = 1 + self._structure.num_leaves  # the view, the states, then temperatures
        heat_reads = {name for i, name in enumerate(self._heat_names) if first + i in self._statuses.takes}
        reads = heat_reads | {name for i, name in enumerate(self._names) if 1 + i in self._statuses.takes}
        return frozenset({*(f"states.{name}" for name in reads), *(f"view.{name}" for name in self._statuses.reads)})

    @functools.cached_property
    def state_reads(self) -> frozenset[str]:
        """Fields of states on which it depends; known after the first call."""
        return frozenset(name.split(".")[1] for name in self._reads if name.startswith("states."))

    @functools.cached_property
    def heat_reads(self) -> frozenset[str]:
        """Fields that `heat` changes on which it depends; known after the first call."""
        return frozenset() if self._goal is None else frozenset(self._heat_names) & self.state_reads

    @functools.cached_property
    def _view_reads(self) -> list[str]:
        return sorted(name.removeprefix("view.") for name in self._reads if name.startswith("view."))

    @functools.cached_property
    def reads_agents(self) -> bool:
        """Whether it depends on agents; known after the first call."""
        return any(name.startswith("agent.") for name in self._view_reads)

    def reads_same(self, now: PhysicsView, before: PhysicsView) -> bool:
        """Whether all that it depends on is the same in two views; known after the first call."""
        if self._goal is None:
            return True
        same = self._rows.same
        return all(same(name, read_field(now, name), read_field(before, name)) for name in self._view_reads)

    def _states(self, leaves: list[Array], temperatures: list[Array]) -> ExtendedStates:
        every = list(leaves)
        for place, array in zip(self._heat_places, temperatures, strict=True):
            every[place] = array
        return jax.tree.unflatten(self._structure, every)

    def _statuses_fn(
        self, view: PhysicsView, leaves: list[Array], made: list[Shaped[Array, "W N ..."]], count: Int[Array, ""]
    ) -> tuple[Array, ...]:
        """Of the first `count` steps; the others' are zeros."""
        goal = self._goal
        assert goal is not None
        relations = goal.plan.evaluate(view)

        def status(k: Int[Array, ""]) -> tuple[Array, Array, Array]:
            states = self._states(leaves, [jnp.asarray(steps)[:, k] for steps in made])
            found = goal.status(states, view, relations)
            return found.holds, found.fraction, found.literals

        def turn(k: Int[Array, ""], rows: tuple[Array, ...]) -> tuple[Array, ...]:
            return tuple(jnp.asarray(row).at[k].set(x) for row, x in zip(rows, status(k), strict=True))

        shapes = jax.eval_shape(status, jnp.zeros((), jnp.int32))
        return jax.lax.fori_loop(0, count, turn, tuple(jnp.zeros((AHEAD, *x.shape), x.dtype) for x in shapes))
