"""The ground reading of an expression that costs least, found directly: no readings are enumerated.

A disjunction is its cheaper part, an `Exactly` the parts whose truth gains most, a `Pairing` an assignment of least
cost. `ig2mj.predicates.readings` enumerates readings, for demands on what is chosen together.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from ig2mj.predicates.logic import And, Atom, Exactly, Expression, Not, Or, Pairing
from ig2mj.predicates.readings import Reading

Cost = Callable[[Atom, bool], float]
"""What it costs that an atom is true, or false; infinite where that cannot be."""

FORBIDDEN = 1e9
"""Cost in an assignment of a pair that cannot be."""


def cheapest(expression: Expression, cost: Cost, wanted: bool = True) -> tuple[float, Reading]:
    """The reading of least cost, and that cost; infinite, with the reading of what fits, where there is none.

    Args:
      expression: ground. cost: of literals; may be negative. Each use of a literal counts.
    """
    match expression:
        case Atom():
            return cost(expression, wanted), {expression: wanted}
        case Not(part):
            return cheapest(part, cost, not wanted)
        case And(parts) | Or(parts):
            found = [cheapest(p, cost, wanted) for p in parts]
            if isinstance(expression, And) == wanted:
                return _together(found)
            return min(found, key=lambda choice: choice[0]) if found else (math.inf, {})
        case Exactly(count, parts):
            if wanted:
                return _exactly(count, parts, cost)
            others = [n for n in range(len(parts) + 1) if n != count]
            choices = [_exactly(n, parts, cost) for n in others]
            return min(choices, key=lambda choice: choice[0]) if choices else (math.inf, {})
        case Pairing(count, rows):
            return _paired(count, rows, cost) if wanted else _unpaired(count, rows, cost)
    raise TypeError(f"{expression!r} is not a ground expression")


def _together(found: Sequence[tuple[float, Reading]]) -> tuple[float, Reading]:
    """All of them; infinite where two of them want an atom otherwise."""
    total, reading = 0.0, {}
    for value, part in found:
        if any(reading.get(atom, truth) != truth for atom, truth in part.items()):
            value = math.inf
        total += value
        reading.update(part)
    return total, reading


def _exactly(count: int, parts: Sequence[Expression], cost: Cost) -> tuple[float, Reading]:
    true, false = [cheapest(p, cost, True) for p in parts], [cheapest(p, cost, False) for p in parts]
    if count > len(parts):
        return math.inf, {}

    def gain(i: int) -> float:
        """By how much its truth is cheaper than its falsehood."""
        if math.isinf(true[i][0]):
            return math.inf
        return -math.inf if math.isinf(false[i][0]) else true[i][0] - false[i][0]

    order = sorted(range(len(parts)), key=gain)
    chosen = set(order[:count])
    return _together([true[i] if i in chosen else false[i] for i in range(len(parts))])


def _paired(count: int, rows: Sequence[Sequence[Expression | None]], cost: Cost) -> tuple[float, Reading]:
    import scipy.optimize

    if not count:
        return 0.0, {}
    cells = [[(math.inf, {}) if p is None else cheapest(p, cost, True) for p in row] for row in rows]
    table = np.array([[min(value, FORBIDDEN) for value, _ in row] for row in cells], float).reshape(len(rows), -1)
    pairs = list(zip(*scipy.optimize.linear_sum_assignment(table), strict=True))
    pairs = sorted(pairs, key=lambda pair: table[pair])[:count]
    if len(pairs) < count:
        return math.inf, {}
    return _together([cells[i][j] for i, j in pairs])


def _unpaired(count: int, rows: Sequence[Sequence[Expression | None]], cost: Cost) -> tuple[float, Reading]:
    """So many rows without a true part that fewer than `count` are left."""
    empty = [_together([cheapest(p, cost, False) for p in row if p is not None]) for row in rows]
    wanted = max(len(rows) - count + 1, 0)
    return _together(sorted(empty, key=lambda choice: choice[0])[:wanted])
