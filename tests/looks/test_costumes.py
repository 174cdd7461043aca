"""Robots' costumes: drawn arms reach from shoulders to hands, and follow them."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from ig2mj.agents.registry import make_robot
from ig2mj.looks import visual_of
from ig2mj.looks.costume import _bones
from ig2mj.scene.scene import load_scene

LENGTH = 0.3


@pytest.fixture(scope="module")
def home(tiny_home_folder):
    return load_scene(tiny_home_folder, agents=[make_robot("humanoid").at(0.0, -0.6, 0.0)])


def bones(far, pole=(0.0, 0.0, -1.0)):
    pos = np.array([[[0.0, 0, 0], [far, 0, 0]]])
    return _bones((0, np.zeros(3), 1, np.zeros(3), LENGTH, np.array(pole)), pos, np.tile(np.eye(3), (1, 2, 1, 1)), np)


@pytest.mark.parametrize("far", [0.05, 0.3, 0.59])
def test_the_two_bones_meet_at_the_elbow_and_end_at_the_wrist(far):
    (shoulder, upper), (elbow, fore) = bones(far)
    np.testing.assert_allclose(shoulder[0] + LENGTH * upper[0, :, 2], elbow[0], atol=1e-6)
    np.testing.assert_allclose(elbow[0] + LENGTH * fore[0, :, 2], [far, 0, 0], atol=1e-6)
    assert elbow[0, 2] < 0  # to the side of the pole
    for frame in (upper[0], fore[0]):
        np.testing.assert_allclose(frame.T @ frame, np.eye(3), atol=1e-6)
        assert np.linalg.det(frame) > 0.99


def test_a_hand_out_of_reach_keeps_its_forearm():
    _, (elbow, fore) = bones(0.9)
    np.testing.assert_allclose(elbow[0] + LENGTH * fore[0, :, 2], [0.9, 0, 0], atol=1e-6)


def test_arms_follow_the_hands_and_physics_knows_nothing_of_them(home):
    visual, data = visual_of(home), home.start_data()
    followers = visual.followers
    assert len(followers) == 5  # a body and two arms of two bones
    before = visual.data(home.model, data).geom_xpos[followers.geoms].copy()
    palm = home.tables.hand_body[0]
    joint = home.model.jnt_qposadr[home.model.body_jntadr[palm]]
    data.qpos[joint : joint + 3] += (0.05, 0.02, 0.1)
    mujoco.mj_kinematics(home.model, data)
    after = visual.data(home.model, data).geom_xpos[followers.geoms]
    moved = np.abs(after - before).max(axis=1) > 1e-3
    assert moved.sum() == 2  # one arm
    assert (
        home.model.ngeom + len(followers) <= visual.model.ngeom and not visual.model.geom_contype[followers.geoms].any()
    )


def test_a_humanoids_own_shell_is_not_drawn_and_its_hands_are(home):
    model = visual_of(home).model
    shown = {
        model.body(model.geom_bodyid[g]).name
        for g in range(home.model.ngeom)
        if model.geom_rgba[g, 3] > 0 and model.geom_group[g] < 3
    }
    assert "humanoid" not in shown and {"humanoid_left_hand", "humanoid_right_hand"} <= shown


def test_costumes_of_all_robots_name_bodies_that_they_have(tiny_home_folder):
    for name in ("fetch", "turtlebot"):
        scene = load_scene(tiny_home_folder, agents=[make_robot(name).at(0.0, -0.6, 0.0)])
        visual = visual_of(scene)
        assert np.isfinite(visual.data(scene.model, scene.start_data()).geom_xpos).all()
