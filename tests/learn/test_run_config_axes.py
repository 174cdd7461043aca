"""Axes of `Randomize` in a run's settings."""

from __future__ import annotations

import pytest

from ig2mj.errors import EngineError, Ig2mjError, UnknownNameError
from ig2mj.learn.run_config import RunSettings


def test_axes_come_by_name_or_with_settings():
    assert RunSettings(randomize="lights, camera").varied["randomize"].axes == ("lights", "camera")
    given = RunSettings(randomize='{"lights": true, "robot_start": {"shift": 0.25}}').varied["randomize"]
    assert given.axes == ("lights", "robot_start")
    assert given.robot_start.shift == 0.25 and given.robot_start.turn == 10.0


@pytest.mark.parametrize(
    ("text", "error", "message"),
    [
        ('{"lights": tru', Ig2mjError, "no JSON"),
        ('{"light": true}', UnknownNameError, "lights"),
        ('{"robot_start": {"shfit": 1}}', UnknownNameError, "shift"),
        ('{"robot_start": {"shift": -1}}', EngineError, "shift = -1"),
    ],
)
def test_what_is_no_setting_says_so(text, error, message):
    with pytest.raises(error, match=message):
        _ = RunSettings(randomize=text).varied
