"""A robot's camera looks out of the robot: batched pictures show surfaces from behind, too."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from ig2mj.agents import Fetch, FloatingHand, Humanoid, TurtleBot

VISIBLE = np.array([1, 1, 1, 0, 0, 0], np.uint8)


@pytest.mark.parametrize("robot", [Humanoid(), Fetch(), TurtleBot(), FloatingHand()], ids=lambda r: type(r).__name__)
def test_the_camera_is_in_none_of_its_own_geoms(robot):
    spec = mujoco.MjSpec()
    if hasattr(robot, "attach"):
        entry = robot.attach(spec, robot.pos, robot.quat)
    else:
        entry = robot(spec)
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    eye = data.camera(entry.camera).xpos
    normal = np.zeros(3)
    inside = set()
    for direction in np.random.default_rng(0).normal(size=(2000, 3)):
        geom = np.zeros(1, np.int32)
        far = mujoco.mj_ray(model, data, eye, direction, VISIBLE, 1, -1, geom, normal)
        if far >= 0 and direction @ normal > 0:
            inside.add(model.geom(int(geom[0])).name)
    assert not inside
