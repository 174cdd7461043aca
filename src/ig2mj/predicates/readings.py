"""Ground readings: the conjunctions of literals that make an expression true, found by search.

`(exists (?d - dish) (inside apple_0 ?d))` has one reading for each dish. A reading says what must hold of which
objects, so that it can be sampled or planned for. Pairs of `ForPairs` are read as matchings: each object takes part in
one pair. `ig2mj.predicates.cheapest` finds the reading of least cost without a search.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Mapping, Sequence

from ig2mj.predicates.logic import And, Atom, Exactly, Expression, Not, Or, Pairing

Reading = dict[Atom, bool]
"""Atoms, and the truth that each must have."""

Accepts = Callable[[Mapping[Atom, bool], Atom, bool], bool]
"""Whether a literal can be added to those that are chosen."""


def anything(chosen: Mapping[Atom, bool], atom: Atom, value: bool) -> bool:
    """Accepts every literal."""
    return True


def keep_order(options: Sequence[Expression], value: bool) -> Sequence[Expression]:
    """Options in the order of the expression."""
    return options


Ranking = Callable[[Sequence[Expression], bool], Sequence[Expression]]
"""Options, and the truth that one or some of them shall have; the same options, the best first."""


def readings(expression: Expression, accepts: Accepts = anything, rank: Ranking = keep_order) -> Iterator[Reading]:
    """Readings of a ground expression, depth first; no literal of a reading contradicts another.

    Args:
      expression: without quantifiers (`ig2mj.predicates.logic.ground`).
      accepts: further demands on what is chosen together. rank: which of several alternatives comes first.

    Their number may grow exponentially with the size of the expression: take as many as are needed.
    """
    return _Search(accepts, rank).made(expression, True, {})


class _Search:
    def __init__(self, accepts: Accepts, rank: Ranking):
        self.accepts, self.rank = accepts, rank

    def made(self, e: Expression, value: bool, chosen: Reading) -> Iterator[Reading]:
        """All ways to extend the chosen literals so that the expression has this truth."""
        match e:
            case Atom():
                if e in chosen:
                    if chosen[e] == value:
                        yield chosen
                elif self.accepts(chosen, e, value):
                    yield {**chosen, e: value}
            case Not(part):
                yield from self.made(part, not value, chosen)
            case And(parts) | Or(parts):
                if isinstance(e, And) == value:
                    yield from self.every([(p, value) for p in parts], chosen)
                else:
                    for part in self.rank(parts, value):
                        yield from self.made(part, value, chosen)
            case Exactly(count, parts):
                counts = [count] if value else [n for n in range(len(parts) + 1) if n != count]
                for n in counts:
                    yield from self.exactly(n, parts, chosen)
            case Pairing(count, rows):
                if value:
                    yield from self.matched(count, rows, frozenset(), chosen)
                else:
                    yield from self.unmatched(count, rows, chosen)
            case _:
                raise TypeError(f"{e!r} is not a ground expression")

    def every(self, parts: Sequence[tuple[Expression, bool]], chosen: Reading) -> Iterator[Reading]:
        if not parts:
            yield chosen
            return
        (first, value), *rest = parts
        for extended in self.made(first, value, chosen):
            yield from self.every(rest, extended)

    def exactly(self, count: int, parts: Sequence[Expression], chosen: Reading) -> Iterator[Reading]:
        if count > len(parts):
            return
        ranked = self.rank(parts, True)
        for some in itertools.combinations(range(len(ranked)), count):
            yield from self.every([(p, n in some) for n, p in enumerate(ranked)], chosen)

    def matched(
        self, count: int, rows: Sequence[Sequence[Expression | None]], taken: frozenset[int], chosen: Reading
    ) -> Iterator[Reading]:
        """`count` of the rows, each with a column of its own."""
        if count == 0:
            yield chosen
            return
        if len(rows) < count:
            return
        first, *rest = rows
        free = {part: n for n, part in enumerate(first) if part is not None and n not in taken}
        for part in self.rank(tuple(free), True):
            for extended in self.made(part, True, chosen):
                yield from self.matched(count - 1, rest, taken | {free[part]}, extended)
        yield from self.matched(count, rest, taken, chosen)

    def unmatched(self, count: int, rows: Sequence[Sequence[Expression | None]], chosen: Reading) -> Iterator[Reading]:
        """So few rows, or so few columns, with a part that holds, that there are not `count` of them."""
        columns = tuple(zip(*rows, strict=True))
        for lines in (rows, columns):
            fewest = len(lines) - count + 1
            for some in itertools.combinations(lines, max(fewest, 0)):
                yield from self.every([(p, False) for line in some for p in line if p is not None], chosen)
