"""Transition rules that use up or make objects: recipes, melting, dicing; what exists; conservation."""

from __future__ import annotations

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hand_world import HandWorld, Item, step
from substance_world import FLOOR, container

from ig2mj.states import initial_states
from ig2mj.states.added_checks import AddedUpdates
from ig2mj.states.substances import things, volume

SMALL = (((0, 0, 0), (0.03, 0.03, 0.03)),)
LITRES = 8 * 0.03**3 * 1000
"""Of an object of `SMALL`."""

NAMES = ("flour", "water", "salt", "melted__butter", "diced__apple", "cooked__diced__apple", "smoothie", "bagel_dough")
KITCHEN = HandWorld(
    FLOOR,
    container("pot", (0.1, 0.1, 0.1), (0, 0, 0.2), category="saucepan"),
    container("blender", (0.1, 0.1, 0.1), (1, 0, 0.2), category="blender", abilities={"toggleable": {}}),
    Item("butter", SMALL, category="butter", pos=(0, 0, 0.15), abilities={"freezable": {}}),
    Item("spoon", SMALL, category="spoon", pos=(3, 0, 0)),
    Item("apple", SMALL, {"sliceable": {}}, category="apple", pos=(0, 2, 1), parts={"left": (0, 0, 0)}),
    Item("left", SMALL, category="half_apple", pos=(0, 2, 9), part_of="apple", parked=True),
    Item("plate", (((0, 0, 0), (0.1, 0.1, 0.01)),), category="plate", pos=(0, 2, 0.9)),
    Item("knife", SMALL, {"slicer": {}}, links={"slicer": ((0, 0, 0), (0.01, 0.01, 0.01))}, pos=(4, 0, 0)),
    Item("ice_0", SMALL, category="ice_cube", pos=(0, -20, 0)),
    Item("ice_1", SMALL, category="ice_cube", pos=(0, -20, 0)),
    Item("pie_0", SMALL, category="pastry", pos=(0, -20, 0)),
    substances=NAMES,
)
MODEL, VIEW = KITCHEN.model(), KITCHEN.view()
THINGS = things.of(MODEL)


def _states(absent=(), **litres: float):
    states = initial_states(MODEL, 1)
    for key, value in litres.items():
        name, _, substance = key.partition("_")
        states = volume.set_volume(MODEL, states, KITCHEN.index[name], substance, value)
    for name in absent:
        states = things.set_real(MODEL, states, KITCHEN.index[name], False)
    return states


def _at(states, name: str, celsius: float):
    return states.replace(temperature=jnp.asarray(states.temperature).at[0, KITCHEN.index[name]].set(celsius))


def _in(states, name: str) -> dict[str, float]:
    row = MODEL.substances.containers.row_of(KITCHEN.index[name])
    return {s: round(float(v), 4) for s, v in zip(NAMES, states.volume[0, row], strict=True) if v > 0}


def _exists(states, name: str) -> bool:
    return not bool(things.absent(MODEL, states)[0, KITCHEN.index[name]])


def _total(states) -> float:
    return float(np.sum(states.volume) + np.sum(states.lost) - np.sum(states.drawn))


def test_objects_that_no_rule_names_do_not_come_and_go():
    names = {KITCHEN.things[o].name for o in THINGS.object}
    assert names == {"butter", "apple", "left", "ice_0", "ice_1", "pie_0"}


def test_butter_in_a_warm_pot_melts_and_is_gone():
    states = _at(_at(_states(), "butter", 60.0), "pot", 60.0)
    states = step(MODEL, step(MODEL, states, VIEW), VIEW)
    assert _in(states, "pot") == {"melted__butter": pytest.approx(LITRES, rel=1e-3)}
    assert not _exists(states, "butter") and _total(states) == pytest.approx(0, abs=1e-6)
    assert _in(step(MODEL, states, VIEW), "pot") == _in(states, "pot")  # once


@pytest.mark.slow
def test_what_melts_outside_of_containers_covers_what_it_lies_on():
    view = KITCHEN.view({"butter": (0, 2, 0.94)}, touching=[("butter", "plate")])
    states = _at(_states(), "butter", 60.0)
    states = step(MODEL, step(MODEL, states, view), view)
    row = MODEL.substances.row[KITCHEN.index["plate"]]
    assert states.coat[0, row, NAMES.index("melted__butter")] > 0
    assert float(states.lost[0, NAMES.index("melted__butter")]) == pytest.approx(LITRES, rel=1e-3)


def test_cold_butter_does_not_melt():
    states = step(MODEL, step(MODEL, _states(), VIEW), VIEW)
    assert _exists(states, "butter") and _in(states, "pot") == {}


@pytest.mark.slow
@pytest.mark.parametrize("cooked, becomes", [(False, "diced__apple"), (True, "cooked__diced__apple")])
def test_a_blade_dices_halves_and_not_wholes(cooked, becomes):
    pressed = KITCHEN.view({"left": (0, 0, 0.2)}, force={("knife", "left"): 12.0, ("knife", "apple"): 12.0})
    states = _states()
    whole = step(MODEL, states, KITCHEN.view(force={("knife", "left"): 12.0}))  # the half is parked
    assert _in(whole, "pot") == {}
    states = states.replace(sliced=jnp.asarray(states.sliced).at[0, KITCHEN.index["apple"]].set(True))
    if cooked:
        states = states.replace(max_temperature=jnp.full_like(states.max_temperature, 80.0))
        cook = dataclasses.replace(MODEL.parameters, cook_temperature=np.full(len(KITCHEN.things), 70.0, np.float32))
        model = dataclasses.replace(MODEL, parameters=cook)
    else:
        model = MODEL
    states = step(model, states, KITCHEN.view())
    states = step(model, states, pressed)
    assert _in(states, "pot") == {becomes: pytest.approx(LITRES, rel=1e-3)}
    assert not _exists(states, "left") and _exists(states, "apple")


def test_a_recipe_uses_up_its_objects_and_makes_one():
    litres = {"pot_flour": 0.3, "pot_water": 0.2, "pot_salt": 0.1}
    stirring = KITCHEN.view(touching=[("spoon", "pot")])
    none_to_make = step(MODEL, _states(**litres), stirring)
    assert _in(none_to_make, "pot") == {"flour": 0.3, "water": 0.2, "salt": 0.1}
    states = _states(absent=["pie_0"], **litres)
    before = _total(states)
    states = step(MODEL, states, stirring)
    assert _exists(states, "pie_0") and not _exists(states, "butter") and _in(states, "pot") == {}
    assert _total(states) == pytest.approx(before, abs=1e-6)


@pytest.mark.slow
def test_without_its_object_a_recipe_waits():
    view = KITCHEN.view({"butter": (2, 2, 2)}, touching=[("spoon", "pot")])
    states = step(MODEL, _states(absent=["pie_0"], pot_flour=0.3, pot_water=0.2, pot_salt=0.1), view)
    assert not _exists(states, "pie_0") and len(_in(states, "pot")) == 3


@pytest.mark.slow
def test_water_that_is_cold_becomes_as_many_cubes_as_there_are():
    states = _at(_states(absent=["ice_0", "ice_1"], blender_water=0.5), "blender", -10.0)
    states = step(MODEL, step(MODEL, states, VIEW), VIEW)
    assert _exists(states, "ice_0") and _exists(states, "ice_1") and _in(states, "blender") == {}


@pytest.mark.slow
def test_many_worlds_do_what_one_does():
    one = _at(_at(_states(absent=["pie_0"], pot_water=0.1), "butter", 60.0), "pot", 60.0)
    other = _states(absent=["pie_0", "ice_0"], pot_flour=0.3, pot_water=0.2, pot_salt=0.1)
    both = jax.tree.map(lambda a, b: jnp.concatenate([a, b]), one, other)
    views = KITCHEN.view(touching=[("spoon", "pot")], worlds=2)
    for _ in range(2):
        both = step(MODEL, both, views)
        one, other = (step(MODEL, s, KITCHEN.view(touching=[("spoon", "pot")])) for s in (one, other))
    np.testing.assert_allclose(both.volume, jnp.concatenate([one.volume, other.volume]), atol=1e-6)
    np.testing.assert_array_equal(both.absent, jnp.concatenate([one.absent, other.absent]))


@pytest.mark.slow
def test_what_is_baked_is_as_warm_as_its_container_and_cooked():
    model = dataclasses.replace(
        MODEL, parameters=dataclasses.replace(MODEL.parameters, cook_temperature=np.full(len(KITCHEN.things), 70.0))
    )
    states = _at(_states(absent=["ice_0"], blender_water=0.5), "blender", -10.0)
    states = step(model, step(model, states, VIEW), VIEW)
    warmth = float(states.temperature[0, KITCHEN.index["ice_0"]])
    assert -10 <= warmth < -9 and not states.hatched.any()


def test_incremental_steps_are_not_whole_ones_because_of_rules():
    added = AddedUpdates.of(MODEL)
    assert not added.whole
