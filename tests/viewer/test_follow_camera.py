"""The camera of videos sees its robot wherever that goes."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from ig2mj.agents.registry import make_robot
from ig2mj.scene.scene import load_scene
from ig2mj.viewer.follow_camera import TALL, FollowCamera
from ig2mj.viewer.room_views import standing_places
from ig2mj.viewer.sight_lines import SightLines


@pytest.mark.parametrize("stride", [1, 7])
def test_no_wall_stands_between_the_camera_and_a_robot_that_moves_fast(stride):
    home = load_scene("small_home", [make_robot("humanoid").at(0.0, 0.0, 0.0)])
    data, lines, camera = home.start_data(), SightLines(home.model), FollowCamera(home.tables)
    places = [place for room in home.rooms.names for place in standing_places(home, room)[:: 40 // stride]]
    body = home.tables.agent_body[0]
    slides = [home.model.jnt_qposadr[j] for j in range(home.model.njnt) if home.model.jnt_bodyid[j] == body][:2]
    assert len(places) > 8
    for x, y in places:
        data.qpos[slides] += np.array([x, y]) - data.xpos[body, :2]
        mujoco.mj_forward(home.model, data)
        np.testing.assert_allclose(data.xpos[body, :2], (x, y), atol=1e-6)
        view = camera(home.model, data)
        turn, tilt = np.radians(view.azimuth), np.radians(view.elevation)
        ahead = np.array([np.cos(turn) * np.cos(tilt), np.sin(turn) * np.cos(tilt), np.sin(tilt)])
        eye, head = np.asarray(view.lookat) - view.distance * ahead, data.xpos[body] + [0, 0, TALL[1]]
        geom, far = lines.towards(data, eye, head[None])
        mine = home.tables.body_agent[home.model.geom_bodyid[geom[0]]] == 0
        assert mine or far[0] > np.linalg.norm(head - eye) - 0.12, (x, y)
