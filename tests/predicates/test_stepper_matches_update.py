"""`StateStepper` leaves work out and changes nothing: bitwise the states and verdicts of `update` in every step."""

from __future__ import annotations

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hand_world import HandWorld, Thing, shell

from ig2mj.predicates import compile_expression
from ig2mj.predicates.stepper import StateProgram, StateStepper
from ig2mj.states import dust, initial_states, update

FOOD = {"cookable": {}, "burnable": {}, "freezable": {}, "sliceable": {}, "stainable": {}}
SMALL = (((0, 0, 0), (0.05, 0.05, 0.05)),)
HOME = HandWorld(
    Thing("oven", shell(0.6, 0.6, 0.6), {"heatSource": {"temperature": 250.0, "requires_inside": True,
          "requires_toggled_on": True}, "toggleable": {}}, links={"toggle_button": (0, 0, 0.5)}),
    Thing("fish", SMALL, FOOD, pos=(3, 0, 1), parts={"half": (0, 0, 0)}),
    Thing("half", SMALL, FOOD, pos=(40, 0, 0), part_of="fish", parked=True),
    Thing("table", (((0, 0, 0), (1, 1, 0.02)),), {"dustyable": {}}, pos=(3, 0, 0)),
    Thing("rag", SMALL, {"cleaningTool": {}, "soakable": {}}, pos=(9, 0, 0)),
    Thing("tap", SMALL, {"waterSource": {}, "toggleable": {}}, links={"water_source": (0, 0, -0.1)}, pos=(9, 0, 1)),
    Thing("knife", SMALL, {"slicer": {}}, links={"slicer": ((0, 0, 0), (0.1, 0.1, 0.1))}, pos=(20, 0, 0)),
    fingers=1,
)  # fmt: skip
GOAL = """(and (cooked fish) (not (burnt fish)) (inside fish oven) (on_top fish table) (soaked rag) (dusty table)
               (sliced fish) (forn 1 (?x - thing) (in_contact_with ?x table)))"""
AWAY = [(0, 0, 9)]
VIEWS = [
    HOME.view(fingers=AWAY),
    HOME.view({"fish": (0, 0, 0)}, fingers=[(0, 0, 0.5)]),
    HOME.view({"rag": (3, 0, 0.06)}, touching=[("rag", "table")], fingers=AWAY),
    HOME.view({"fish": (3, 0, 0.08)}, touching=[("fish", "table")], fingers=AWAY),
    HOME.view(force={("knife", "fish"): 50.0}, fingers=AWAY),
]
# Which view each step sees; runs of one view let the stepper take its short way.
STORY = [0] * 4 + [1] * 8 + [0] * 3 + [2] * 5 + [3] * 4 + [0] * 6 + [4] * 3 + [0] * 3


def _start(model):
    states = initial_states(model, 1)
    points = np.tile([0.0, 0.0, 0.02], (1, 20, 1)).astype(np.float32)
    rows, _ = dust.set_dusty(
        model, states.dust, 0, jnp.full((1, 20), 4), jnp.asarray(points), jnp.asarray(points), jnp.ones((1, 20), bool)
    )
    return states.replace(dust=rows)


@pytest.mark.parametrize("options", [{}, {"contact_heat_rate": 0.1, "drying_rate": 0.5}])
def test_every_step_is_bitwise_the_same(options):
    model = HOME.model(**options)
    goal = compile_expression(model, GOAL)
    stepper = StateStepper(StateProgram(model, goal))

    @jax.jit
    def reference(states, view):
        states, swap = update(model, states, view)
        return states, swap, goal.verdict(states, view)

    ours = theirs = _start(model)
    swaps, short = 0, 0
    for k, number in enumerate(STORY):
        if k == 20:  # a hand on the switch of the tap, from outside
            flip = theirs.toggled.at[0, HOME.index["tap"]].set(True)
            ours, theirs = ours.replace(toggled=flip), theirs.replace(toggled=flip)
        short += stepper._kept is not None and stepper._view is VIEWS[number]
        ours, swap, verdict = stepper.step(ours, VIEWS[number])
        theirs, expected_swap, expected = reference(theirs, VIEWS[number])
        for a, b in zip(jax.tree.leaves(ours), jax.tree.leaves(theirs), strict=True):
            assert np.array_equal(np.asarray(a), np.asarray(b), equal_nan=True), f"step {k}"
        assert (swap is not None) == bool(expected_swap.mask.any())
        swaps += swap is not None
        for field in dataclasses.fields(expected):
            assert np.array_equal(getattr(verdict, field.name), getattr(expected, field.name)), (k, field.name)
    assert swaps == 1
    assert ours.sliced[0, HOME.index["half"]]
    assert ours.wetness[0, HOME.index["rag"]] > 0 and int(ours.dust.alive.sum()) == 0
    if not options:
        assert short > 5


def test_a_settled_world_is_left_alone_and_a_cooling_one_is_not():
    model = HOME.model()
    stepper = StateStepper(StateProgram(model, compile_expression(model, "(cooked fish)")))
    states = _start(model)
    for _ in range(3):
        states, _, _ = stepper.step(states, VIEWS[0])
    again, _, verdict = stepper.step(states, VIEWS[0])
    assert again is states and not verdict.holds[0]
    states = states.replace(temperature=states.temperature.at[0, 1].set(80.0))
    for _ in range(3):
        cooler, _, verdict = stepper.step(states, VIEWS[0])
        assert cooler.temperature[0, 1] < states.temperature[0, 1] and verdict.holds[0]
        states = cooler
    # Near 23 C single precision comes to rest, and is noticed.
    states = states.replace(temperature=states.temperature.at[0, 1].set(23.00001))
    for _ in range(70):
        before, (states, _, _) = states, stepper.step(states, VIEWS[0])
    assert states is before


def test_states_changed_from_outside_are_seen():
    model = HOME.model()
    goal = compile_expression(model, "(toggled_on oven)")
    stepper = StateStepper(StateProgram(model, goal))
    states = _start(model)
    for _ in range(3):
        states, _, verdict = stepper.step(states, VIEWS[0])
    assert not verdict.holds[0]
    states = states.replace(toggled=states.toggled.at[0, 0].set(True))
    states, _, verdict = stepper.step(states, VIEWS[0])
    assert verdict.holds[0]


def test_a_stepper_needs_no_goal():
    model = HOME.model()
    stepper = StateStepper(StateProgram(model))
    states = _start(model)
    for _ in range(3):
        states, swap, verdict = stepper.step(states, VIEWS[1])
    assert swap is None and verdict is None
    assert stepper._kept is None  # a finger is at the button: the count goes on
