"""Truth of a ground expression, and the share of it that is fulfilled, from the truth of its atoms.

Both are unrolled while tracing; every value is an array over worlds. Plain literals (atoms, and atoms with a `not`) of
one connective are taken together as one array, so that a goal of many literals stays a few operations.

Axes: W worlds, L atoms, N parts, M rows of a pairing.
"""

from __future__ import annotations

import dataclasses
import functools
import operator
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from ig2mj.engine.view import Array
from ig2mj.predicates.logic import And, Atom, Exactly, Expression, Not, Or, Pairing

Rows = Sequence[Sequence[Expression | None]]

LESS_THAN_ONE = 0.99
"""The most that a quantifier that does not hold scores."""


@dataclasses.dataclass(frozen=True)
class Truth:
    """Truth of atoms in all worlds, and where each atom stands on the L axis."""

    values: Bool[Array, "W L"]
    index: dict[Atom, int]

    @property
    def worlds(self) -> int:
        return self.values.shape[0]

    @property
    def xp(self) -> Any:
        """The library of the arrays: JAX's, or NumPy for one question on the host, which then compiles nothing."""
        return self.values.__array_namespace__()


class Score(NamedTuple):
    """Progress of an expression towards its required truth, 0 to 1, and its weight in literals."""

    value: Float[Array, "W"]
    weight: float


def holds(e: Expression, truth: Truth) -> Bool[Array, "W"]:
    """Whether the expression is true."""
    match e:
        case Atom():
            return truth.values[:, truth.index[e]]
        case Not(part):
            return ~holds(part, truth)
        case And(parts):
            return truth.xp.all(_each(parts, truth), axis=-1)
        case Or(parts):
            return truth.xp.any(_each(parts, truth), axis=-1)
        case Exactly(count, parts):
            return truth.xp.sum(_each(parts, truth), axis=-1) == count
        case Pairing(count, rows):
            grid = _grid(rows, lambda p: holds(p, truth), truth)
            return truth.xp.minimum(_with_true(grid, 0), _with_true(grid, 1)) >= count
    raise TypeError(f"{e!r} is not a ground expression")


def fraction(e: Expression, truth: Truth) -> Float[Array, "W"]:
    """Share of literals that are as the expression wants them; 1 exactly where it holds.

    A conjunction counts the literals of its parts. Of a disjunction, and of what exists, the part that is nearest to
    holding counts; exactly n, and pairs, count the n nearest, less what is too much. A plain conjunction of literals
    thus has iGibson's share of satisfied conditions.
    """
    return _score(e, truth, True).value


def _score(e: Expression, truth: Truth, expected: bool) -> Score:
    match e:
        case Atom():
            return Score((holds(e, truth) == expected).astype(np.float32), 1.0)
        case Not(part):
            return _score(part, truth, not expected)
        case And(parts) | Or(parts):
            return (_mean if isinstance(e, And) == expected else _best)(parts, truth, expected)
        case Exactly(count, parts):
            near = truth.xp.stack(
                [_score(p, truth, True).value for p in parts] or [truth.xp.zeros(truth.worlds, np.float32)]
            )
            extra = truth.xp.maximum(truth.xp.sum(near >= 1.0, axis=0) - count, 0)
            share = (_sum_of_best(near, count) - extra) / max(count, len(parts), 1)
            return _quantified(holds(e, truth), share, count, expected)
        case Pairing(count, rows):
            grid = _grid(rows, lambda p: _score(p, truth, True).value, truth)
            sides = [_sum_of_best(truth.xp.max(grid, axis=axis, initial=0.0), count) for axis in (0, 1)]
            return _quantified(holds(e, truth), truth.xp.minimum(*sides) / max(count, 1), count, expected)
    raise TypeError(f"{e!r} is not a ground expression")


def _mean(parts: Sequence[Expression], truth: Truth, expected: bool) -> Score:
    plain, rest = _literals(parts)
    others = [_score(p, truth, expected) for p in rest]
    total = float(len(plain) + sum(s.weight for s in others))
    if not total:
        return Score(truth.xp.ones(truth.worlds, np.float32), 0.0)
    values = [s.weight * s.value for s in others]
    if plain:
        values.append(truth.xp.sum(_literal_values(plain, truth) == expected, axis=-1).astype(np.float32))
    value = functools.reduce(operator.add, values)
    return Score(value / total, total)


def _best(parts: Sequence[Expression], truth: Truth, expected: bool) -> Score:
    plain, rest = _literals(parts)
    others = [_score(p, truth, expected) for p in rest]
    values = [s.value for s in others]
    if plain:
        values.append(truth.xp.any(_literal_values(plain, truth) == expected, axis=-1).astype(np.float32))
    if not values:
        return Score(truth.xp.zeros(truth.worlds, np.float32), 1.0)
    return Score(truth.xp.max(truth.xp.stack(values), axis=0), max([1.0, *(s.weight for s in others)]))


def _sum_of_best(values: Float[Array, "N W"], count: int) -> Float[Array, "W"]:
    xp = values.__array_namespace__()
    first = np.arange(len(values))
    earlier = first[:, None] < first  # of equal values the earlier counts as better; no sort, see `xla_small_call`
    better = (values[:, None] > values) | ((values[:, None] == values) & earlier[..., None])
    return xp.sum(xp.where(xp.sum(better, axis=0) < count, values, xp.zeros_like(values)), axis=0)


def _quantified(true: Bool[Array, "W"], share: Float[Array, "W"], count: int, expected: bool) -> Score:
    xp = true.__array_namespace__()
    share = xp.clip(share, 0.0, LESS_THAN_ONE) if expected else xp.zeros_like(share)
    return Score(xp.where(true == expected, 1.0, share), float(max(count, 1)))


def _each(parts: Sequence[Expression], truth: Truth) -> Bool[Array, "W N"]:
    """Truth of the parts, plain literals first."""
    plain, rest = _literals(parts)
    found = [_literal_values(plain, truth)] if plain else []
    found += [holds(p, truth)[:, None] for p in rest]
    if not found:
        return truth.xp.zeros((truth.worlds, 0), bool)
    return truth.xp.concatenate(found, axis=-1) if len(found) > 1 else found[0]


def _literals(parts: Sequence[Expression]) -> tuple[list[Expression], list[Expression]]:
    """Plain literals among the parts, and the rest."""
    plain: list[Expression] = [
        p for p in parts if isinstance(p, Atom) or (isinstance(p, Not) and isinstance(p.part, Atom))
    ]
    return plain, [p for p in parts if p not in plain]


def _literal_values(plain: Sequence[Expression], truth: Truth) -> Bool[Array, "W N"]:
    atoms = [p.part if isinstance(p, Not) else p for p in plain]
    place = np.array([truth.index[a] for a in atoms if isinstance(a, Atom)], int)
    negated = np.array([isinstance(p, Not) for p in plain])
    straight = len(place) == truth.values.shape[1] and (place == np.arange(len(place))).all()
    return (truth.values if straight else truth.values[:, place]) ^ negated


def _grid(rows: Rows, value: Callable[[Expression], Array], truth: Truth) -> Float[Array, "M N W"]:
    """Values of the parts; 0 where an object would be paired with itself."""
    width = len(rows[0]) if rows else 0
    xp, shape = truth.xp, (len(rows), width, truth.worlds)
    none = xp.zeros(truth.worlds, np.float32)
    cells = [none if p is None else xp.asarray(value(p), np.float32) for row in rows for p in row]
    return xp.stack(cells).reshape(shape) if cells else xp.zeros(shape, np.float32)


def _with_true(grid: Float[Array, "M N W"], axis: int) -> Array:
    """How many rows (axis 1) or columns (axis 0) have a true cell."""
    xp = grid.__array_namespace__()
    return xp.sum(xp.any(grid >= 1.0, axis=axis), axis=0)
