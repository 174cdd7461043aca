"""`ig2mj activity`: what an activity asks for, and where it can be done."""

import json

import pytest

from ig2mj.cli import call


@pytest.mark.slow
def test_list_names_all_100_and_the_homes_that_fit(capsys):
    assert call(["activity", "list", "--json"]) == 0
    rows = {row["activity"]: row for row in json.loads(capsys.readouterr().out)}
    assert len(rows) == 100
    assert "small_home" in rows["cleaning_windows"]["homes"]
    assert sum(bool(row["homes"]) for row in rows.values()) >= 79


def test_show_tells_the_start_the_goal_and_the_binding(capsys):
    assert call(["activity", "show", "cleaning_windows", "--scene", "small_home"]) == 0
    said = capsys.readouterr().out
    assert "  window 1 is dusty" in said and "  window 1 is not dusty" in said
    assert "rag.n.01_1                       rag_0, added from the object library" in said
    assert "sink_0, kitchen_0" in said


def test_show_says_quantifiers_in_words(capsys):
    assert call(["activity", "show", "assembling_gift_baskets"]) == 0
    said = capsys.readouterr().out
    assert "for pairs of basket and candle, as many as there are: the candle is inside the basket" in said
    assert "also fits:" in said


def test_a_home_that_lacks_something_says_what_and_exits_with_1(capsys):
    assert call(["activity", "show", "cleaning_garage", "--scene", "aspen"]) == 1
    assert "aspen: has no garage; has no storage_room" in capsys.readouterr().out


def test_a_file_of_ones_own(tmp_path, capsys):
    file = tmp_path / "mine.bddl"
    text = "(define (problem mine-0) (:domain igibson) (:objects apple.n.01_1 - apple.n.01) (:init) (:goal {}))"
    file.write_text(text.format("(sliced apple.n.01_1)"))
    assert call(["activity", "show", str(file), "--scene", "small_home", "--json"]) == 0
    shown = json.loads(capsys.readouterr().out)
    assert shown["activity"] == "mine" and shown["goal"] == ["(sliced apple.n.01_1)"]
    assert set(shown["binding"]["objects"]) == {"apple.n.01_1"}
    file.write_text(text.format("\n(sliced appel.n.01_1)"))
    assert call(["activity", "show", str(file)]) == 2
    assert "mine.bddl: line 2: 'appel.n.01_1': is not an object of :objects" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "telling"),
    [
        (["show", "cleaning_window"], "near matches: cleaning_windows"),
        (["show", "cleaning_windows", "--scene", "birhc"], "near matches: birch"),
        (["show", "nowhere.bddl"], "nowhere.bddl: there is no such file"),
        (["list", "--behavior1k"], "run `ig2mj activity fetch`"),
    ],
)
def test_bad_input_is_one_line_and_exit_2(arguments, telling, tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("IG2MJ_CACHE_DIR", str(tmp_path))
    assert call(["activity", *arguments]) == 2
    said = capsys.readouterr().err
    assert telling in said and said.count("\n") == 1
