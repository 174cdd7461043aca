"""`TaskPlanner`: from a goal to ordered steps, by regression over literals.

The goal is ground: quantifiers stand for the scene's objects. `plan` takes the cheapest reading of the goal
(`ig2mj.predicates.cheapest`), and for each of its literals that is false, in the order of what depends on what
(`step_order`), the steps that make it true and those that they need first (`step_builder`).

Goals of BEHAVIOR have few dependencies beyond these, so no search is made. The plan describes the world as it is now:
plan again after every step. Steps that failed are passed in, which makes their literals more expensive, so that
another object of an `exists`, another tool or another support is taken.
"""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Collection, Mapping

from ig2mj.planning.domain import Domain, condition_of
from ig2mj.planning.exclusion import incompatible
from ig2mj.planning.facts import Facts
from ig2mj.planning.step_builder import StepBuilder
from ig2mj.planning.steps import PlanningError, Step
from ig2mj.planning.supplies import lacking
from ig2mj.predicates import logic
from ig2mj.predicates.cheapest import Cost, Incompatible, cheapest, contradiction
from ig2mj.predicates.compile import CompiledExpression
from ig2mj.predicates.logic import Atom
from ig2mj.sampling.conditions import Condition

STEPS_OF = {
    "open": 1.0,
    "attached": 2.0,
    "toggled_on": 1.0,
    "sliced": 2.0,
    "dusty": 2.5,
    "soaked": 3.0,
    "contains": 3.0,
    "covered": 3.0,
    "filled": 3.0,
    "saturated": 3.0,
    "cooked": 4.0,
    "frozen": 4.0,
    "stained": 4.5,
}
"""Steps that a literal of one object takes, about; a placement takes two."""

PLACING, FAILED, REMEMBERED = 2.0, 3.0, 4
"""Steps of a placement; cost of each failure of a literal, in steps; failures of a literal that count at most."""


@dataclasses.dataclass(frozen=True)
class TaskPlan:
    """The remaining steps in one world.

    Attributes:
      steps: in order; none for conditions that have failed `GIVE_UP` times.
      missing: conditions of the reading that are false now. required: all conditions of the reading.
    """

    steps: tuple[Step, ...]
    missing: tuple[Condition, ...]
    required: tuple[Condition, ...]

    @property
    def done(self) -> bool:
        """Nothing is missing."""
        return not self.missing


class TaskPlanner:
    """Plans for one goal of one scene and robot. It has no state, so that any number of worlds share it."""

    def __init__(self, domain: Domain, goal: CompiledExpression):
        """
        Raises:
          PlanningError: the robot has no hands.
        """
        if domain.hands < 1:
            raise PlanningError("a robot without hands cannot change a household (--robot humanoid or fetch has hands)")
        self.domain, self.goal = domain, goal
        self._impossible: dict[Condition, str] = {}

    def plan(
        self,
        facts: Facts,
        failed: Mapping[Condition, int] | None = None,
        begun: Condition | None = None,
        stuck: Collection[Condition] = (),
        failed_steps: Mapping[str, int] | None = None,
    ) -> TaskPlan:
        """The steps that are left.

        Args:
          failed: how often the steps of a condition have failed.
          begun: condition that the last step was for, if that step succeeded.
          stuck: conditions whose steps failed in the world as it is now: no step has succeeded since.
          failed_steps: how often steps have failed, by their text.

        Raises:
          PlanningError: the goal cannot become true; names the literal and the reason.
        """
        failed = failed or {}
        truth = facts.truth(self.goal.atoms)

        def cost(atom: Atom, required: bool) -> float:
            condition = condition_of(atom, required)
            if truth[atom] == required:
                return 0.0
            if self._reason(condition, facts):
                return math.inf
            steps = STEPS_OF.get(condition.predicate, PLACING)
            return steps + FAILED * min(failed.get(condition, 0), REMEMBERED)

        together = functools.partial(incompatible, facts)
        value, reading = cheapest(self.goal.ground, cost, incompatible=together)
        if math.isinf(value):
            raise PlanningError(f"the goal cannot become true: {self._why_not(facts, truth, cost, together)}")
        required = tuple(condition_of(atom, required) for atom, required in reading.items())
        missing = tuple(condition_of(atom, required) for atom, required in reading.items() if truth[atom] != required)
        return TaskPlan(
            tuple(StepBuilder(facts, required, missing, failed, begun, stuck, failed_steps).steps), missing, required
        )

    def _reason(self, condition: Condition, facts: Facts) -> str:
        if condition not in self._impossible:
            self._impossible[condition] = self.domain.impossible(condition)
        return self._impossible[condition] or lacking(facts, condition)

    def _why_not(self, facts: Facts, truth: Mapping[Atom, bool], cost: Cost, together: Incompatible) -> str:
        """The first literal whose impossibility keeps the goal from becoming true, or literals that exclude each
        other."""

        def barred(atom: Atom, required: bool) -> bool:
            return truth[atom] != required and bool(self._reason(condition_of(atom, required), facts))

        value, reading = cheapest(self.goal.ground, lambda atom, required: float(barred(atom, required)))
        for atom, required in reading.items():
            if not math.isinf(value) and barred(atom, required):
                condition = condition_of(atom, required)
                return f"{condition} is false, and {self._reason(condition, facts)}"
        if (atom := contradiction(self.goal.ground, cost)) is not None:
            return f"{logic.text(atom)} would have to be both true and false"
        if excluding := together(reading):
            return f"{' and '.join(map(logic.text, excluding))} cannot be true together"
        return f"its literals contradict each other in {logic.text(self.goal.source)}"
