"""The cheapest ground reading of an expression, found without enumerating readings.

A disjunction is its cheaper part, an `Exactly` the parts whose truth gains most, a `Pairing` an assignment of least
cost. Where parts that must hold together want an atom both true and false, the search branches on that atom.
`ig2mj.predicates.readings` enumerates readings, for demands on what is chosen together.
"""

from __future__ import annotations

import heapq
import itertools
import math
from collections.abc import Callable, Collection, Sequence
from typing import NamedTuple

import numpy as np

from ig2mj.predicates.logic import And, Atom, Exactly, Expression, Not, Or, Pairing
from ig2mj.predicates.readings import Reading

Cost = Callable[[Atom, bool], float]
"""What it costs that an atom is true, or false; infinite where that cannot be."""

FORBIDDEN = 1e9
"""Cost of an impossible pair in an assignment."""

BRANCHES = 400
"""Branches of a search after which a contradiction stands."""


class _Choice(NamedTuple):
    """A reading of a part. `cost`: of its literals, each use of one. `clash`: an atom that must be both true and
    false, so that the cost is a lower bound."""

    cost: float
    reading: Reading
    clash: Atom | None = None


NOTHING = _Choice(math.inf, {})


Incompatible = Callable[[Reading], Collection[Atom]]
"""Atoms of a reading that cannot have their truth together; none: there are none."""


def compatible(reading: Reading) -> Collection[Atom]:
    """An `Incompatible` to which everything can be together."""
    return ()


def cheapest(
    expression: Expression, cost: Cost, expected: bool = True, incompatible: Incompatible = compatible
) -> tuple[float, Reading]:
    """The reading of least cost, and that cost; infinite, with the reading of what fits, where there is none.

    Args:
      expression: ground. cost: of literals; may be negative. Each use of a literal counts.
      incompatible: atoms that are possible one by one, but not together.
    """
    first = _choice(expression, cost, expected)
    numbers = itertools.count()
    queue: list[tuple[float, int, dict[Atom, bool], _Choice]] = [(first.cost, next(numbers), {}, first)]
    for _ in range(BRANCHES):
        if not queue or math.isinf(queue[0][0]):
            break
        value, _, settled, found = heapq.heappop(queue)
        if found.clash is not None:
            branches = [{found.clash: True}, {found.clash: False}]
        else:
            branches = [{atom: not found.reading[atom]} for atom in incompatible(found.reading)]
            if not branches:
                return value, found.reading
        for branch in branches:
            own = {**settled, **branch}
            choice = _choice(expression, _given(cost, own), expected)
            heapq.heappush(queue, (choice.cost, next(numbers), own, choice))
    return math.inf, first.reading


def contradiction(expression: Expression, cost: Cost) -> Atom | None:
    """An atom that the reading of least cost wants both true and false."""
    return _choice(expression, cost, True).clash


def _given(cost: Cost, settled: Reading) -> Cost:
    """`cost`, where the truth of some atoms is settled."""
    return lambda atom, expected: math.inf if settled.get(atom, expected) != expected else cost(atom, expected)


def _choice(expression: Expression, cost: Cost, expected: bool) -> _Choice:
    """The choice of least cost, where contradictions between parts cost nothing."""
    match expression:
        case Atom():
            return _Choice(cost(expression, expected), {expression: expected})
        case Not(part):
            return _choice(part, cost, not expected)
        case And(parts) | Or(parts):
            found = [_choice(p, cost, expected) for p in parts]
            if isinstance(expression, And) == expected:
                return _together(found)
            return _least(found)
        case Exactly(count, parts):
            if expected:
                return _exactly(count, parts, cost)
            return _least([_exactly(n, parts, cost) for n in range(len(parts) + 1) if n != count])
        case Pairing(count, rows):
            return _paired(count, rows, cost) if expected else _unpaired(count, rows, cost)
    raise TypeError(f"{expression!r} is not a ground expression")


def _least(choices: Sequence[_Choice]) -> _Choice:
    """The cheapest; of equally cheap ones one without a contradiction."""
    return min(choices, key=lambda choice: (choice.cost, choice.clash is not None), default=NOTHING)


def _together(found: Sequence[_Choice]) -> _Choice:
    """All of them."""
    total, reading, clash = 0.0, {}, None
    for part in found:
        clash = clash or part.clash
        clash = clash or next((a for a, truth in part.reading.items() if reading.get(a, truth) != truth), None)
        total += part.cost
        reading.update(part.reading)
    return _Choice(total, reading, clash)


def _exactly(count: int, parts: Sequence[Expression], cost: Cost) -> _Choice:
    true, false = [_choice(p, cost, True) for p in parts], [_choice(p, cost, False) for p in parts]
    if count > len(parts):
        return NOTHING

    def gain(i: int) -> float:
        """By how much its truth is cheaper than its falsehood."""
        if math.isinf(true[i].cost):
            return math.inf
        return -math.inf if math.isinf(false[i].cost) else true[i].cost - false[i].cost

    order = sorted(range(len(parts)), key=gain)
    chosen = set(order[:count])
    return _together([true[i] if i in chosen else false[i] for i in range(len(parts))])


def _paired(count: int, rows: Sequence[Sequence[Expression | None]], cost: Cost) -> _Choice:
    import scipy.optimize

    if not count:
        return _Choice(0.0, {})
    cells = [[NOTHING if p is None else _choice(p, cost, True) for p in row] for row in rows]
    table = np.array([[min(cell.cost, FORBIDDEN) for cell in row] for row in cells], float).reshape(len(rows), -1)
    pairs = list(zip(*scipy.optimize.linear_sum_assignment(table), strict=True))
    pairs = sorted(pairs, key=lambda pair: table[pair])[:count]
    if len(pairs) < count:
        return NOTHING
    return _together([cells[i][j] for i, j in pairs])


def _unpaired(count: int, rows: Sequence[Sequence[Expression | None]], cost: Cost) -> _Choice:
    """So many rows without a true part that fewer than `count` are left."""
    empty = [_together([_choice(p, cost, False) for p in row if p is not None]) for row in rows]
    expected = max(len(rows) - count + 1, 0)
    return _together(sorted(empty, key=lambda choice: choice.cost)[:expected])
