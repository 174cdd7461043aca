"""Inverse kinematics of an arm on wheels: postures for poses that its joints reach."""

import numpy as np

import ig2mj
from ig2mj.agents import Fetch
from ig2mj.agents.task_robot import TaskRobot
from ig2mj.planning.arms import ArmBody
from ig2mj.planning.body_kinds import body_of


def test_almost_all_poses_that_an_arm_reaches_have_a_posture(tiny_home_folder):
    scene = ig2mj.load_scene(tiny_home_folder, agents=[Fetch().at(-0.45, 0.0, 0.0)])
    robot = scene.agents[0]
    assert isinstance(robot, TaskRobot)
    body = body_of(scene, robot.controller(scene.tables, 0, 0.1))
    assert isinstance(body, ArmBody)
    model, rng = body.model, np.random.default_rng(1)
    turns = np.isinf(model.chain.upper)
    low, high = np.where(turns, -np.pi, model.chain.lower), np.where(turns, np.pi, model.chain.upper)
    pos, quat = model.hand(low + (high - low) * rng.random((300, len(low))))
    ahead = (pos[:, 2] > 0.05) & (pos[:, 0] > 0.3) & (np.abs(pos[:, 1]) < 0.6)
    assert ahead.sum() > 50
    found = [model.solve(p, q) for p, q in zip(pos[ahead], quat[ahead], strict=True)]
    assert np.mean([len(f) > 0 for f in found]) > 0.97
    at, _ = model.hand(np.array([f[0] for f in found if len(f)]))
    reached = pos[ahead][[len(f) > 0 for f in found]]
    assert np.linalg.norm(at - reached, axis=1).max() < 0.015
