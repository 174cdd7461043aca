"""Predicates of sliced objects: iGibson's rule, and a bug that is not copied."""

from __future__ import annotations

import numpy as np
import pytest
from hand_world import HandWorld, Item, world_of

from ig2mj.predicates import compile_expression
from ig2mj.states import initial_states

CUBE = (((0, 0, 0), (0.05, 0.05, 0.05)),)
FOOD = {"sliceable": {}, "freezable": {}}
HOME = HandWorld(
    Item("apple", CUBE, FOOD, parts={"left": (-0.02, 0, 0), "right": (0.02, 0, 0)}, pos=(60, 0, 0)),
    Item("left", CUBE, FOOD, part_of="apple", pos=(0, 0, 1)),
    Item("right", CUBE, FOOD, part_of="apple", pos=(5, 0, 1)),
    Item("table", (((0, 0, 0), (0.5, 0.5, 0.02)),), pos=(0, 0, 0.93)),
)


def _holds(text: str, touching: list[tuple[str, str]], cut: bool = True, **temperature: float) -> bool:
    states = initial_states(HOME.model(), 1)
    if cut:
        states = states.replace(sliced=states.sliced.at[0, :3].set(True))
    for name, value in temperature.items():
        states = states.replace(temperature=states.temperature.at[0, HOME.index[name]].set(value))
    goal = compile_expression(HOME.model(), text)
    return bool(goal(world_of(HOME.view(touching=touching), states))[0])


@pytest.mark.parametrize(("left", "right", "frozen"), [(-1.0, -1.0, True), (-1.0, 5.0, False)])
def test_a_predicate_of_a_sliced_object_asks_all_halves(left, right, frozen):
    assert _holds("(frozen apple)", [], left=left, right=right, apple=20.0) == frozen


def test_before_the_cut_the_whole_speaks_for_itself():
    assert _holds("(frozen apple)", [], cut=False, apple=-3.0)
    assert not _holds("(sliced apple)", [], cut=False)
    assert _holds("(sliced apple)", [])


def test_a_sliced_object_may_be_the_second_argument():
    assert _holds("(in_contact_with table apple)", [("table", "right")])
    assert not _holds("(in_contact_with table apple)", [])
    assert _holds("(under table apple)", [])  # one half is above it
    assert not _holds("(inside table apple)", [])


def test_relations_of_halves_are_computed():
    assert not _holds("(on_top apple table)", [("left", "table"), ("right", "table")])  # one half lies elsewhere
    assert _holds("(on_top left table)", [("left", "table")])


def test_groups_list_wholes_and_not_halves():
    goal = compile_expression(HOME.model(), "(exists (?x - thing) (sliced ?x))", {"thing": ["apple"]})
    assert len(goal.atoms) == 1
    everything = compile_expression(HOME.model(), "(forall (?x - thing) (in_contact_with ?x table))")
    assert [a.arguments[0] for a in everything.atoms] == ["apple", "table"]


def test_explain_says_that_halves_judge():
    states = initial_states(HOME.model(), 1)
    states = states.replace(sliced=states.sliced.at[0, :3].set(True))
    goal = compile_expression(HOME.model(), "(frozen apple)")
    assert "halves" in goal.explain(world_of(HOME.view(), states))
    assert np.asarray(goal.fraction(world_of(HOME.view(), states))).tolist() == [0.0]
