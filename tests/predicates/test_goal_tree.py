"""An expression as a tree: what holds, what is wanted, and why not."""

from __future__ import annotations

import pytest

import ig2mj
from ig2mj.predicates.tree import GoalPart, tree


@pytest.fixture(scope="module")
def world(tiny_home) -> ig2mj.Simulation:
    return ig2mj.Simulation(tiny_home)


def parts(world, text: str) -> GoalPart:
    return tree(world.compiled(text), world.states, world.view)


def test_a_literal_that_is_missing_says_why_and_one_that_holds_says_nothing(world):
    found = parts(world, "(and (cooked apple) (not (toggled_on stove)))")
    cooked, off = found.parts
    assert (found.text, found.holds, found.fine) == ("all of", False, False)
    assert cooked.literal and not cooked.fine and "cooks at 70.0 C" in cooked.why
    assert off.literal and off.text == "not (toggled_on stove)" and off.fine and not off.why


def test_under_not_the_opposite_is_wanted(world):
    found = parts(world, "(not (or (cooked apple) (toggled_on stove)))")
    assert found.holds and found.fine
    assert [(p.expected, p.fine) for p in found.parts[0].parts] == [(False, True)] * 2


def test_quantifiers_are_written_out(world):
    found = parts(world, "(exists (?a - apple) (cooked ?a))")
    assert [p.text for p in found.parts] == ["(cooked apple)"] and not found.holds


def test_the_tree_agrees_with_the_expression(world):
    for text in ("(open cabinet)", "(not (open cabinet))", "(or (open cabinet) (on_top box table))"):
        assert parts(world, text).holds == world.holds(text)
