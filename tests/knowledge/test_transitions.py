"""The table of transition rules."""

import json

import pytest

from ig2mj.errors import InputError
from ig2mj.knowledge import transitions as table
from ig2mj.knowledge.substances import substance


def test_rules_name_substances_that_exist():
    for rule in table.transitions():
        for name in (*rule.inputs, rule.output):
            assert table.ANY in name or substance(name).has_volume


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
    assert not table.is_makeable("cooked__diced__apple")  # nothing dices


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
        ([{**GOOD, "name": "lemonade"}], "known"),
    ],
)
def test_wrong_rules_are_refused(own, said, message):
    with pytest.raises(InputError, match=message):
        table.load_transitions(own(said))
