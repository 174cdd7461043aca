"""q, the partial credit of an episode, over all ground readings of its goal."""

from __future__ import annotations

import math
from collections.abc import Mapping

from ig2mj.predicates.cheapest import cheapest
from ig2mj.predicates.logic import Atom, Expression
from ig2mj.predicates.readings import Reading

ROUNDS = 20
"""Of the search for the largest quotient in `quality`; each round improves it, and three are usual."""


def quality(expression: Expression, start: Mapping[Atom, bool], end: Mapping[Atom, bool]) -> float:
    """q of an episode: the largest value, over all readings of the goal, of

        (literals false at the start and true at the end - those true at the start and false at the end)
        / literals false at the start,

    at least 0; 1 if nothing was false at the start. "True" is as the reading wants it.

    Args:
      expression: ground. start, end: truth of each atom.
    """

    def counts(reading: Reading) -> tuple[int, int]:
        wrong = [a for a, required in reading.items() if start[a] != required]
        gained = sum(end[a] == reading[a] for a in wrong)
        lost = sum(start[a] == required != end[a] for a, required in reading.items())
        return gained - lost, len(wrong)

    best = 0.0
    for _ in range(ROUNDS):  # a quotient is largest where gain - quotient * wrong has the maximum 0 (Dinkelbach)

        def price(atom: Atom, required: bool, quotient: float = best) -> float:
            if start[atom] == required:
                return 0.0 if end[atom] == required else 1.0
            return quotient - (1.0 if end[atom] == required else 0.0)

        value, reading = cheapest(expression, price)
        if math.isinf(value):
            return 0.0
        gained, wrong = counts(reading)
        if not wrong:
            return 1.0 if not gained else max(best, 0.0)
        if gained / wrong <= best + 1e-9:
            break
        best = gained / wrong
    return min(best, 1.0)
