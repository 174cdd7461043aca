"""The floating hand: it goes where it is told, with no more than its force, and its fingers close."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

import ig2mj
from ig2mj.agents.base import Controller, Robot
from ig2mj.agents.floating_hand import HAND_FORCE, FloatingHand, add_floating_hand, hand_ctrl

EMPTY = "<mujoco><option timestep='0.00833333' gravity='0 0 -9.8'><flag sleep='enable'/></option></mujoco>"


def lone_hand(**options) -> tuple[mujoco.MjModel, mujoco.MjData]:
    spec = mujoco.MjSpec.from_string(EMPTY)
    add_floating_hand(spec, **options)
    model = spec.compile()
    return model, mujoco.MjData(model)


def test_the_hand_floats_where_it_is_put():
    model, data = lone_hand(pos=(1, 2, 3))
    mujoco.mj_step(model, data, nstep=240)
    assert data.body("hand").xpos == pytest.approx([1, 2, 3], abs=1e-6)
    assert data.ntree_awake == 1, "a tree with actuators never sleeps"


def test_slides_run_along_world_axes_however_the_hand_is_turned():
    half = np.sqrt(0.5)
    model, data = lone_hand(pos=(0, 0, 1), quat=(half, 0, 0, half))
    data.ctrl[:] = hand_ctrl((0.3, -0.2, 0.1))
    mujoco.mj_step(model, data, nstep=480)
    assert data.body("hand").xpos == pytest.approx([0.3, -0.2, 1.1], abs=1e-3)
    assert data.body("hand").xquat == pytest.approx([half, 0, 0, half], abs=1e-3)


def test_the_hand_turns_to_roll_pitch_and_yaw():
    model, data = lone_hand()
    data.ctrl[:] = hand_ctrl(turn=(0.3, 0.4, 0.5))
    mujoco.mj_step(model, data, nstep=480)
    assert data.qpos[3:6] == pytest.approx([0.3, 0.4, 0.5], abs=2e-3)


def test_no_axis_pulls_with_more_than_the_papers_force():
    """paper appendix A.3: 300 N."""
    model, data = lone_hand()
    data.ctrl[:] = hand_ctrl((100, 100, 100), (3, 3, 3), 1)
    worst = 0.0
    for _ in range(60):
        mujoco.mj_step(model, data)
        worst = max(worst, np.abs(data.actuator_force).max())
    assert worst == pytest.approx(HAND_FORCE)
    assert np.isfinite(data.qpos).all()


def test_a_hand_far_from_its_target_is_no_projectile():
    """It moves at most at force over damping, and comes to a near target as a critically damped servo does."""
    model, data = lone_hand(pos=(0, 0, 1))
    damping = model.dof_damping[:3]
    assert damping == pytest.approx(2 * np.sqrt(model.actuator_gainprm[:3, 0] * model.body_subtreemass[1]), rel=1e-6)
    data.ctrl[:] = hand_ctrl((100, -100, 100))
    speeds = []
    for _ in range(240):
        mujoco.mj_step(model, data)
        speeds.append(np.abs(data.qvel[:3]).max())
    assert max(speeds) < 1.01 * HAND_FORCE / damping[0] < 2.3
    assert speeds[-1] == pytest.approx(HAND_FORCE / damping[0], rel=1e-3)


def test_a_hand_comes_to_a_near_target_without_passing_it():
    model, data = lone_hand(pos=(0, 0, 1))
    data.ctrl[:] = hand_ctrl((0.1, 0, 0))
    way = []
    for _ in range(60):
        mujoco.mj_step(model, data)
        way.append(data.qpos[0])
    assert max(way) < 0.1005 and way[-1] == pytest.approx(0.1, abs=1e-3)
    rate = np.sqrt(model.actuator_gainprm[0, 0] / model.body_subtreemass[1])
    t = 1 / 120 * np.arange(1, 61)
    assert np.abs(way - 0.1 * (1 - (1 + rate * t) * np.exp(-rate * t))).max() < 0.02, "1/120 s is coarse"


def test_fingers_close_toward_the_palms_face_and_the_hand_never_hits_itself():
    model, data = lone_hand()
    tip = data.body("hand_index_distal")
    mujoco.mj_forward(model, data)
    start = np.array(tip.xpos)
    data.ctrl[:] = hand_ctrl(closed=1)
    for _ in range(240):
        mujoco.mj_step(model, data)
        assert data.ncon == 0
    assert tip.xpos[1] < start[1] - 0.02, "the palm faces -y"
    assert data.qpos[8:] == pytest.approx([1.2] * 8, abs=0.02)
    assert data.qpos[6:8] == pytest.approx([0.6] * 2, abs=0.02)


def test_a_hand_pushes_a_box_along_a_table(tiny_home_folder):
    hand = FloatingHand(pos=(0.1, 0.25, 0.65))
    simulation = ig2mj.Simulation(ig2mj.load_scene(tiny_home_folder, agents=[hand]))
    simulation.step(count=30)
    before = simulation.object_pose("box")[0]
    for step in range(30):
        simulation.step(hand_ctrl((0, -0.008 * step, 0)))
    after = simulation.object_pose("box")[0]
    assert before[1] - after[1] > 0.02
    assert after[2] == pytest.approx(before[2], abs=5e-3)


def test_two_hands_have_names_of_their_own(tiny_home_folder):
    agents = [FloatingHand(name=n, pos=(x, 0, 1)) for n, x in (("left", -1), ("right", -0.5))]
    scene = ig2mj.load_scene(tiny_home_folder, agents=agents)
    assert scene.tables.agent_names == ("left", "right")
    assert scene.model.nu == 32
    view = ig2mj.Simulation(scene).view
    assert view.agent.base_pos[0, :, 0] == pytest.approx([-1, -0.5])


def test_the_hand_is_a_robot_whose_actions_are_its_controls(tiny_home_folder):
    hand = FloatingHand(pos=(0, 0, 1.5))
    assert isinstance(hand, Robot)
    scene = ig2mj.load_scene(tiny_home_folder, agents=[hand])
    controller = hand.controller(scene.tables, 0)
    assert isinstance(controller, Controller)
    assert controller.action_size == len(controller.action_names) == scene.model.nu
    assert scene.model.actuator(7).name == f"hand_{controller.action_names[7]}"
    simulation = ig2mj.Simulation(scene)
    state = controller.initial(2)
    action = np.stack([hand_ctrl((0.1, 0.2, 0.3), closed=1), hand_ctrl(turn=(9, 0, 0))])
    ctrl, state = controller.control(action, simulation.view, state)
    assert ctrl[0] == pytest.approx(action[0])
    assert ctrl[1, 3] == pytest.approx(np.pi), "clipped"
    assert controller.grip(state)[:, 0] == pytest.approx([1, 0])
