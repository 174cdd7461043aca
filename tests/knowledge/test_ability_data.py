"""Facts of iGibson's ability data and of paper tables A.1 to A.4."""

import collections
import json

import pytest

from ig2mj import knowledge
from ig2mj.errors import InputError, UnknownNameError

#: Synsets that carry a category, per ability.
COUNTS = {
    "dustyable": 212,
    "stainable": 205,
    "breakable": 126,
    "perishable": 118,
    "freezable": 112,
    "cookable": 104,
    "burnable": 102,
    "toggleable": 42,
    "liquid": 26,
    "openable": 19,
    "sliceable": 17,
    "cleaningTool": 13,
    "soakable": 9,
    "screwable": 9,
    "timeSetable": 7,
    "heatSource": 4,
    "slicer": 4,
    "coldSource": 1,
    "waterSource": 1,
}

IN_DATA = {c: knowledge.abilities(c) for c in knowledge.categories()}


def categories_with(ability):
    return {c for c, found in IN_DATA.items() if ability in found}


def test_counts_of_synsets_per_ability_are_those_of_the_taxonomy():
    owners = {knowledge.synset(c) for c in knowledge.categories()}
    counts = collections.Counter(a for s in owners for a in knowledge.abilities_of_synset(s))
    assert counts == COUNTS


@pytest.mark.parametrize(
    ("category", "temperature", "rate", "toggled", "closed", "inside"),
    [
        ("microwave", 1000, 0.04, True, True, True),
        ("oven", 250, 0.01, True, True, True),
        ("stove", 500, 0.02, True, False, False),
        ("burner", 500, 0.02, True, False, False),
    ],
)
def test_heat_sources_have_the_taxonomys_values(category, temperature, rate, toggled, closed, inside):
    assert knowledge.abilities(category)["heatSource"] == {
        "temperature": temperature,
        "heating_rate": rate,
        "distance_threshold": 0.2,
        "requires_toggled_on": toggled,
        "requires_closed": closed,
        "requires_inside": inside,
    }


def test_fridge_is_a_cold_source_that_works_closed_and_needs_no_switch():
    assert knowledge.abilities("fridge")["coldSource"] == {
        "temperature": -18.0,
        "heating_rate": 0.02,
        "distance_threshold": 0.2,
        "requires_toggled_on": False,
        "requires_closed": True,
        "requires_inside": True,
    }
    assert "toggleable" not in knowledge.abilities("fridge")


def test_slicers_are_three_knives_and_the_lawn_mower():
    assert categories_with("slicer") == {"carving_knife", "table_knife", "pocketknife", "lawn_mower"}


def test_sliceables_have_no_own_force_so_ten_newtons():
    assert {IN_DATA[c]["sliceable"]["slice_force"] for c in categories_with("sliceable")} == {10.0}


def test_the_only_water_source_is_the_sink():
    assert categories_with("waterSource") == {"sink"}


def test_cleaning_tools_that_can_be_soaked_are_brush_napkin_towels_and_rag():
    both = categories_with("cleaningTool") & categories_with("soakable")
    assert both == {
        "scrub_brush",
        "dinner_napkin",
        "bath_towel",
        "paper_towel",
        "dishtowel",
        "hand_towel",
        "rag",
    }
    assert categories_with("soakable") - both == {"pot_plant", "tea_bag"}


def test_openable_categories_are_those_of_the_taxonomy():
    assert categories_with("openable") == set(
        [
            "bottom_cabinet",
            "bottom_cabinet_no_top",
            "top_cabinet",
            "jar",
            "chest",
            "carton",
            "package",
            "car",
            "backpack",
            "briefcase",
            "laptop",
            "folder",
            "microwave",
            "oven",
            "stove",
            "dishwasher",
            "fridge",
            "washer",
            "dryer",
            "door",
            "window",
        ]
    )


def test_yogurt_is_cooked_below_room_temperature():
    cook = knowledge.abilities("yogurt")["cookable"]["cook_temperature"]
    assert cook == pytest.approx(22.8, abs=0.05)
    assert cook < 23.0


def test_prosciutto_cooks_and_burns_at_the_same_temperature():
    found = knowledge.abilities("prosciutto")
    assert (
        found["cookable"]["cook_temperature"] == found["burnable"]["burn_temperature"] == pytest.approx(204.4, abs=0.05)
    )


def test_some_food_cannot_cook_in_the_oven():
    oven = knowledge.abilities("oven")["heatSource"]["temperature"]
    never = {c for c in categories_with("cookable") if IN_DATA[c]["cookable"]["cook_temperature"] > oven}
    assert {"pretzel", "bagel"} <= never


def test_fruit_most_often_cooks_at_100_and_burns_at_1100():
    fruit = [IN_DATA[c] for c in categories_with("sliceable") if not c.startswith("half_")]
    pairs = collections.Counter((f["cookable"]["cook_temperature"], f["burnable"]["burn_temperature"]) for f in fruit)
    assert pairs.most_common(1)[0] == ((100.0, 1100.0), 7)


def test_cook_and_burn_default_to_70_and_200_where_the_data_gives_none():
    taxonomy = knowledge.taxonomy()
    bare_cook = [n for n, s in taxonomy.items() if s.abilities.get("cookable") == {}]
    bare_burn = [n for n, s in taxonomy.items() if s.abilities.get("burnable") == {}]
    assert bare_cook
    assert bare_burn
    assert {knowledge.abilities_of_synset(n)["cookable"]["cook_temperature"] for n in bare_cook} == {70.0}
    assert {knowledge.abilities_of_synset(n)["burnable"]["burn_temperature"] for n in bare_burn} == {200.0}


def test_everything_freezes_at_zero():
    assert {IN_DATA[c]["freezable"]["freeze_temperature"] for c in categories_with("freezable")} == {0.0}


def test_thresholds_of_table_a1_are_the_defaults():
    assert {IN_DATA[c]["soakable"]["wetness_soaked"] for c in categories_with("soakable")} == {1.0}
    assert {IN_DATA[c]["dustyable"]["dusty_threshold"] for c in categories_with("dustyable")} == {0.5}
    assert {IN_DATA[c]["stainable"]["stained_threshold"] for c in categories_with("stainable")} == {0.5}


def test_floors_are_dirty_above_three_quarters_only_in_igibsons_code():
    assert knowledge.abilities("floors")["dustyable"]["dusty_threshold"] == 0.5
    code = knowledge.abilities("floors", compat="igibson")
    assert code["dustyable"]["dusty_threshold"] == code["stainable"]["stained_threshold"] == 0.75
    assert knowledge.abilities("sink", compat="igibson")["stainable"]["stained_threshold"] == 0.5


def test_numbers_are_floats_and_switches_are_bools():
    for found in IN_DATA.values():
        for parameters in found.values():
            for name, value in parameters.items():
                assert type(value) is (bool if name.startswith("requires_") else float)


def test_abilities_come_in_alphabetical_order():
    assert any(len(found) > 1 for found in IN_DATA.values())
    for found in IN_DATA.values():
        assert list(found) == sorted(found)


def test_a_caller_may_change_what_it_gets():
    knowledge.abilities("apple")["cookable"]["cook_temperature"] = -1.0
    assert knowledge.abilities("apple")["cookable"]["cook_temperature"] == 100.0


@pytest.mark.parametrize(
    ("ability", "states"),
    [
        ("cookable", {"max_temperature", "temperature"}),
        ("burnable", {"max_temperature", "temperature"}),
        ("freezable", {"temperature"}),
        ("soakable", {"wetness"}),
        ("dustyable", {"dust"}),
        ("stainable", {"stain"}),
        ("toggleable", {"toggled_on"}),
        ("sliceable", {"sliced"}),
        ("heatSource", {"toggled_on"}),
        ("coldSource", {"toggled_on"}),
        ("waterSource", {"toggled_on"}),
    ],
)
def test_table_a2_required_states(ability, states):
    assert set(knowledge.required_states(ability)) == states


@pytest.mark.parametrize(
    ("ability", "link"),
    [
        ("heatSource", "heat_source"),
        ("coldSource", "heat_source"),
        ("cleaningTool", "cleaning_tool_area"),
        ("waterSource", "water_source"),
        ("waterSink", "water_sink"),
        ("toggleable", "toggle_button"),
        ("slicer", "slicer"),
    ],
)
def test_table_a3_required_links(ability, link):
    assert knowledge.required_links(ability) == (link,)


def test_a_source_that_heats_what_is_inside_it_works_without_the_link():
    assert knowledge.required_links("heatSource", knowledge.abilities("oven")["heatSource"]) == ()
    assert knowledge.required_links("heatSource", knowledge.abilities("stove")["heatSource"]) == ("heat_source",)


def test_every_ability_of_the_taxonomy_is_known():
    assert {a for node in knowledge.taxonomy().values() for a in node.abilities} <= set(knowledge.ABILITIES)


def test_unknown_ability_is_an_error_that_names_near_ones():
    with pytest.raises(UnknownNameError, match=r"'cookabel'.*cookable"):
        knowledge.required_states("cookabel")


def write(path, content):
    path.write_text(content if isinstance(content, str) else json.dumps(content))
    return path


def test_overrides_change_a_category_then_a_model(tmp_path):
    own = knowledge.load_overrides(
        write(
            tmp_path / "own.json",
            {
                "categories": {"apple": {"sliceable": {"slice_force": 5}, "freezable": None, "dustyable": {}}},
                "models": {"apple/00_0": {"sliceable": {"slice_force": 7}}},
            },
        )
    )
    any_apple = knowledge.abilities("apple", overrides=own)
    assert any_apple["sliceable"]["slice_force"] == 5.0
    assert "freezable" not in any_apple
    assert any_apple["dustyable"] == {"dusty_threshold": 0.5}
    assert knowledge.abilities("apple", "00_0", overrides=own)["sliceable"]["slice_force"] == 7.0
    assert knowledge.abilities("apple", "01_0", overrides=own)["sliceable"]["slice_force"] == 5.0
    assert knowledge.abilities("apple")["sliceable"]["slice_force"] == 10.0


def test_heat_source_and_cold_source_together_leave_the_alphabetically_first(tmp_path):
    own = knowledge.load_overrides(write(tmp_path / "o.json", {"categories": {"oven": {"coldSource": {}}}}))
    found = knowledge.abilities("oven", overrides=own)
    assert "coldSource" in found
    assert "heatSource" not in found


@pytest.mark.parametrize(
    ("content", "says"),
    [
        ("{", "truncated|malformed"),
        ({"categorys": {}}, "categorys"),
        ({"categories": {"apple": {"sliceabel": {}}}}, "'apple': sliceabel: is not an ability"),
        ({"categories": {"apple": {"sliceable": {"force": 3}}}}, "no parameter 'force'.*slice_force"),
        ({"models": {"apple/a": {"sliceable": {"slice_force": "3"}}}}, "Expected"),
        ({"models": {"oven/a": {"heatSource": {"requires_inside": 1}}}}, "requires_inside.*true or false"),
        ({"models": {"oven/a": {"heatSource": {"temperature": True}}}}, "temperature.*a number"),
    ],
)
def test_a_broken_overrides_file_is_one_clear_line(tmp_path, content, says):
    file = write(tmp_path / "own.json", content)
    with pytest.raises(InputError, match=says) as error:
        knowledge.load_overrides(file)
    assert str(file) in str(error.value)
    assert "\n" not in str(error.value)


def test_a_missing_overrides_file_is_an_input_error(tmp_path):
    with pytest.raises(InputError, match="there is no such file"):
        knowledge.load_overrides(tmp_path / "none.json")
