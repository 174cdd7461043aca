"""TurtleBot drives as its wheels say."""

from __future__ import annotations

import numpy as np
import pytest
from robot_world import RobotWorld

from ig2mj.agents.turtlebot import AXLE, MAX_SPEED, TurtleBot

START = (0.0, -1.2, 0.0)


def test_it_drives_forwards_turns_and_knows_how_fast(tiny_home_folder):
    world = RobotWorld(tiny_home_folder, TurtleBot(pos=START))
    world.act(times=5)
    before = np.array(world.body("turtlebot"))
    assert before[2] == pytest.approx(0, abs=2e-3)
    world.act(times=10, forward=0.5)
    assert world.body("turtlebot") - before == pytest.approx([0.5 * MAX_SPEED, 0, 0], abs=0.02)
    felt = world.proprioception()
    assert felt["dd_base_lin_vel"] == pytest.approx(0.5 * MAX_SPEED, rel=0.01)
    assert world.view.agent.base_linvel[0, 0, 0] == pytest.approx(0.5 * MAX_SPEED, rel=0.03)
    world.act(times=10, turn_left=0.2)
    rate = 0.2 * 2 * MAX_SPEED / AXLE
    assert world.proprioception()["dd_base_ang_vel"] == pytest.approx(rate, rel=0.01)
    assert world.view.agent.base_angvel[0, 0, 2] == pytest.approx(rate, rel=0.03)


def test_five_discrete_actions(tiny_home_folder):
    """iGibson's discrete actions: half the wheels' speed, 0.5 rad/s of each wheel, nothing."""
    world = RobotWorld(tiny_home_folder, TurtleBot(pos=START, discrete=True))
    assert world.controller.action_size == 1 and world.controller.action_high.tolist() == [4]
    wheels = []
    for choice in range(5):
        ctrl, _ = world.controller.control(np.array([[choice]], np.float32), world.view, world.state)
        wheels.append(np.asarray(ctrl)[0].tolist())
    half = 0.5 * MAX_SPEED / 0.038
    expected = [[half, half], [-half, -half], [-0.5, 0.5], [0.5, -0.5], [0, 0]]
    np.testing.assert_allclose(wheels, expected, rtol=1e-5)
