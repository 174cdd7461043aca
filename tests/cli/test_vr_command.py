"""`ig2mj vr`: what is refused before anything is loaded, and a recording played again."""

from __future__ import annotations

import pytest

from ig2mj.cli import call
from ig2mj.vr import server


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--device", "glove"], "no device is named 'glove'"),
        (["--device", "recorded"], "--poses FILE needs --device recorded"),
        (["--poses", "visit.h5"], "--poses FILE needs --device recorded"),
        (["--seconds", "nan"], "--seconds must be finite"),
        (["--row", "-2"], "not negative"),
        (["--device", "openxr", "--token", "auto"], "need --device page"),
        (["--host", "0.0.0.0"], "needs --token"),
        (["--port", "70000"], "--port 70000"),
        (["--certificate", "nothing.pem"], "nothing.pem"),
    ],
)
def test_what_makes_no_sense_is_refused_in_one_line(arguments, message, capsys, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(server, "check_page", lambda: None)
    assert call(["vr", "CookingMeat", *arguments]) == 2
    (line,) = capsys.readouterr().err.strip().splitlines()
    assert message in line


def test_without_three_js_the_command_that_fetches_it_is_named(capsys, monkeypatch, tmp_path):
    monkeypatch.setattr(server, "PAGE", tmp_path)
    assert call(["vr", "CookingMeat"]) == 2
    assert "make web" in capsys.readouterr().err


def test_a_task_that_is_not_there_is_named(capsys, monkeypatch):
    monkeypatch.setattr(server, "check_page", lambda: None)
    assert call(["vr", "CookingMeet", "--port", "0"]) == 2
    assert "CookingMeat" in capsys.readouterr().err
    assert call(["vr", "PointNavigation", "--port", "0"]) == 2
    assert "humanoid" in capsys.readouterr().err


@pytest.mark.slow
def test_a_page_that_nobody_opens_is_recorded_replayed_and_played_again(capsys, monkeypatch, tmp_path):
    monkeypatch.setattr(server, "check_page", lambda: None)
    visit, again = str(tmp_path / "visit.h5"), str(tmp_path / "again.h5")
    common = ["vr", "CookingMeat", "--pool-size", "2", "--row", "0"]
    assert call([*common, "--port", "0", "--seconds", "2", "--timing", "--record", visit]) == 0
    out = capsys.readouterr().out
    assert "open http://127.0.0.1:" in out and "goal not reached" in out
    assert call(["demos", "replay", visit, "--check"]) == 0
    assert "all the same" in capsys.readouterr().out
    assert call([*common, "--device", "recorded", "--poses", visit, "--record", again]) == 0
    assert call(["demos", "replay", again, "--check"]) == 0
