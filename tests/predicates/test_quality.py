"""q, the partial credit of an episode."""

import pytest

from ig2mj.predicates.logic import And, Atom, Or
from ig2mj.predicates.quality import quality

A, B, C, D = (Atom(name, ("x",)) for name in "abcd")
ATOMS = (A, B, C, D)


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
