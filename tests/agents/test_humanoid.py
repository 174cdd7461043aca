"""The bimanual humanoid: the acceptance tests of iGibson's own, both presets."""

from __future__ import annotations

import jax
import numpy as np
import pytest
from robot_world import GraspingWorld, RobotWorld
from scipy.spatial.transform import Rotation

import ig2mj
from ig2mj.agents.base import Controller, Robot
from ig2mj.agents.fetch import Fetch
from ig2mj.agents.humanoid import Humanoid, HumanoidController
from ig2mj.agents.humanoid.frames import FINGER_CLOSED, HAND_POS, THUMB_CLOSED
from ig2mj.agents.humanoid.robot import BODY
from ig2mj.engine.base import Write
from ig2mj.errors import UnknownNameError

HALF = np.sqrt(0.5)
QUARTER_LEFT = (HALF, 0.0, 0.0, HALF)
PRESETS = pytest.mark.parametrize("compat", BODY)
OUTSIDE = (10.0, 20.0, 0.7)
"""A place where nothing is in the way."""


def rotation(quat) -> Rotation:
    return Rotation.from_quat(np.roll(np.asarray(quat, np.float64), -1))


@pytest.mark.slow
@PRESETS
def test_parts_stay_where_they_are_put(tiny_home_folder, compat):
    """iGibson's first test: fifty zero actions, 1 cm."""
    world = RobotWorld(tiny_home_folder, Humanoid(pos=OUTSIDE, quat=QUARTER_LEFT, compat=compat))
    world.act(times=50)
    body = world.body("humanoid")
    eye, _ = world.controller.eye(world.view, world.state)
    assert body == pytest.approx(OUTSIDE, abs=1e-2)
    assert eye[0] - body == pytest.approx([0, 0.05, 0.4], abs=1e-2)
    assert world.view.agent.eye_pos[0, 0] == pytest.approx(np.asarray(eye[0]), abs=1e-4)
    assert world.body("humanoid_right_hand") - body == pytest.approx([0.12, 0.1, 0.05], abs=1e-2)
    assert world.body("humanoid_left_hand") - body == pytest.approx([-0.12, 0.1, 0.05], abs=1e-2)


@PRESETS
def test_turns_of_a_hand_are_about_the_axes_of_the_body(tiny_home_folder, compat):
    """iGibson's second test: a quarter about z in two actions, then a quarter about y."""
    world = RobotWorld(tiny_home_folder, Humanoid(pos=OUTSIDE, compat=compat))
    start = rotation(world.quat("humanoid_right_hand"))
    for turn in ({"yaw": np.pi / 4, "pitch": 0.0},) * 2 + ({"yaw": 0.0, "pitch": np.pi / 4},) * 2:
        world.act(right_hand_yaw=turn["yaw"], right_hand_pitch=turn["pitch"])
        world.act(times=3)
    expected = Rotation.from_euler("y", np.pi / 2) * Rotation.from_euler("z", np.pi / 2)
    turned = rotation(world.quat("humanoid_right_hand")) * start.inv()
    assert (expected.inv() * turned).magnitude() < 1e-2


@pytest.mark.slow
@PRESETS
def test_a_body_that_walks_in_circles_neither_tilts_nor_loses_its_hands(tiny_home_folder, compat):
    """iGibson's third test, at 1/120 s: 1,800 actions of 0.1 m and one degree, which are five full turns."""
    robot = Humanoid(pos=OUTSIDE, quat=QUARTER_LEFT, compat=compat)
    world = RobotWorld(tiny_home_folder, robot, period=1 / 30)
    world.act(times=1800, body_x=0.1, body_yaw=np.deg2rad(1))
    turned = rotation(world.quat("humanoid"))
    assert np.rad2deg(np.arcsin(np.linalg.norm(turned.as_matrix()[:2, 2]))) < 1, "tilt"
    forward = turned.apply([1, 0, 0])
    assert abs(np.rad2deg(np.arctan2(-forward[0], forward[1]))) < 1, "heading +y"
    for hand, name in enumerate(("left_hand", "right_hand")):
        offset = turned.inv().apply(world.body(f"humanoid_{name}") - world.body("humanoid"))
        assert np.linalg.norm(offset - HAND_POS[hand]) < 1e-2
        start = rotation(world.scene.model.body(f"humanoid_{name}").quat)
        apart = (turned * rotation(QUARTER_LEFT).inv() * start).inv() * rotation(world.quat(f"humanoid_{name}"))
        assert np.rad2deg(apart.magnitude()) < 5


def test_actions_and_proprioception_have_igibsons_order(tiny_home_folder):
    """28 numbers of action; 22 of proprioception, or the 20 of the first release."""
    world = RobotWorld(tiny_home_folder, Humanoid(pos=OUTSIDE))
    controller = world.controller
    assert isinstance(controller, Controller) and isinstance(Humanoid(), Robot)
    assert controller.action_size == 28
    names = controller.action_names
    assert (names[0], names[6], names[12], names[18], names[19], names[20], names[26], names[27]) == (
        "body_x",
        "eye_x",
        "left_hand_x",
        "left_hand_trigger",
        "left_hand_reset",
        "right_hand_x",
        "right_hand_trigger",
        "right_hand_reset",
    )
    felt = world.proprioception()
    assert list(felt)[::6] == ["left_hand_x", "right_hand_x", "eye_x", "left_hand_trigger_fraction"]
    assert len(felt) == 22
    assert [felt[f"right_hand_{n}"] for n in "xyz"] == pytest.approx(HAND_POS[1].tolist(), abs=1e-4)
    assert felt["left_hand_is_grasping"] == -1
    plain = Humanoid(grasp_flags=False).controller(world.scene.tables, 0)
    assert len(plain.proprioception_names) == 20
    assert plain.proprioception(world.view, world.state).shape == (1, 20)


def test_triggers_close_the_fingers_and_add_up(tiny_home_folder):
    world = RobotWorld(tiny_home_folder, Humanoid(pos=OUTSIDE))
    world.act(right_hand_trigger=0.7)
    world.act(right_hand_trigger=0.7)
    world.act(times=5)
    assert world.proprioception()["right_hand_trigger_fraction"] == pytest.approx(1)
    assert np.asarray(world.controller.grip(world.state)) == pytest.approx(np.array([[0, 1]]))
    names = world.scene.tables.agent_joint_names
    joints = dict(zip(names, world.view.agent.joint_pos[0].tolist(), strict=True))
    assert joints["humanoid_right_hand_index_middle_joint"] == pytest.approx(FINGER_CLOSED, abs=0.03)
    assert joints["humanoid_right_hand_thumb_proximal_joint"] == pytest.approx(THUMB_CLOSED, abs=0.03)
    assert joints["humanoid_left_hand_index_middle_joint"] == pytest.approx(0, abs=0.03)


def test_a_hand_goes_no_further_than_its_reach_and_a_reset_brings_it_back(tiny_home_folder):
    world = RobotWorld(tiny_home_folder, Humanoid(pos=OUTSIDE))
    world.act(times=10, right_hand_x=0.3)
    world.act(times=5)
    far = world.body("humanoid_right_hand") - world.body("humanoid")
    assert np.linalg.norm(far - [-0.15, -0.15, 0.3]) == pytest.approx(1.2, abs=5e-3)
    world.act(right_hand_reset=1)
    world.act(times=10)
    assert world.body("humanoid_right_hand") - world.body("humanoid") == pytest.approx(HAND_POS[1], abs=5e-3)


@pytest.mark.parametrize("engine", ["native", pytest.param("warp", marks=pytest.mark.slow)])
def test_a_hand_that_stayed_behind_is_put_back_at_once(tiny_home_folder, engine):
    """Beyond its reach only: a nearer one is pulled, since a hand that jumps could land inside something."""
    world = GraspingWorld(tiny_home_folder, Humanoid(pos=OUTSIDE), engine=engine)
    simulation, model = world.simulation, world.scene.model

    def leave_behind(distance: float) -> None:
        mask, qpos = np.zeros((1, model.nq), bool), np.zeros((1, model.nq))
        joint = model.joint("humanoid_right_hand_x")
        mask[0, joint.qposadr[0]], qpos[0, joint.qposadr[0]] = True, world.body("humanoid")[0] + distance
        simulation._write(Write(qpos_mask=mask, qpos=qpos))

    for distance, jumps in ((2.5, True), (0.8, False)):
        leave_behind(distance)
        before = simulation.view
        action = np.zeros((1, 28), np.float32)
        action[0, world.controller.action_names.index("right_hand_reset")] = 1.0
        _, state = simulation.core.controls.act(action, before, simulation.robots.controllers)
        physics = simulation.core.hand_resets.act(simulation.physics, before, action, state)
        after = np.asarray(simulation.engine.view(physics).agent.hand_pos)[0, 1]
        moved = np.linalg.norm(after - np.asarray(before.agent.hand_pos)[0, 1])
        assert moved == (pytest.approx(2.4, abs=0.05) if jumps else 0.0)
        if jumps:
            assert after - world.body("humanoid") == pytest.approx(HAND_POS[1], abs=1e-4)
        simulation.physics = physics


@pytest.mark.parametrize(("period", "most"), [(0.1, 13.0), (1 / 30, 6.0)])
def test_a_hand_that_comes_free_does_not_rush_to_its_target(tiny_home_folder, period, most):
    """From 2 m away it came at 19 m/s, and what it held or hit flew out of the house."""
    world = RobotWorld(tiny_home_folder, Humanoid(pos=OUTSIDE), period)
    model, simulation = world.scene.model, world.simulation
    mask, qpos = np.zeros((1, model.nq), bool), np.zeros((1, model.nq))
    joint, start = model.joint("humanoid_right_hand_x"), world.body("humanoid_right_hand")
    mask[0, joint.qposadr[0]], qpos[0, joint.qposadr[0]] = True, start[0] - 2.0
    simulation._write(Write(qpos_mask=mask, qpos=qpos))
    fastest, zeros = 0.0, np.zeros((1, 28), np.float32)
    for _ in range(round(0.8 / period)):
        world._ctrl[world._own] = np.asarray(world._control(zeros, world.view, world.state)[0])[0]
        for _ in range(world.steps):
            simulation.step(world._ctrl)
            fastest = max(fastest, float(np.abs(simulation.data.joint("humanoid_right_hand_x").qvel[0])))
    assert fastest < most
    assert world.body("humanoid_right_hand") == pytest.approx(start, abs=5e-3)


def test_no_axis_pulls_with_more_than_its_force(tiny_home_folder):
    """paper A.1: 300 N on hands, 50 N on the body."""
    world = RobotWorld(tiny_home_folder, Humanoid(pos=OUTSIDE))
    model, data = world.simulation.engine.to_mujoco(world.simulation.physics, 0)
    action = np.where(np.arange(28) % 2, -1.0, 1.0) * world.controller.action_high
    world.act(action)
    worst = np.abs(data.actuator_force).reshape(-1)
    body = [model.actuator(i).name in {f"humanoid_{n}" for n in ("x", "y", "z")} for i in range(model.nu)]
    assert worst[body].max() <= 50 + 1e-6
    assert worst.max() <= 300 + 1e-6
    assert np.isfinite(data.qpos).all()


def test_the_body_goes_through_the_floor_but_not_through_walls(tiny_home_folder):
    world = RobotWorld(tiny_home_folder, Humanoid(pos=(-1.2, -1.2, 0.4)))
    world.act(times=20, body_x=-0.1)
    assert world.body("humanoid")[2] == pytest.approx(0.4, abs=5e-3), "its end is 10 cm below the floor's top"
    assert world.body("humanoid")[0] > -1.85, "the wall's face is at -2 m"
    tables = world.scene.tables
    assert world.view.agent.touching[0, 0, tables.object_names.index("walls")]
    assert not world.view.agent.touching[0, 0, tables.object_names.index("floor")]


def test_the_eye_moves_by_itself_without_mass(tiny_home_folder):
    world = RobotWorld(tiny_home_folder, Humanoid(pos=OUTSIDE))
    world.act(eye_z=0.1, eye_yaw=0.5)
    pos, quat = world.controller.eye(world.view, world.state)
    assert pos[0] - world.body("humanoid") == pytest.approx([0.05, 0, 0.5], abs=1e-3)
    looks = rotation(quat[0]).apply([0, 0, -1])
    assert looks == pytest.approx([np.cos(0.5), np.sin(0.5), 0], abs=1e-3)
    assert world.scene.model.nv - 11 * 6 == 38 + 2, "no degrees of freedom for it (11 loose objects, two joints)"


@pytest.mark.slow
def test_ghosts_are_shown_for_a_hand_that_cannot_follow(tiny_home_folder):
    world = RobotWorld(tiny_home_folder, Humanoid(pos=OUTSIDE))
    controller = world.controller
    assert isinstance(controller, HumanoidController)
    shown, _, _ = controller.ghosts(world.view, world.state)
    assert not shown.any()
    _, state = world.controller.control(np.eye(28, dtype=np.float32)[[20]] * 0.3, world.view, world.state)
    shown, pos, _ = controller.ghosts(world.view, state)
    assert shown.tolist() == [[False, True]]
    assert pos[0, 1] - world.body("humanoid") == pytest.approx(HAND_POS[1] + [0.3, 0, 0], abs=1e-3)


def test_control_is_one_pure_function_of_a_batch(tiny_home_folder):
    world = RobotWorld(tiny_home_folder, Humanoid(pos=OUTSIDE))
    many = jax.tree.map(lambda x: np.repeat(np.asarray(x), 3, 0), (world.view, world.controller.initial(1)))
    action = np.zeros((3, 28), np.float32)
    action[1, 20] = 0.1
    ctrl, state = jax.jit(world.controller.control)(action, *many)
    assert ctrl.shape == (3, world.scene.model.nu)
    assert np.array_equal(ctrl[0], ctrl[2]) and not np.array_equal(ctrl[0], ctrl[1])
    shapes = [np.shape(leaf) for leaf in jax.tree.leaves(state)]
    assert shapes == [np.shape(leaf) for leaf in jax.tree.leaves(many[1])]


@pytest.mark.slow
def test_two_humanoids_stand_in_one_home(tiny_home_folder):
    other = Humanoid("other", pos=(-1, 1, 0.6), look="blue")
    world = RobotWorld(tiny_home_folder, Humanoid(pos=(-1, 0, 0.6)), others=(other,))
    assert world.scene.tables.agent_names == ("humanoid", "other")
    assert world.scene.tables.hand_agent.tolist() == [0, 0, 1, 1]
    world.act(times=5, right_hand_z=0.02)
    assert world.body("humanoid_right_hand")[2] - world.body("humanoid")[2] == pytest.approx(0.15, abs=5e-3)


def test_an_unknown_preset_is_named():
    with pytest.raises(UnknownNameError, match="paper"):
        Humanoid(compat="papers")


@pytest.mark.slow
def test_without_any_control_the_humanoid_stays_at_its_start():
    """Keyframes of a scene without actuators know no controls; the robot's start is what its servos are told first."""
    simulation = ig2mj.Simulation(ig2mj.load_scene("small_home", agents=[Humanoid(pos=(1.65, 0.95, 1.0))]))
    view = simulation.step(count=15)
    assert np.asarray(view.agent.base_pos)[0, 0] == pytest.approx([1.65, 0.95, 1.0], abs=0.02)


@pytest.mark.slow
def test_two_robots_stay_at_their_start_in_a_scene_without_keyframes(tiny_home_folder):
    robots = [Fetch(pos=(-1.0, -1.5, 0.0)), Humanoid(pos=(1.65, 0.95, 1.0))]
    scene = ig2mj.load_scene(tiny_home_folder, agents=robots)
    simulation = ig2mj.Simulation(scene)
    start = np.array(simulation.view.agent.joint_pos)
    view = simulation.step(count=15)
    assert np.asarray(view.agent.base_pos)[0, 1] == pytest.approx([1.65, 0.95, 1.0], abs=0.02)
    of_fetch = np.asarray(scene.tables.agent_joint_agent) == 0
    assert np.abs(np.asarray(view.agent.joint_pos) - start)[0, of_fetch].max() < 0.02
