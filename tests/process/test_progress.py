"""How far long work is, and how long it may take."""

from __future__ import annotations

import io
import sys
import time

import pytest

from ig2mj.envs.rollout import Pace
from ig2mj.envs.state import EnvState
from ig2mj.process import progress as progress_module
from ig2mj.process import waiting
from ig2mj.process.progress import Share, in_words, progress, shown_by
from ig2mj.process.waiting import Waiting


@pytest.fixture
def clock(monkeypatch):
    """Seconds that only pass where a test says so."""

    class Clock:
        now = 100.0

    monkeypatch.setattr(time, "monotonic", lambda: Clock.now)
    return Clock


def test_the_time_that_is_left_is_that_of_the_pace_so_far(clock):
    share = Share("playing")
    assert share.text() == "playing"
    clock.now += 60.0  # compiling
    share(0, 8, "0 of 8 episodes")
    assert share.text() == "playing: 0 of 8 episodes"
    clock.now += 10.0
    share(2, 8, "2 of 8 episodes")
    assert share.text() == "playing: 2 of 8 episodes, about 30 s left"


def test_long_times_are_in_minutes_and_hours():
    assert [in_words(s) for s in (40, 240, 9000)] == ["40 s", "4 min", "2.5 h"]


def test_a_bar_shows_the_words_in_place_of_a_line():
    told = []
    with shown_by(told.append), progress("playing") as report:
        report(4, 8, "4 of 8 episodes")
    assert told == ["playing", "playing: 4 of 8 episodes"]


def test_without_a_bar_a_line_is_on_stderr(monkeypatch):
    for name, seconds in (("PATIENCE", 0.02), ("EVERY", 0.05)):
        monkeypatch.setattr(waiting, name, seconds)
    monkeypatch.setattr(progress_module, "WAITING", Waiting())
    monkeypatch.setattr(sys, "stderr", io.StringIO())
    with progress("playing") as report:
        report(4, 8, "4 of 8 episodes")
        deadline = time.monotonic() + 20
        while "4 of 8" not in sys.stderr.getvalue():
            assert time.monotonic() < deadline
            time.sleep(0.01)
    assert sys.stderr.getvalue().splitlines()[-1].startswith("playing: 4 of 8 episodes")


def test_lines_are_rarer_the_longer_work_takes():
    works = Waiting()
    works._told = 1000.0
    assert works._due(990.0, in_terminal=False) == pytest.approx(1005.0)
    assert works._due(0.0, in_terminal=False) == pytest.approx(1200.0)
    assert works._due(0.0, in_terminal=True) == pytest.approx(1000.5)


def test_what_who_watches_takes_is_no_part_of_the_pace(clock):
    """100 steps in 10 s, and 90 s of filming."""

    def film(state):
        clock.now += 0.9

    state, pace = object.__new__(EnvState), Pace(film)
    pace.look(state)
    pace.stepped(1)
    for _ in range(100):
        clock.now += 0.1
        pace.stepped(1)
        pace.look(state)
    assert pace.steps_per_second() == pytest.approx(10.0)
