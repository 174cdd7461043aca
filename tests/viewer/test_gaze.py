"""A camera on its way looks to where there is something to see."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from ig2mj.viewer.gaze import FASTEST, nearness, plan_gaze
from ig2mj.viewer.sight_lines import SightLines

ROOM = """
<mujoco><worldbody>
  <geom type="box" pos="3 0 1" size="0.1 3 1.3"/><geom type="box" pos="-3 0 1" size="0.1 3 1.3"/>
  <geom type="box" pos="0 3 1" size="3 0.1 1.3"/><geom type="box" pos="0 -3 1" size="3 0.1 1.3"/>
</worldbody></mujoco>
"""


@pytest.fixture(scope="module")
def room():
    model = mujoco.MjModel.from_xml_string(ROOM)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return SightLines(model), data


def plan(room, eyes, wishes, rate=6.0):
    eyes = np.concatenate([np.asarray(eyes, float), np.full((len(eyes), 1), 1.5)], axis=1)
    weights = np.full(len(eyes), 2.0)
    return eyes, plan_gaze(*room, eyes, np.asarray(wishes, float), weights, rate=rate, field=100.0)


def test_a_camera_that_walks_towards_a_wall_looks_into_the_room(room):
    eyes, turns = plan(room, [(x, -2.0) for x in np.linspace(0, 2.4, 18)], [0.0] * 18)
    near = nearness(*room, eyes, 100.0)
    step = 360 / near.shape[1]
    assert near[-1, 0] > 0.8
    assert all(near[k, round(turn / step) % near.shape[1]] < 0.5 for k, turn in enumerate(turns))


def test_in_the_open_a_camera_looks_as_wished(room):
    _, turns = plan(room, [(0.0, 0.0)] * 12, [40.0] * 12)
    np.testing.assert_allclose(turns, 40.0, atol=2.5)


def test_no_turn_is_faster_than_the_fastest(room):
    _, turns = plan(room, [(0.0, 0.0)] * 80, [0.0] * 40 + [180.0] * 40)
    assert np.abs(np.diff(turns)).max() * 6.0 <= FASTEST and abs(turns[-1] - turns[0]) > 150
