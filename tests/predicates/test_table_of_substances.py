"""Predicates of substances against their definitions: more than 200 cases, each a world of one batch."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from substance_world import SUBSTANCES, world

from ig2mj.predicates import find
from ig2mj.predicates.base import Context
from ig2mj.predicates.substances import substance_names
from ig2mj.states import RelationPlan, initial_states

pytestmark = pytest.mark.slow

HOME = world()
MODEL = HOME.model()
CONTAINERS = [t.name for t in HOME.things if t.inside is not None]
JUG, GLASS, SPONGE = (HOME.index[n] for n in ("jug", "glass", "sponge"))
LITRES = {"jug": 2.0, "glass": 0.64}

AMOUNTS = [0, 1e-6, 5e-5, 9.9e-5, 1.01e-4, 1e-3, 0.01, 0.05, 0.1, 0.127, 0.1281, 0.2, 0.3, 0.399, 0.4001, 0.5, 0.6]
MIXED = [0.0, 2e-4, 0.1, 0.39, 0.41, 0.9]


def _cases() -> list[tuple[dict, str, tuple, bool]]:
    """(what is set, predicate, arguments, truth by the definition)."""
    found: list[tuple[dict, str, tuple, bool]] = []
    for name, litres in LITRES.items():
        for amount in AMOUNTS:
            set_to = {("volume", name, "water"): amount}
            found += [
                (set_to, "filled", (name, "water"), amount > 0.2 * litres),
                (set_to, "contains", (name, "water"), amount >= 1e-4),
                (set_to, "empty", (name,), amount < 1e-4),
            ]
    for water in MIXED:
        for oil in MIXED:
            both = {("volume", "jug", "water"): water, ("volume", "jug", "olive_oil"): oil}
            found += [
                (both, "filled", ("jug", "water"), water > 0.4),
                (both, "contains", ("jug", "olive_oil"), oil >= 1e-4),
                (both, "present", ("olive_oil",), oil >= 1e-4),
            ]
    for substance in SUBSTANCES:
        for bits in (0, 1, 2**19, 2**20 - 1):
            covers = {("coat", "sponge", substance): bits}
            found.append((covers, "covered", ("sponge", substance), bits > 0))
            found.append((covers, "present", (substance,), bits > 0))
            found.append((covers, "covered", ("jug", substance), False))
    for substance in SUBSTANCES[1:]:
        for drops in (0.0, 0.5, 0.99, 1.0, 3.0):
            found.append(({("absorbed", "sponge", substance): drops}, "saturated", ("sponge", substance), drops >= 1))
    for drops in (0.0, 0.5, 1.0, 4.0):
        found.append(({("wetness", "sponge", ""): drops}, "saturated", ("sponge", "water"), drops >= 1))
        found.append(({("wetness", "sponge", ""): drops}, "soaked", ("sponge",), drops >= 1))
    for celsius in (-20.0, 23.0, 39.99, 40.0, 100.0):
        found.append(({("temperature", "jug", ""): celsius}, "hot", ("jug",), celsius >= 40))
    for substance in SUBSTANCES[:1]:
        found.append(({("stock", "glass", substance): 1}, "insource", ("glass", substance), True))
        found.append(({("stock", "glass", substance): 0}, "insource", ("glass", substance), False))
    found.append(({}, "insource", ("sink", "water"), True))
    found.append(({}, "real", ("jug",), True))
    return found


CASES = _cases()


@pytest.fixture(scope="module")
def states():
    """A world for each case."""
    one = jax.tree.map(np.asarray, initial_states(MODEL, 1))
    arrays = {
        name: np.repeat(getattr(one, name), len(CASES), axis=0)
        for name in ("volume", "coat", "absorbed", "wetness", "temperature", "stock")
    }
    for number, (values, *_) in enumerate(CASES):
        for (field, obj, substance), value in values.items():
            at = HOME.index[obj]
            if field in ("volume", "stock"):
                arrays[field][number, CONTAINERS.index(obj), SUBSTANCES.index(substance)] = value
            elif field in ("coat", "absorbed"):
                arrays[field][number, MODEL.substances.row[at], SUBSTANCES.index(substance)] = value
            else:
                arrays[field][number, at] = value
    whole = jax.tree.map(lambda a: np.repeat(a, len(CASES), axis=0), one)
    return whole.replace(**arrays)


def test_the_table_has_more_than_200_cases():
    assert len(CASES) > 200


@pytest.mark.parametrize("name", sorted({name for _, name, _, _ in CASES}))
def test_a_predicate_agrees_with_its_definition(states, name):
    predicate, names = find(name), substance_names(MODEL)
    mine = [n for n, case in enumerate(CASES) if case[1] == name]
    rows = [[names.index(a) if a in names else HOME.index[a] for a in CASES[n][2]] for n in mine]
    picked = jax.tree.map(lambda a: jnp.asarray(a[np.array(mine)]), states)
    view = HOME.view(worlds=len(mine))
    relations = RelationPlan.build(MODEL, []).evaluate(view)
    truth = np.asarray(predicate.evaluate(Context(MODEL, picked, view, relations), np.array(rows)))
    wrong = [CASES[n] for k, n in enumerate(mine) if bool(truth[k, k]) != CASES[n][3]]
    assert not wrong
