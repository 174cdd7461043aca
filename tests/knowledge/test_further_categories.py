"""Categories that iGibson does not have: apart from its own, with abilities that exist, and found for BEHAVIOR-1K."""

from __future__ import annotations

from ig2mj.knowledge import abilities, categories, synset
from ig2mj.knowledge.ability_table import ABILITIES
from ig2mj.knowledge.further import further_categories


def test_no_category_of_igibson_is_among_them():
    assert not set(further_categories()) & set(categories())
    assert all(synset(category) is None for category in further_categories())


def test_their_abilities_exist_and_have_all_parameters():
    for category, given in further_categories().items():
        found = abilities(category)
        assert set(found) == set(given) <= set(ABILITIES)
        assert all(set(found[a]) == set(ABILITIES[a].defaults) for a in found), category


def test_what_is_cooked_and_what_is_switched_on():
    assert {"cookable", "sliceable"} <= set(abilities("mango")) and "toggleable" in abilities("crock_pot")
    assert abilities("rice_cooker")["heatSource"]["requires_inside"] and not abilities("not_a_category")
