"""Readings: what is chosen makes the expression true, whatever the rest is."""

from __future__ import annotations

import itertools

import hypothesis.strategies as st
import pytest
from hypothesis import given

from ig2mj.predicates.cheapest import cheapest
from ig2mj.predicates.explain import value_of
from ig2mj.predicates.logic import And, Atom, Exactly, Expression, ForPairs, Not, Or, Pairing, atom, ground
from ig2mj.predicates.readings import readings

ATOMS = [Atom("open", (name,)) for name in "abcd"]


LEAF = st.integers(0, len(ATOMS) - 1)


def inner(part):
    several = st.lists(part, min_size=1, max_size=3)
    counted = st.tuples(st.just("exactly"), several, st.integers(0, 2))
    return st.one_of(LEAF, counted, *(st.tuples(st.just(kind), several) for kind in ("not", "and", "or")))


trees = inner(inner(LEAF))


def made(tree) -> Expression:
    """Expressions are made outside of strategies: checking their types draws random numbers."""
    if isinstance(tree, int):
        return ATOMS[tree]
    parts = tuple(map(made, tree[1]))
    if tree[0] == "exactly":
        return Exactly(tree[2], parts)
    return {"not": Not(parts[0]), "and": And(parts), "or": Or(parts)}[tree[0]]


def completions(chosen: dict):
    rest = [a for a in ATOMS if a not in chosen]
    for values in itertools.product((False, True), repeat=len(rest)):
        yield {**chosen, **dict(zip(rest, values, strict=True))}


@given(trees)
def test_a_reading_suffices_and_there_is_one_where_the_expression_can_hold(tree):
    e = made(tree)
    found = list(itertools.islice(readings(e), 20))
    assert all(value_of(e, table) for chosen in found for table in completions(chosen))
    assert bool(found) == any(value_of(e, table) for table in completions({}))


@given(trees, st.tuples(*[st.booleans()] * len(ATOMS)))
def test_what_holds_needs_no_change(tree, values):
    e = made(tree)
    truth = dict(zip(ATOMS, values, strict=True))

    def changes(atom, value):
        return float(truth[atom] != value)

    if value_of(e, truth):
        assert cheapest(e, changes)[0] == 0
    for chosen in itertools.islice(readings(e), 200):
        if all(truth[a] == value for a, value in chosen.items()):
            assert cheapest(e, changes)[0] == 0


def test_pairs_are_matched_each_object_once():
    pairs = ForPairs(("?b", "basket"), ("?c", "candle"), atom("inside", "?c", "?b"))
    groups = {"basket": ["b0", "b1"], "candle": ["c0", "c1", "c2"]}
    found = list(readings(ground(pairs, groups.__getitem__)))
    assert len(found) == 6, "two baskets, a candle of three for each"
    for chosen in found:
        candles, baskets = zip(*(a.arguments for a in chosen), strict=True)
        assert len(set(candles)) == len(set(baskets)) == 2


def test_a_pairing_is_false_where_too_few_rows_or_columns_hold():
    rows = tuple(tuple(Atom("inside", (c, b)) for c in "xy") for b in "vw")
    pairing = Pairing(2, rows)
    for chosen in readings(Not(pairing)):
        table = {a: chosen.get(a, True) for row in rows for a in row}
        assert not value_of(pairing, table)


def test_what_is_not_accepted_is_not_chosen_and_the_best_come_first():
    either = Or((ATOMS[0], ATOMS[1], ATOMS[2]))
    found = readings(either, lambda chosen, a, value: a != ATOMS[2], lambda options, value: options[::-1])
    assert [list(chosen) for chosen in found] == [[ATOMS[1]], [ATOMS[0]]]


def test_only_ground_expressions_are_read():
    with pytest.raises(TypeError, match="ground"):
        next(readings(ForPairs(("?a", "x"), ("?b", "y"), ATOMS[0])))
