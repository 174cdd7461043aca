"""`ig2mj states` and `ig2mj predicates`."""

from __future__ import annotations

import json

import pytest

from ig2mj import cli
from ig2mj.simulation import Simulation


def _json(capsys, *argv: str, status: int = 0) -> dict:
    assert cli.call([*argv, "--json"]) == status
    return json.loads(capsys.readouterr().out)


def test_states_of_all_objects_are_listed(tiny_home_folder, capsys):
    out = _json(capsys, "states", str(tiny_home_folder))
    assert out["time"] == 0.0
    assert out["objects"]["apple"] == {"temperature": 23.0, "max_temperature": None, "sliced": False}
    assert out["objects"]["stove"] == {"toggled_on": False, "heat_source": False}
    assert "box" not in out["objects"]


def test_states_after_setting_and_some_time(tiny_home_folder, capsys):
    out = _json(capsys, "states", str(tiny_home_folder), "--set", "toggled_on=stove", "temperature=apple=90",
                "--seconds", "1", "--object", "apple", "--state", "temperature", "in_contact_objs")  # fmt: skip
    assert out["time"] == pytest.approx(1.0)
    assert list(out["objects"]) == ["apple"]
    assert 88.0 < out["objects"]["apple"]["temperature"] < 90.0
    assert out["objects"]["apple"]["in_contact_objs"] == ["table"]


def test_the_table_is_for_people(tiny_home_folder, capsys):
    assert cli.call(["states", str(tiny_home_folder)]) == 0
    text = capsys.readouterr().out
    assert "temperature [C]" in text and "apple" in text


def test_predicates_without_an_expression_list_what_holds(tiny_home_folder, capsys):
    out = _json(capsys, "predicates", str(tiny_home_folder), "--set", "cooked=apple")
    holding = {tuple(row) for row in out["holding"]}
    assert {("on_top", "box", "table"), ("inside", "book", "cabinet"), ("cooked", "apple")} <= holding
    assert not any(row[0] == "burnt" for row in holding)


@pytest.mark.parametrize(("expression", "status"), [("(on_top box table)", 0), ("(cooked apple)", 1)])
def test_an_expression_gives_the_exit_status_and_says_what_is_missing(tiny_home_folder, capsys, expression, status):
    out = _json(capsys, "predicates", str(tiny_home_folder), expression, status=status)
    assert out["holds"] == (status == 0)
    assert expression in out["explanation"]


@pytest.mark.parametrize(
    ("argv", "words"),
    [
        (["states", "--object", "aple"], "near matches: apple"),
        (["states", "--state", "temperatur"], "near matches: temperature"),
        (["states", "--set", "cooked"], "STATE=OBJECT"),
        (["states", "--set", "cooked=apple=maybe"], "neither a number"),
        (["states", "--set", "cooked=table"], "not cookable"),
        (["states", "--seconds", "-1"], "must be between 0 and"),
        (["states", "--seconds", "1e308"], "must be between 0 and"),
        (["predicates", "(cooked aple)"], "near matches: apple"),
        (["predicates", "(cooked apple"], "close every bracket"),
        (["predicates", "--strict", "(cooked table)"], "not cookable"),
    ],
)
def test_bad_input_is_one_line_and_status_2(tiny_home_folder, capsys, argv, words):
    assert cli.call([argv[0], str(tiny_home_folder), *argv[1:]]) == 2
    error = capsys.readouterr().err
    assert words in error and error.count("\n") == 1


@pytest.mark.parametrize(
    "argv",
    [
        ["states", "--object", "aple"],
        ["states", "--state", "temperatur"],
        ["states", "--set", "cooked=apple", "cooked=apple=maybe"],
        ["states", "--set", "toggled_on=aple"],
        ["predicates", "(cooked aple)"],
    ],
)
def test_arguments_are_checked_before_anything_is_simulated(tiny_home_folder, monkeypatch, argv):
    monkeypatch.setattr(Simulation, "step", lambda *_, **__: pytest.fail("simulated"))
    assert cli.call([argv[0], str(tiny_home_folder), *argv[1:], "--seconds", "60"]) == 2


def test_the_switch_has_one_name_and_the_old_one_is_understood(tiny_home_folder, capsys):
    """`toggled_on`, as the predicate: set, asked and listed."""
    for name in ("toggled_on", "toggled"):
        out = _json(capsys, "states", str(tiny_home_folder), "--set", "toggled_on=stove", "--state", name)
        assert out["objects"]["stove"] == {"toggled_on": True}


def test_long_simulations_report_how_far_they_are(monkeypatch):
    import contextlib

    from ig2mj.cli.common import worlds

    said, taken = [], []

    @contextlib.contextmanager
    def progress(what):
        yield lambda done, total, words="", /: said.append((done, total, words))

    monkeypatch.setattr(worlds, "progress", progress)
    worlds.simulate(taken.append, 25.0, 1 / 30)
    assert sum(taken) == 750 and max(taken) == 300
    assert said == [(0, 750, "0 of 25 s"), (300, 750, "10 of 25 s"), (600, 750, "20 of 25 s")]
