"""Definitions in both vocabularies of BDDL, lowered to our predicates."""

import pytest

from ig2mj.predicates import PREDICATES, logic
from ig2mj.tasks.bddl import behavior1k
from ig2mj.tasks.bddl.definitions import activity_names, load_activity
from ig2mj.tasks.bddl.problem import parse_problem
from ig2mj.tasks.bddl.synsets import kinds
from ig2mj.tasks.bddl.vocabulary import VocabularyError, lower


def lowered(objects: str, init: str = "", goal: str = "(and)", domain: str = "omnigibson"):
    text = f"(define (problem a-0) (:domain {domain}) (:objects {objects}) (:init {init}) (:goal {goal}))"
    return lower(parse_problem(text), "a")


def texts(parts) -> list[str]:
    return [logic.text(p) for p in parts]


def test_every_activity_of_behavior_100_needs_only_our_predicates():
    for name in activity_names():
        activity = load_activity(name)
        names = set(activity.synset_of())
        grounded = logic.ground(logic.And((*activity.init, *activity.goal)), lambda s, a=activity: a.objects[s])
        for atom in logic.atoms(grounded):
            assert atom.predicate in PREDICATES and names.issuperset(atom.arguments)


def test_the_words_of_behavior_100():
    activity = lowered(
        "a_1 a_2 - a f_1 - floor.n.01",
        "(ontop a_1 a_2) (nextto a_1 a_2) (touching a_1 a_2) (onfloor a_1 f_1) (not (open a_1))",
        domain="igibson",
    )
    assert texts(activity.init) == [
        "(on_top a_1 a_2)",
        "(next_to a_1 a_2)",
        "(in_contact_with a_1 a_2)",
        "(on_floor a_1 f_1)",
        "(not (open a_1))",
    ]


def test_on_top_of_the_floor_is_on_the_floor():
    activity = lowered("a_1 - a f_1 - floor.n.01", "(ontop a_1 f_1)", "(forall (?f - floor.n.01) (ontop a_1 ?f))")
    assert texts(activity.init) == ["(on_floor a_1 f_1)"]
    assert texts(activity.goal) == ["(and (on_floor a_1 f_1))"]  # written out: a floor is a room and an object


def test_covered_with_stain_and_dust_is_stained_and_dusty_and_the_substances_are_no_objects():
    activity = lowered(
        "a_1 a_2 - a stain.n.01_1 - stain.n.01 dust.n.01_1 - dust.n.01",
        "(covered a_1 stain.n.01_1) (covered a_2 dust.n.01_1)",
        "(forall (?a - a) (not (covered ?a ?stain.n.01_1)))",
    )
    assert texts(activity.init) == ["(stained a_1)", "(dusty a_2)"]
    assert texts(activity.goal) == ["(forall (?a - a) (not (stained ?a)))"]
    assert set(activity.objects) == {"a"}


def test_saturated_with_water_is_soaked():
    activity = lowered("r_1 - r water.n.06_1 - water.n.06", "(saturated r_1 water.n.06_1)")
    assert texts(activity.init) == ["(soaked r_1)"]
    assert set(activity.objects) == {"r"}


def test_what_fills_and_covers_is_a_substance_in_use():
    activity = lowered(
        "a_1 - a salt.n.02_1 - salt.n.02 mud.n.03_1 - mud.n.03 cooked__salt.n.01_1 - cooked__salt.n.01",
        "(filled a_1 salt.n.02_1) (covered a_1 mud.n.03_1) (insource a_1 salt.n.02_1) (future cooked__salt.n.01_1)",
        "(and (contains ?a_1 ?cooked__salt.n.01_1) (real ?cooked__salt.n.01_1))",
    )
    wanted = ["(filled a_1 salt)", "(covered a_1 mud)", "(insource a_1 salt)", "(not (present cooked__salt))"]
    assert texts(activity.init) == wanted
    assert texts(activity.goal) == ["(contains a_1 cooked__salt)", "(present cooked__salt)"]
    assert set(activity.substances) == {"salt", "mud", "cooked__salt"}
    assert activity.needs["a_1"] == {"filled", "covered", "insource", "contains"}


HALVES = (
    "apple.n.01_1 apple.n.01_2 - apple.n.01 "
    "half__apple.n.01_1 half__apple.n.01_2 half__apple.n.01_3 half__apple.n.01_4 - half__apple.n.01"
)
FUTURE = " ".join(f"(future half__apple.n.01_{n})" for n in range(1, 5))


def test_halves_to_come_are_parts_of_their_whole():
    activity = lowered(HALVES, FUTURE, "(forall (?h - half__apple.n.01) (and (real ?h) (cooked ?h)))")
    assert set(activity.objects) == {"apple.n.01"}
    assert dict(activity.halves) == {
        "half__apple.n.01_1": ("apple.n.01_1", 0),
        "half__apple.n.01_2": ("apple.n.01_1", 1),
        "half__apple.n.01_3": ("apple.n.01_2", 0),
        "half__apple.n.01_4": ("apple.n.01_2", 1),
    }
    assert texts(activity.init) == ["(not (sliced apple.n.01_1))", "(not (sliced apple.n.01_2))"]
    assert "(and (sliced apple.n.01_2) (cooked half__apple.n.01_4))" in logic.text(activity.goal[0])


def test_a_whole_that_is_no_longer_real_is_sliced():
    activity = lowered(HALVES, FUTURE, "(forall (?a - apple.n.01) (not (real ?a)))")
    assert texts(activity.goal) == ["(forall (?a - apple.n.01) (sliced ?a))"]


@pytest.mark.parametrize(
    ("objects", "condition", "lacking"),
    [
        ("a_1 - a s_1 - sal.n.02", "(covered a_1 s_1)", "the substance sal"),
        ("a_1 - a", "(folded a_1)", "folded"),
        ("a_1 a_2 - a", "(draped a_1 a_2)", "draped"),
        ("diced__beet.n.01_1 - diced__beet.n.01", "(future diced__beet.n.01_1)", "a rule that makes diced__beet"),
        ("cookie.n.01_1 - cookie.n.01", "(future cookie.n.01_1)", "a rule that makes cookie"),
    ],
)
def test_what_no_state_expresses_is_named(objects, condition, lacking):
    with pytest.raises(VocabularyError, match=f"activity 'a' uses {lacking}, which ig2mj has no state for"):
        lowered(objects, goal=condition)


@pytest.mark.parametrize(
    ("name", "instead"),
    [
        ("bookcase.n.01", "shelf.n.01"),
        ("wicker_basket.n.01", "basket.n.01"),  # the synset right above
        ("carton__of__milk.n.01", "milk"),  # what is in it
        ("bottle__of__vodka.n.01", "bottle.n.01"),  # else what it is in
        ("half__apple.n.01", "half_apple"),  # its own category
        ("olive_oil__bottle.n.01", "olive_oil"),  # a container of what is in it
        ("acetone__bottle.n.01", "bottle"),  # else one of its kind
        ("cumin__shaker.n.01", "shaker"),
        ("statue.n.09", None),  # furniture is too general to stand in
        ("nowhere.n.01", None),
    ],
)
def test_what_stands_in_for_synsets_of_behavior_1k(name, instead, monkeypatch):
    hierarchy = {
        "bookcase.n.01": (("furniture.n.01",), ("bookcase",)),
        "wicker_basket.n.01": (("basket.n.01",), ("wicker_basket",)),
        "carton__of__milk.n.01": (("grocery.n.02",), ("carton_of_milk",)),
        "bottle__of__vodka.n.01": (("grocery.n.02",), ("bottle_of_vodka",)),
        "half__apple.n.01": ((), ("half_apple",)),
        **{f"{name}.n.01": ((), ()) for name in ("olive_oil__bottle", "acetone__bottle", "cumin__shaker")},
        "statue.n.09": (("furniture.n.01",), ("statue",)),
    }
    monkeypatch.setattr(behavior1k, "hierarchy", lambda: hierarchy)
    found = kinds.__wrapped__(name, True)
    assert found.instead == instead and bool(found.categories) == (instead is not None)


def test_an_office_is_a_home_office():
    assert lowered("d_1 - desk.n.01", "(inroom d_1 private_office)").rooms == {"d_1": "home_office"}
