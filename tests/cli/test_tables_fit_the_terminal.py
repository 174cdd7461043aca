"""Tables of the commands: no word is broken in a terminal of 80 columns, nothing is left out in a file."""

from __future__ import annotations

import io
import json
import math

import pytest
from rich.console import Console

from ig2mj import cli
from ig2mj.cli.common import printing
from ig2mj.cli.common.printing import least_width, make_table, print_json
from ig2mj.scene.manifest import load_manifest

COLUMNS = ("object", "?model", "?>size", "room")
ROWS = [("table_0", "a" * 20, 1.25, "kitchen_0"), ("lamp_0", "b", 3, "living_room_0")]


def drawn(width: int) -> str:
    console = Console(file=io.StringIO(), width=width)
    console.print(make_table("things", COLUMNS, ROWS, width))
    return console.file.getvalue()  # type: ignore[attr-defined]


def test_the_last_optional_columns_go_first_and_are_named():
    full = least_width(COLUMNS, ROWS)
    assert full == len("table_0") + 20 + len("size") + len("living_room_0") + 3 * 2
    assert "a" * 20 in drawn(full) and "1.25" in drawn(full) and "wider" not in drawn(full)
    narrower = drawn(full - 1)
    assert "a" * 20 in narrower and "1.25" not in narrower and "a wider terminal shows: size" in narrower
    narrowest = drawn(25)
    assert "a" * 20 not in narrowest and "living_room_0" in narrowest


def test_json_of_what_is_not_finite_is_null(capsys):
    print_json({"a": math.inf, "b": [math.nan, 1]})
    assert json.loads(capsys.readouterr().out) == {"a": None, "b": [None, 1]}


@pytest.fixture
def narrow(monkeypatch):
    """stdout is a terminal of 80 columns."""
    monkeypatch.setattr(printing, "stdout_console", lambda: Console(highlight=False, width=80))


@pytest.mark.parametrize(
    ("command", "word"), [("inspect", "kitchen_0"), ("states", "max_temperature"), ("predicates", "in_contact_with")]
)
def test_names_are_whole_in_80_columns(narrow, tiny_home_folder, capsys, command, word):
    assert cli.call([command, str(tiny_home_folder)]) == 0
    out = capsys.readouterr().out
    assert all(len(line) <= 80 for line in out.splitlines())
    named = [o.name for o in load_manifest(tiny_home_folder).objects if command == "inspect"]
    assert {*named, "table", word} <= set(out.replace(",", " ").replace(";", " ").split())


def test_homes_and_categories_are_listed_apart(narrow, capsys):
    assert cli.call(["homes", "list"]) == 0
    out = capsys.readouterr().out
    assert "small_home" in out and "models" not in out and all(len(line) <= 80 for line in out.splitlines())
    assert cli.call(["homes", "list", "--json"]) == 0
    homes = json.loads(capsys.readouterr().out)
    assert all(home["objects"] >= home["movable"] > 0 and home["rooms"] for home in homes)
    assert cli.call(["homes", "list", "--objects"]) == 0
    out = capsys.readouterr().out
    assert "fridge" in out and all(len(line) <= 80 for line in out.splitlines())
    assert cli.call(["homes", "list", "--only", "apple", "fridge", "--json"]) == 0
    assert [c["category"] for c in json.loads(capsys.readouterr().out)] == ["apple", "fridge"]


@pytest.mark.parametrize(
    ("argv", "says"),
    [
        (["homes", "list", "--only", "frige"], "near matches: fridge"),
        (["homes", "convert", "--dataset", "{tmp}", "--out", "{tmp}/out"], "holds no scenes/"),
        (["homes", "sheet", "--out", "{tmp}/a.xyz", "--only", "apple"], "is not an image format"),
        (["homes", "sheet", "--out", "{tmp}/a.png", "--models", "0"], "at least one is needed"),
        (["sample", "{home}", "--disturb", "--out", "{tmp}/none/pool.npz"], "does not exist"),
        (["sample", "{home}", "--disturb", "--jobs", "-1"], "--jobs -1"),
        (["sample", "{home}", "--disturb", "--share", "2"], "between 0 and 1"),
    ],
)
def test_what_cannot_work_is_told_at_once(tiny_home_folder, tmp_path, capsys, argv, says):
    assert cli.call([a.format(tmp=tmp_path, home=tiny_home_folder) for a in argv]) == 2
    error = capsys.readouterr().err
    assert says in error and error.count("\n") == 1
