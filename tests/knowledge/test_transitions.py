"""The table of transition rules."""

import json

import pytest

from ig2mj.errors import InputError
from ig2mj.knowledge import transitions as table
from ig2mj.knowledge.substances import substance


def test_rules_name_substances_that_exist():
    for rule in table.transitions():
        for name in (*rule.inputs, *(() if rule.count else (rule.output,))):
            assert table.ANY in name or substance(name).has_volume
        assert not rule.count or rule.objects or rule.inputs


def test_rules_of_some_substances_have_all_that_they_need_among_them():
    names = ("water", "lemon_juice", "granulated_sugar", "lemonade", "cooked__water")
    found = {rule.name: rule for rule in table.transitions_of(names)}
    assert set(found) == {"cooking", "lemonade"}
    assert found["cooking"].inputs == ("water",) and found["cooking"].output == "cooked__water"
    assert table.transitions_of(names[1:3]) == ()


def test_what_can_be_made_says_of_what():
    assert table.sources_of("lemonade") == ("granulated_sugar", "lemon_juice", "water")
    assert table.sources_of("cooked__white_rice") == ("white_rice",)
    assert table.is_makeable("cooked__sugar_syrup") and not table.is_makeable("water")
    assert table.sources_of("cooked__diced__apple") == ("diced__apple",)


def test_what_is_made_on_the_way_is_named():
    given = {"flour", "salt", "honey", "yeast", "water", "egg", "sesame_seed"}
    assert table.intermediates("bagel", given) == ("bagel_dough",)
    assert table.intermediates("bagel", given - {"egg"}) is None and not table.is_makeable("bagel", {"flour"})
    assert table.intermediates("cooked__diced__apple", {"half_apple"}) == ("diced__apple",)


@pytest.mark.parametrize(
    "kind, category, stands",
    [
        ("apple", "apple", True),
        ("apple", "half_apple", True),
        ("vidalia_onion", "onion", True),
        ("raw_egg", "egg", True),
        ("apple", "pineapple", False),
        ("pineapple", "apple", False),
        ("diced__apple", "apple", False),
        ("egg", "eggplant", False),
    ],
)
def test_kinds_of_objects(kind, category, stands):
    assert table.stands_for(kind, category) == stands


def test_inputs_that_are_no_substances_in_use_are_objects():
    names, categories = ("water", "flour", "salt"), ("butter", "pastry")
    (rule,) = (r for r in table.transitions_of(names, categories) if r.output == "pastry")
    assert rule.inputs == ("water", "flour", "salt") and rule.objects == (("butter", 1),) and rule.count == 1
    assert not any(r.output == "pastry" for r in table.transitions_of(names, ("butter",)))


@pytest.fixture
def own(tmp_path, monkeypatch):
    monkeypatch.setattr(table, "_added", [])
    file = tmp_path / "own.json"

    def write(said) -> str:
        file.write_text(said if isinstance(said, str) else json.dumps(said))
        return str(file)

    return write


def test_a_file_of_ones_own_adds_rules(own):
    rule = {"name": "tea", "from": ["water", "green_tea"], "makes": "tea", "temperature": 60}
    assert table.load_transitions(own([rule])) == ("tea",)
    assert table.sources_of("tea") == ("water", "green_tea")


GOOD = {"name": "x", "from": ["water"], "makes": "tea"}


@pytest.mark.parametrize(
    "said, message",
    [
        ("[", "not valid JSON"),
        ({}, "list of rules"),
        ([{"name": "x"}], "needs name, from and makes"),
        ([{**GOOD, "from": []}], "makes something of nothing"),
        ([{**GOOD, "from": ["watr"]}], "watr"),
        ([{**GOOD, "makes": "dust"}], "never in a container"),
        ([{**GOOD, "makes": "water"}], "of itself"),
        ([{**GOOD, "makes": "cooked__*"}], "in one of"),
        ([{**GOOD, "from": ["*"], "makes": "*"}], "one of cooked__"),
        ([{**GOOD, "stir": 1}], "no truth"),
        ([{**GOOD, "count": -1}], "count"),
        ([{**GOOD, "from": {"egg": 0}}], "number of objects"),
        ([{**GOOD, "objects": ["egg"]}], "not among its inputs"),
        ([{**GOOD, "name": "lemonade"}], "known"),
    ],
)
def test_wrong_rules_are_refused(own, said, message):
    with pytest.raises(InputError, match=message):
        table.load_transitions(own(said))
