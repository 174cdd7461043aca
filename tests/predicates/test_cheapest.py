"""The ground reading of least cost."""

import itertools
import math
import random

import pytest

from ig2mj.predicates.cheapest import cheapest
from ig2mj.predicates.explain import value_of
from ig2mj.predicates.logic import And, Atom, Exactly, Not, Or, Pairing

A, B, C, D = (Atom(name, ("x",)) for name in "abcd")
ATOMS = (A, B, C, D)


def random_goal(rng: random.Random, depth: int = 3):
    kind = rng.randrange(5) if depth else 4
    parts = tuple(random_goal(rng, depth - 1) for _ in range(rng.randint(1, 3))) if kind < 3 else ()
    if kind == 3:
        return Exactly(rng.randint(0, 2), tuple(rng.sample(ATOMS, rng.randint(2, 3))))
    return [lambda: And(parts), lambda: Or(parts), lambda: Not(parts[0]), None, lambda: rng.choice(ATOMS)][kind]()


@pytest.mark.parametrize("seed", range(5))
def test_a_cheapest_reading_of_finite_cost_makes_the_goal_true(seed):
    rng = random.Random(seed)
    for _ in range(60):
        _check_reading(random_goal(rng), [rng.random() < 0.5 for _ in ATOMS])


def _check_reading(goal, now):
    truth = dict(zip(ATOMS, now, strict=True))
    cost, reading = cheapest(goal, lambda atom, expected: float(truth[atom] != expected))
    if not math.isinf(cost):
        assert value_of(goal, {**truth, **reading})
    if value_of(goal, truth):
        assert cost == 0


def test_a_reading_takes_the_cheaper_alternative_and_none_that_cannot_be():
    price = {A: 5.0, B: 1.0, C: math.inf, D: 2.0}

    def cost(atom, expected):
        return price[atom] if expected else 0.0

    assert cheapest(Or((A, B)), cost) == (1.0, {B: True})
    assert cheapest(Or((A, C)), cost) == (5.0, {A: True})
    assert math.isinf(cheapest(And((A, C)), cost)[0])
    assert cheapest(Exactly(1, (A, B, D)), cost) == (1.0, {A: False, B: True, D: False})


def test_a_pairing_is_the_cheapest_assignment():
    cells = {(i, j): Atom("p", (str(i), str(j))) for i in range(3) for j in range(3)}
    price = {(0, 0): 1, (0, 1): 2, (0, 2): 9, (1, 0): 1, (1, 1): 9, (1, 2): 9, (2, 0): 9, (2, 1): 9, (2, 2): 3}
    pairing = Pairing(3, tuple(tuple(cells[i, j] for j in range(3)) for i in range(3)))
    cost, reading = cheapest(pairing, lambda atom, expected: float(price[tuple(map(int, atom.arguments))]))
    best = min(sum(price[i, j] for i, j in enumerate(order)) for order in itertools.permutations(range(3)))
    assert cost == best == 6 and reading == {cells[0, 1]: True, cells[1, 0]: True, cells[2, 2]: True}


def test_parts_that_would_contradict_each_other_take_the_next_best():
    price = {A: 1.0, B: 4.0, C: 1.0, D: 2.0}
    goal = And((Or((A, B)), Or((And((C, Not(A))), And((D, Not(A))))), Or((A, C))))
    assert cheapest(goal, lambda atom, expected: price[atom] if expected else 0.0) == (
        6.0,
        {B: True, C: True, A: False},
    )
    assert math.isinf(cheapest(And((A, Not(A))), lambda atom, expected: 0.0)[0])


@pytest.mark.parametrize("seed", range(3))
def test_a_reading_is_found_exactly_where_the_goal_can_be_true(seed):
    rng = random.Random(seed)
    for _ in range(40):
        goal = random_goal(rng)
        price = {a: rng.randint(0, 9) for a in ATOMS}

        def cost(atom, expected, price=price):
            return float(price[atom] * expected)

        value, reading = cheapest(goal, cost)
        true = [
            t for values in itertools.product((False, True), repeat=4)
            if value_of(goal, t := dict(zip(ATOMS, values, strict=True)))
        ]  # fmt: skip
        assert math.isinf(value) == (not true)
        if true:
            assert sum(cost(a, w) for a, w in reading.items()) >= min(sum(price[a] * t[a] for a in ATOMS) for t in true)
