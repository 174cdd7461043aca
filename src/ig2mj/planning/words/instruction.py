"""`Instruction`: what words ask for, as steps and as a goal."""

from __future__ import annotations

import dataclasses

from ig2mj.planning.steps import Step
from ig2mj.sampling.conditions import Condition


@dataclasses.dataclass(frozen=True)
class Instruction:
    """What words ask for.

    Attributes:
      text: the words. steps: requests to primitives, in order. notes: a line for each choice among several objects.
    """

    text: str
    steps: tuple[Step, ...]
    notes: tuple[str, ...] = ()

    @property
    def goal(self) -> str | None:
        """The expression that holds when all is done; None: a step has no lasting effect (`grasp`, `navigate_to`).

        What a later step undoes is left out.
        """
        found: dict[tuple[str, tuple[str, ...]], Condition] = {}
        for step in self.steps:
            if not step.adds:
                return None
            for condition in step.adds:
                key = (condition.predicate, condition.arguments)
                found.pop(key, None)
                found[key] = condition
        words = [str(c) for c in found.values()]
        return words[0] if len(words) == 1 else f"(and {' '.join(words)})"
