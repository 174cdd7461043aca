"""Facts of the taxonomy of `bddl`."""

import pytest

from ig2mj import knowledge
from ig2mj.errors import UnknownNameError


def test_there_are_393_categories_on_367_synsets():
    synsets = {knowledge.synset(c) for c in knowledge.categories()}
    assert len(knowledge.categories()) == 393
    assert len(synsets) == 367
    assert None not in synsets


def test_every_category_belongs_to_exactly_one_synset():
    owners = [c for node in knowledge.taxonomy().values() for c in node.categories]
    assert len(owners) == len(set(owners))


def test_half_apple_shares_the_synset_and_abilities_of_the_whole():
    assert knowledge.synset("half_apple") == knowledge.synset("apple") == "apple.n.01"
    assert knowledge.abilities("half_apple") == knowledge.abilities("apple")


def test_every_half_has_a_whole_of_the_same_synset():
    halves = [c for c in knowledge.categories() if c.startswith("half_")]
    assert len(halves) == 17
    for half in halves:
        assert knowledge.synset(half) == knowledge.synset(half.removeprefix("half_"))


def test_unknown_category_has_no_synset_and_no_abilities():
    assert knowledge.synset("walls") is None
    assert knowledge.abilities("walls") == {}


def test_fridge_is_an_electric_refrigerator():
    assert knowledge.synset("fridge") == "electric_refrigerator.n.01"


def test_leaf_synset_gives_its_own_categories():
    assert knowledge.categories_of("apple.n.01") == ("apple", "half_apple")


def test_inner_synset_gives_the_categories_of_its_leaves():
    fruit = knowledge.categories_of("edible_fruit.n.01")
    assert {"apple", "half_apple", "peach", "lemon"} <= set(fruit)
    assert fruit == tuple(sorted(fruit))


@pytest.mark.parametrize("category", ["perfume", "cord", "cracker_box", "medicine"])
def test_categories_of_inner_nodes_are_missed_unless_asked_for(category):
    synset = knowledge.synset(category)
    assert category not in knowledge.categories_of(synset)
    assert category in knowledge.categories_of(synset, include_inner=True)


def test_a_stove_may_also_be_a_burner_but_not_the_reverse():
    assert knowledge.categories_of("stove.n.01") == ("burner", "stove")
    assert knowledge.categories_of("burner.n.02") == ("burner",)


def test_root_covers_every_category():
    assert knowledge.categories_of("entity.n.01", include_inner=True) == knowledge.categories()


def test_is_a_follows_the_tree_and_is_reflexive():
    assert knowledge.is_a("apple", "edible_fruit.n.01")
    assert knowledge.is_a("apple.n.01", "apple.n.01")
    assert knowledge.is_a("apple.n.01", "entity.n.01")
    assert not knowledge.is_a("apple", "furniture.n.01")
    assert not knowledge.is_a("edible_fruit.n.01", "apple.n.01")
    assert not knowledge.is_a("no_such_category", "entity.n.01")


def test_a_synset_with_several_parents_is_a_kind_of_each():
    several = [node for node in knowledge.taxonomy().values() if len(node.parents) > 1]
    assert several
    for node in several:
        assert all(knowledge.is_a(node.name, parent) for parent in node.parents)


def test_ancestors_and_descendants_mirror_each_other():
    for name in ("apple.n.01", "edible_fruit.n.01", "cabinet.n.01"):
        assert all(name in knowledge.descendants(a) for a in knowledge.ancestors(name))
        assert name not in knowledge.ancestors(name)


@pytest.mark.parametrize(
    "ask",
    [
        lambda: knowledge.categories_of("aple.n.01"),
        lambda: knowledge.ancestors("aple.n.01"),
        lambda: knowledge.is_a("apple", "aple.n.01"),
        lambda: knowledge.abilities_of_synset("aple.n.01"),
    ],
)
def test_unknown_synset_is_an_error_that_names_near_ones(ask):
    with pytest.raises(UnknownNameError, match=r"aple\.n\.01.*near matches.*apple\.n\.01"):
        ask()


def test_bddl_is_read_without_being_imported():
    import subprocess
    import sys

    code = (
        "import sys, ig2mj.knowledge as k; k.abilities('apple'); "
        "bad = {'bddl', 'jax', 'mujoco', 'numpy', 'networkx'} & set(sys.modules); sys.exit(str(bad) if bad else 0)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
