"""The table of substances."""

import json

import pytest

from ig2mj.errors import InputError, UnknownNameError
from ig2mj.knowledge import substances as table


def test_derived_substances_have_the_kind_of_their_base():
    assert table.substance("cooked__white_rice").kind == "granular"
    assert table.substance("melted__white_chocolate").kind == "liquid"
    assert table.substance("cooked__diced__apple").kind == "granular"
    with pytest.raises(UnknownNameError, match="ater"):
        table.substance("ater")


def test_what_cleans_names_substances_that_exist():
    for made in table.substances().values():
        for name in made.cleaned_by:
            assert name == table.DRY or table.substance(name).has_volume


@pytest.fixture
def own(tmp_path, monkeypatch):
    monkeypatch.setattr(table, "_added", {})
    file = tmp_path / "own.json"

    def write(said) -> str:
        file.write_text(said if isinstance(said, str) else json.dumps(said))
        return str(file)

    return write


def test_a_file_of_ones_own_adds_substances(own):
    assert table.load_substances(own({"liquid": {"names": {"elderberry_syrup": {"freeze": -4}}}})) == (
        "elderberry_syrup",
    )
    assert table.substance("elderberry_syrup").freeze == -4
    assert table.substance("elderberry_syrup").cleaned_by[0] == "water"


@pytest.mark.parametrize(
    "said, message",
    [
        ("{", "not valid JSON"),
        ({"gas": {}}, "liquid, granular, visual"),
        ({"liquid": {"names": []}}, "mapping"),
        ({"liquid": {"names": {"a b": {}}}}, "must be a name"),
        ({"liquid": {"names": {"x": {"colour": [1, 2, 3]}}}}, "colour"),
        ({"liquid": {"names": {"x": {"freeze": "cold"}}}}, "freezing"),
        ({"liquid": {"names": {"x": {"cleaned_by": []}}}}, "cleaned_by"),
        ({"liquid": {"names": {"water": {"freeze": 5}}}}, "otherwise"),
    ],
)
def test_wrong_files_are_refused(own, said, message):
    with pytest.raises(InputError, match=message):
        table.load_substances(own(said))
