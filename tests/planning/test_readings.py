"""Ground readings of a goal, and q, the partial credit of an episode."""

import itertools
import math

import hypothesis
import hypothesis.strategies as st
import pytest

from ig2mj.planning.readings import cheapest, quality
from ig2mj.predicates.explain import value_of
from ig2mj.predicates.logic import And, Atom, Exactly, Not, Or, Pairing

A, B, C, D = (Atom(name, ("x",)) for name in "abcd")
ATOMS = (A, B, C, D)


def goals():
    literal = st.sampled_from(ATOMS)
    return st.recursive(
        literal,
        lambda inner: st.one_of(
            inner.map(Not),
            st.lists(inner, min_size=1, max_size=3).map(lambda p: And(tuple(p))),
            st.lists(inner, min_size=1, max_size=3).map(lambda p: Or(tuple(p))),
            st.tuples(st.integers(0, 2), st.lists(literal, min_size=2, max_size=3)).map(
                lambda p: Exactly(p[0], tuple(p[1]))
            ),
        ),
        max_leaves=6,
    )


@hypothesis.given(goals(), st.lists(st.booleans(), min_size=4, max_size=4))
def test_a_cheapest_reading_of_finite_cost_makes_the_goal_true(goal, now):
    truth = dict(zip(ATOMS, now, strict=True))
    cost, reading = cheapest(goal, lambda atom, wanted: float(truth[atom] != wanted))
    if not math.isinf(cost):
        assert value_of(goal, {**truth, **reading})
    if value_of(goal, truth):
        assert cost == 0


def test_a_reading_takes_the_cheaper_alternative_and_none_that_cannot_be():
    price = {A: 5.0, B: 1.0, C: math.inf, D: 2.0}

    def cost(atom, wanted):
        return price[atom] if wanted else 0.0

    assert cheapest(Or((A, B)), cost) == (1.0, {B: True})
    assert cheapest(Or((A, C)), cost) == (5.0, {A: True})
    assert math.isinf(cheapest(And((A, C)), cost)[0])
    assert cheapest(Exactly(1, (A, B, D)), cost) == (1.0, {A: False, B: True, D: False})


def test_a_pairing_is_the_cheapest_assignment():
    cells = {(i, j): Atom("p", (str(i), str(j))) for i in range(3) for j in range(3)}
    price = {(0, 0): 1, (0, 1): 2, (0, 2): 9, (1, 0): 1, (1, 1): 9, (1, 2): 9, (2, 0): 9, (2, 1): 9, (2, 2): 3}
    pairing = Pairing(3, tuple(tuple(cells[i, j] for j in range(3)) for i in range(3)))
    cost, reading = cheapest(pairing, lambda atom, wanted: float(price[tuple(map(int, atom.arguments))]))
    best = min(sum(price[i, j] for i, j in enumerate(order)) for order in itertools.permutations(range(3)))
    assert cost == best == 6 and reading == {cells[0, 1]: True, cells[1, 0]: True, cells[2, 2]: True}


def test_q_counts_what_was_gained_less_what_was_lost():
    start = {A: False, B: False, C: True, D: False}
    goal = And((A, B, C, D))
    assert quality(goal, start, start) == 0
    assert quality(goal, start, start | {A: True}) == pytest.approx(1 / 3)
    assert quality(goal, start, start | {A: True, B: True, C: False}) == pytest.approx(1 / 3)
    assert quality(goal, start, start | {C: False}) == 0
    assert quality(goal, start, dict.fromkeys(ATOMS, True)) == 1


def test_q_is_that_of_the_best_alternative():
    start = dict.fromkeys(ATOMS, False)
    goal = And((Or((And((A, B)), And((C, D)))),))
    assert quality(goal, start, start | {A: True}) == pytest.approx(0.5)
    assert quality(Or((And((A, B, C)), D)), start, start | {A: True, B: True}) == pytest.approx(2 / 3)
    assert quality(Or((A, B)), {A: True, B: False}, {A: True, B: False}) == 1
