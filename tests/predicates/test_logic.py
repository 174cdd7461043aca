"""Expressions: BDDL's semantics, text, the share that is fulfilled, names and abilities that do not exist."""

from __future__ import annotations

import itertools
import warnings

import jax.numpy as jnp
import numpy as np
import pytest
from hand_world import HandWorld, Item
from hypothesis import given
from hypothesis import strategies as st
from limits import run_limited

from ig2mj.errors import AbilityError, InputError, UnknownNameError
from ig2mj.predicates import (
    AbilityWarning,
    ArityError,
    Atom,
    ExpressionError,
    ForAll,
    atom,
    compile_expression,
    literals,
    logic,
    parse,
)
from ig2mj.predicates.evaluate import Truth, fraction, holds
from ig2mj.states import WorldState, initial_states

SWITCH = {"toggleable": {}}
HOME = HandWorld(
    *(Item(f"lamp_{k}", abilities=SWITCH, category="lamp", pos=(3 * k, 0, 0)) for k in range(3)),
    *(Item(f"radio_{k}", abilities=SWITCH, category="radio", pos=(0, 3 + 3 * k, 0)) for k in range(2)),
    Item("big rock (grey)", category="rock", pos=(0, 0, 9)),
    rooms={"kitchen_0": (-5.0, 5.0)},
)


def _world(on: tuple[str, ...] = (), touching=(), worlds: int = 1) -> WorldState:
    states = initial_states(HOME.model(), worlds)
    toggled = np.isin(np.array(HOME.tables.object_names), on)
    states = states.replace(toggled_on=states.toggled_on | toggled)
    zeros = np.zeros(worlds, np.float32)
    view = HOME.view(touching=touching, worlds=worlds)
    return WorldState(None, view, states, np.zeros((worlds, 2), np.uint32), zeros.astype(np.int32), zeros)


def _holds(text: str, on: tuple[str, ...] = (), touching=()) -> bool:
    return bool(compile_expression(HOME.model(), text)(_world(on, touching))[0])


A, B, C = "lamp_0", "lamp_1", "lamp_2"


@pytest.mark.parametrize(
    ("text", "on", "expected"),
    [
        ("(and (toggled_on lamp_0) (toggled_on lamp_1))", (A, B), True),
        ("(and (toggled_on lamp_0) (toggled_on lamp_1))", (A,), False),
        ("(or (toggled_on lamp_0) (toggled_on lamp_1))", (B,), True),
        ("(or (toggled_on lamp_0) (toggled_on lamp_1))", (), False),
        ("(not (toggled_on lamp_0))", (), True),
        ("(imply (toggled_on lamp_0) (toggled_on lamp_1))", (), True),
        ("(imply (toggled_on lamp_0) (toggled_on lamp_1))", (A,), False),
        ("(implies (toggled_on lamp_0) (toggled_on lamp_1))", (A, B), True),
        ("(forall (?x - lamp) (toggled_on ?x))", (A, B, C), True),
        ("(forall (?x - lamp) (toggled_on ?x))", (A, B), False),
        ("(exists (?x - lamp) (toggled_on ?x))", (C,), True),
        ("(exists (?x - lamp) (toggled_on ?x))", (), False),
        ("(forn 2 (?x - lamp) (toggled_on ?x))", (A, C), True),
        ("(forn (2) (?x - lamp) (toggled_on ?x))", (A, B, C), False),  # exactly two
        ("(forn 0 (?x - lamp) (toggled_on ?x))", (), True),
        ("(and)", (), True),
        ("(or)", (), False),
        ("(forall (?x - lamp) (exists (?y - lamp) (and (toggled_on ?x) (toggled_on ?y))))", (A, B, C), True),
        ("(toggledon ?lamp_0)", (A,), True),  # BDDL writes objects with a question mark
    ],
)
def test_connectives_and_quantifiers(text, on, expected):
    assert _holds(text, on) == expected


@pytest.mark.parametrize(
    ("pairs", "expected"),
    [
        ([("lamp_0", "radio_0"), ("lamp_1", "radio_1")], True),
        ([("lamp_0", "radio_0"), ("lamp_1", "radio_0")], False),
        ([("lamp_0", "radio_0"), ("lamp_0", "radio_1")], False),
        ([], False),
    ],
)
def test_forpairs_uses_up_the_smaller_group(pairs, expected):
    assert _holds("(forpairs (?a - lamp) (?b - radio) (in_contact_with ?a ?b))", touching=pairs) == expected
    assert _holds("(fornpairs 2 (?a - lamp) (?b - radio) (in_contact_with ?a ?b))", touching=pairs) == expected


def test_fornpairs_asks_for_that_many():
    one = [("lamp_2", "radio_1")]
    assert _holds("(fornpairs 1 (?a - lamp) (?b - radio) (in_contact_with ?a ?b))", touching=one)
    assert not _holds("(fornpairs 2 (?a - lamp) (?b - radio) (in_contact_with ?a ?b))", touching=one)


def test_pairs_of_one_group_never_pair_an_object_with_itself():
    touching = [("lamp_0", "lamp_1"), ("lamp_1", "lamp_2")]
    assert _holds("(forpairs (?a - lamp) (?b - lamp) (in_contact_with ?a ?b))", touching=touching)
    grounded = logic.ground(parse("(forpairs (?a - g) (?b - g) (p ?a ?b))"), lambda _: ["x", "y"])
    assert len(logic.atoms(grounded)) == 2


def _bddl_pairs(grid: np.ndarray, count: int) -> bool:
    """BDDL's rule, written out as in its condition_evaluation.py."""
    return bool(np.any(grid, axis=1).sum() >= count and np.any(grid, axis=0).sum() >= count)


@given(st.lists(st.lists(st.booleans(), min_size=3, max_size=3), min_size=2, max_size=2), st.integers(0, 3))
def test_pairing_is_bddls_rule(grid, count):
    cells = [[Atom("p", (f"{i}{j}",)) for j in range(3)] for i in range(2)]
    index = {cells[i][j]: 3 * i + j for i in range(2) for j in range(3)}
    truth = Truth(jnp.array([np.ravel(grid)]), index)
    value = holds(logic.Pairing(count, tuple(map(tuple, cells))), truth)
    assert bool(value[0]) == _bddl_pairs(np.array(grid), count)


ATOMS = [Atom("p", (str(i),)) for i in range(4)]
# Plain tuples: (word, number, parts). Expressions are made of them in the test.
TREES = st.recursive(
    st.integers(0, 3),
    lambda inner: st.one_of(
        st.tuples(st.sampled_from(["and", "or"]), st.just(0), st.lists(inner, max_size=3)),
        st.tuples(st.just("not"), st.just(0), st.lists(inner, min_size=1, max_size=1)),
        st.tuples(st.just("exactly"), st.integers(0, 3), st.lists(inner, max_size=3)),
        st.tuples(st.just("pairing"), st.integers(0, 2), st.lists(inner, min_size=3, max_size=3)),
    ),
    max_leaves=6,
)


def _expression(tree) -> logic.Expression:
    if isinstance(tree, int):
        return ATOMS[tree]
    word, number, parts = tree[0], tree[1], tuple(map(_expression, tree[2]))
    return {
        "and": lambda: logic.And(parts),
        "or": lambda: logic.Or(parts),
        "not": lambda: logic.Not(parts[0]),
        "exactly": lambda: logic.Exactly(number, parts),
        "pairing": lambda: logic.Pairing(number, (parts[:2], (None, parts[2]))),
    }[word]()


@given(TREES)
def test_the_fraction_is_one_exactly_where_the_expression_holds(tree):
    expression = _expression(tree)
    worlds = np.array(list(itertools.product([False, True], repeat=4)))
    truth = Truth(jnp.asarray(worlds), {a: i for i, a in enumerate(ATOMS)})
    share = np.asarray(fraction(expression, truth))
    true = np.asarray(holds(expression, truth))
    assert ((share == 1.0) == true).all()
    assert ((share >= 0.0) & (share <= 1.0)).all()


def test_the_fraction_of_a_conjunction_is_igibsons_share_of_conditions():
    goal = compile_expression(HOME.model(), "(and (toggled_on lamp_0) (toggled_on lamp_1) (not (toggled_on lamp_2)))")
    found = [float(goal.fraction(_world(on))[0]) for on in ((), (A,), (A, B), (A, B, C))]
    assert np.allclose(found, [1 / 3, 2 / 3, 1.0, 2 / 3])


def test_a_tree_built_in_python_is_the_tree_read_from_text():
    built = ForAll("?f", "lamp", atom("toggled_on", "?f") >> ~atom("inside", "?f", "big rock (grey)"))
    assert parse('(forall (?f - lamp) (imply (toggled_on ?f) (not (inside ?f "big rock (grey)"))))') == built


@given(TREES.filter(lambda tree: "exactly" not in str(tree) and "pairing" not in str(tree)))
def test_text_is_read_back_as_it_was(tree):
    expression = _expression(tree)
    assert parse(logic.text(expression)) == expression


@pytest.mark.parametrize(
    "text",
    [
        "",
        "   ; nothing but a comment",
        "(",
        ")",
        "(and (cooked fish)",
        "(cooked fish))",
        "cooked fish",
        "()",
        "((cooked fish))",
        "(not)",
        "(not (a b) (c d))",
        "(imply (a b))",
        "(forall ?x (a ?x))",
        "(forall (x - lamp) (a x))",
        "(forall (?x lamp) (a ?x))",
        "(forn two (?x - lamp) (a ?x))",
        "(forn (?x - lamp) (a ?x))",
        "(forpairs (?x - lamp) (a ?x))",
        "(fornpairs 2 (?x - lamp) (a ?x))",
        "(cooked (fish))",
        '(cooked "fish)',
        "(" * 300 + ")" * 300,
    ],
)
def test_text_that_is_no_expression_is_a_typed_error(text):
    with pytest.raises(ExpressionError) as caught:
        parse(text, "goal.bddl")
    assert "goal.bddl" in str(caught.value) and "\n" not in str(caught.value)


def test_comments_and_line_breaks_are_read_over():
    text = "; the goal\n(and (toggled_on lamp_0) ; first\n  (toggled_on lamp_1))  ; end"
    assert parse(text) == logic.And((atom("toggled_on", "lamp_0"), atom("toggled_on", "lamp_1")))


@pytest.mark.parametrize(
    ("text", "near"),
    [
        ("(toggled_onn lamp_0)", "toggled_on"),
        ("(toggled_on lamp_7)", "lamp_0"),
        ("(on_floor lamp_0 kitchen_9)", "kitchen_0"),
        ("(forall (?x - lmp) (toggled_on ?x))", "lamp"),
    ],
)
def test_unknown_names_are_typed_errors_with_near_matches(text, near):
    with pytest.raises(UnknownNameError) as caught:
        compile_expression(HOME.model(), text)
    assert "near matches" in str(caught.value) and near in str(caught.value)


@pytest.mark.parametrize("text", ["(toggled_on lamp_0 lamp_1)", "(inside lamp_0)"])
def test_a_wrong_number_of_arguments_is_a_typed_error(text):
    with pytest.raises(ArityError):
        compile_expression(HOME.model(), text)


def test_an_absent_ability_is_false_with_one_warning_or_an_error_when_strict(monkeypatch):
    monkeypatch.setattr(literals, "_WARNED", set())
    text = '(toggled_on "big rock (grey)")'
    with pytest.warns(AbilityWarning, match="toggleable"):
        goal = compile_expression(HOME.model(), text)
    assert not goal(_world(("big rock (grey)",)))[0]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        compile_expression(HOME.model(), text)  # once only
    with pytest.raises(AbilityError, match="big rock"):
        compile_expression(HOME.model(), text, strict=True)


def test_groups_may_be_given_or_be_categories_or_synsets():
    model = HOME.model()
    given_group = compile_expression(
        model, "(forall (?x - favourites) (toggled_on ?x))", {"favourites": [A, "radio_1"]}
    )
    assert [a.arguments for a in given_group.atoms] == [(A,), ("radio_1",)]
    kitchen = HandWorld(Item("cup_0", category="cup"), Item("apple_0", category="apple"))
    by_synset = compile_expression(kitchen.model(), "(exists (?x - apple.n.01) (under ?x cup_0))")
    assert [a.arguments for a in by_synset.atoms] == [("apple_0", "cup_0")]


def test_explain_says_what_holds_and_what_is_missing_with_numbers():
    home = HandWorld(
        Item("fish", abilities={"cookable": {}, "burnable": {}}),
        Item("fridge", abilities={"openable": {}}, joints=[(0.0, 1.0)]),
    )
    states = initial_states(home.model(), 1)
    states = states.replace(max_temperature=states.max_temperature.at[0, 0].set(41.2))
    world = WorldState(
        None, home.view(), states, np.zeros((1, 2), np.uint32), np.zeros(1, np.int32), np.zeros(1, np.float32)
    )
    goal = compile_expression(home.model(), "(and (cooked fish) (not (open fridge)))")
    report = goal.explain(world)
    assert "(cooked fish)" in report and "41.2" in report and "70.0" in report
    assert "open" not in report.split("Missing:")[1]
    assert goal.explain(world.replace(states=states.replace(max_temperature=states.max_temperature + 100))).endswith(
        "holds."
    )


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("(or (toggled_on lamp_0) (toggled_on lamp_1))", ["one of:", "(toggled_on lamp_0)", "(toggled_on lamp_1)"]),
        ("(forn 2 (?x - lamp) (toggled_on ?x))", ["exactly 2 of 3 (now 0)"]),
        ("(forpairs (?a - lamp) (?b - radio) (in_contact_with ?a ?b))", ["2 pairs (now 0)"]),
        ("(not (not (toggled_on lamp_2)))", ["(toggled_on lamp_2)"]),
        ("(or)", ["nothing can make"]),
    ],
)
def test_explain_of_every_connective(text, words):
    report = compile_expression(HOME.model(), text).explain(_world())
    assert all(word in report for word in words)


def test_explain_is_about_the_world_asked_for():
    world = _world(worlds=2)
    states = world.states.replace(toggled_on=world.states.toggled_on.at[1, 0].set(True))
    goal = compile_expression(HOME.model(), "(toggled_on lamp_0)")
    assert goal.explain(world.replace(states=states), 1).endswith("holds.")
    assert "does not hold" in goal.explain(world.replace(states=states), 0)
    assert goal(world.replace(states=states)).tolist() == [False, True]


def _ground_nested(depth: int, size: int) -> logic.Expression:
    body: logic.Expression = atom("toggled_on", "?x0")
    for level in range(depth):
        body = ForAll(f"?x{level}", "lamp", body)
    return logic.ground(body, lambda group: [f"{group}_{k}" for k in range(size)])


def test_nested_quantifiers_are_grounded_up_to_a_limit():
    run_limited(_ground_nested, 4, 200).check(InputError, "stand for 16.* parts.*20000.*IG2MJ_LIMIT_GROUNDED_PARTS")
    run_limited(_ground_nested, 90, 200).check(InputError, "IG2MJ_LIMIT_GROUNDED_PARTS")
    assert logic.ground_size(_ground_nested(2, 3), lambda _: []) == 1 + 3 * (1 + 3)


@given(st.integers(0, 3), st.integers(0, 3))
def test_the_size_is_that_of_what_is_grounded(first: int, second: int):
    groups = {"a": [f"a{k}" for k in range(first)], "b": [f"b{k}" for k in range(second)]}
    pairs = logic.ForPairs(("?x", "a"), ("?y", "b"), atom("on_top", "?x", "?y") & ~atom("open", "?x"))
    whole = pairs | ForAll("?z", "b", logic.Exists("?x", "a", atom("inside", "?x", "?z")))
    grounded = logic.ground(whole, groups.__getitem__)
    assert logic.ground_size(whole, groups.__getitem__) == logic.ground_size(grounded, groups.__getitem__)
