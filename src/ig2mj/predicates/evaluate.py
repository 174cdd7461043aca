"""Truth of a ground expression from the truth of its atoms, and how much of it is fulfilled.

Both are unrolled while tracing; every value is an array over worlds.

Axes: W worlds, N parts, M rows of a pairing.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Bool, Float

from ig2mj.engine.view import Array
from ig2mj.predicates.logic import And, Atom, Exactly, Expression, Not, Or, Pairing

Truth = Mapping[Atom, Bool[Array, "W"]]
Rows = Sequence[Sequence[Expression | None]]

LESS_THAN_ONE = 0.99
"""The most that a quantifier that does not hold scores."""


class Score(NamedTuple):
    """How near an expression is to being as wanted, 0 to 1, and for how many literals that counts."""

    value: Float[Array, "W"]
    weight: float


def holds(e: Expression, truth: Truth, worlds: int) -> Bool[Array, "W"]:
    """Whether the expression is true."""
    match e:
        case Atom():
            return truth[e]
        case Not(part):
            return ~holds(part, truth, worlds)
        case And(parts):
            return jnp.all(_stacked(parts, truth, worlds), axis=0)
        case Or(parts):
            return jnp.any(_stacked(parts, truth, worlds), axis=0)
        case Exactly(count, parts):
            return jnp.sum(_stacked(parts, truth, worlds), axis=0) == count
        case Pairing(count, rows):
            grid = _grid(rows, lambda p: holds(p, truth, worlds), worlds)
            return jnp.minimum(_with_true(grid, 0), _with_true(grid, 1)) >= count
    raise TypeError(f"{e!r} is no ground expression")


def fraction(e: Expression, truth: Truth, worlds: int) -> Float[Array, "W"]:
    """Share of literals that are as the expression wants them; 1 exactly where it holds.

    A conjunction counts the literals of its parts. Of a disjunction, and of what exists, the part that is nearest to
    holding counts; exactly n, and pairs, count the n nearest, less what is too much. A plain conjunction of literals
    thus has iGibson's share of satisfied conditions.
    """
    return _score(e, truth, True, worlds).value


def _score(e: Expression, truth: Truth, wanted: bool, worlds: int) -> Score:
    match e:
        case Atom():
            return Score((truth[e] == wanted).astype(jnp.float32), 1.0)
        case Not(part):
            return _score(part, truth, not wanted, worlds)
        case And(parts) | Or(parts):
            found = [_score(p, truth, wanted, worlds) for p in parts]
            return _mean(found, worlds) if isinstance(e, And) == wanted else _best(found, worlds)
        case Exactly(count, parts):
            near = jnp.stack([_score(p, truth, True, worlds).value for p in parts] or [jnp.zeros(worlds)])
            extra = jnp.maximum(jnp.sum(near >= 1.0, axis=0) - count, 0)
            share = (_sum_of_best(near, count) - extra) / max(count, len(parts), 1)
            return _quantified(holds(e, truth, worlds), share, count, wanted)
        case Pairing(count, rows):
            grid = _grid(rows, lambda p: _score(p, truth, True, worlds).value, worlds)
            sides = [_sum_of_best(jnp.max(grid, axis=axis, initial=0.0), count) for axis in (0, 1)]
            return _quantified(holds(e, truth, worlds), jnp.minimum(*sides) / max(count, 1), count, wanted)
    raise TypeError(f"{e!r} is no ground expression")


def _mean(found: Sequence[Score], worlds: int) -> Score:
    total = sum(s.weight for s in found)
    if not total:
        return Score(jnp.ones(worlds), 0.0)
    return Score(jnp.sum(jnp.stack([s.weight * s.value for s in found]), axis=0) / total, total)


def _best(found: Sequence[Score], worlds: int) -> Score:
    if not found:
        return Score(jnp.zeros(worlds), 1.0)
    return Score(jnp.max(jnp.stack([s.value for s in found]), axis=0), max(1.0, *(s.weight for s in found)))


def _sum_of_best(values: Float[Array, "N W"], count: int) -> Float[Array, "W"]:
    return jnp.sum(jnp.sort(values, axis=0)[::-1][:count], axis=0)


def _quantified(true: Bool[Array, "W"], share: Float[Array, "W"], count: int, wanted: bool) -> Score:
    share = jnp.clip(share, 0.0, LESS_THAN_ONE) if wanted else jnp.zeros_like(share)
    return Score(jnp.where(true == wanted, 1.0, share), float(max(count, 1)))


def _stacked(parts: Sequence[Expression], truth: Truth, worlds: int) -> Bool[Array, "N W"]:
    return jnp.stack([holds(p, truth, worlds) for p in parts]) if parts else jnp.zeros((0, worlds), bool)


def _grid(rows: Rows, value, worlds: int) -> Float[Array, "M N W"]:
    """Values of the parts; 0 where an object would be paired with itself."""
    width = len(rows[0]) if rows else 0
    cells = [jnp.zeros(worlds) if p is None else value(p).astype(jnp.float32) for row in rows for p in row]
    return jnp.stack(cells).reshape(len(rows), width, worlds) if cells else jnp.zeros((len(rows), width, worlds))


def _with_true(grid: Float[Array, "M N W"], axis: int) -> Array:
    """How many rows (axis 1) or columns (axis 0) have a true cell."""
    return jnp.sum(jnp.any(grid >= 1.0, axis=axis), axis=0)
