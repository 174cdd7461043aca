"""A robot of one's own: what is found in its URDF, how it moves, grips and takes part in tasks; bad input."""

from __future__ import annotations

import pathlib

import numpy as np
import pytest
from ig2mj_converters.base.options import ConvertOptions
from ig2mj_converters.convert_robot import convert_robot
from robot_world import GraspingWorld
from rover import URDF, write_rover
from tiny_home import write_tiny_home

import ig2mj
from ig2mj.agents.base import Controller, Robot
from ig2mj.agents.urdf import Layout, UrdfRobot
from ig2mj.agents.urdf.base_motion import drive
from ig2mj.cli import call
from ig2mj.errors import EngineError, InputError, UnknownNameError


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> pathlib.Path:
    made = tmp_path_factory.mktemp("robot")
    convert_robot(write_rover(made / "urdf"), made / "rover", options=ConvertOptions(report=False))
    return made / "rover"


@pytest.fixture(scope="module")
def home(tmp_path_factory) -> pathlib.Path:
    return write_tiny_home(tmp_path_factory.mktemp("homes") / "home")


@pytest.fixture(scope="module")
def world(folder, home) -> GraspingWorld:
    """The rover on free floor, before it does anything; tests put it back."""
    return GraspingWorld(home, UrdfRobot.load(folder).at(-1.0, 0.5, -np.pi / 2))


@pytest.fixture
def rover(world) -> GraspingWorld:
    world.simulation.reset()
    return world


def test_it_is_a_robot_and_its_parts_are_found_by_name(folder, world):
    robot = UrdfRobot.load(folder)
    assert isinstance(robot, Robot) and isinstance(world.controller, Controller)
    assert robot.layout == Layout(
        base="differential",
        wheels=("left_wheel_joint", "right_wheel_joint"),
        arm=("shoulder_pan", "lift", "wrist"),
        gripper=("left_finger_joint", "right_finger_joint"),
        hand="hand",
        camera="camera_link",
        laser="laser_link",
    )
    names = ("forward", "turn_left", "shoulder_pan", "lift", "wrist", "gripper")
    assert world.controller.action_names == names
    assert drive(robot.body, robot.layout) == pytest.approx((0.06, 0.32, 12.0))


def test_it_stands_still_and_drives_where_it_is_told(rover):
    """Full speed is 12 rad/s of wheels of 6 cm: 0.72 m/s, less what the caster drags; the wheels' axes point
    opposite ways."""
    start = rover.body("rover").copy()
    rover.act(times=5)
    assert np.linalg.norm(rover.body("rover") - start) < 1e-3
    rover.act(times=10, forward=0.5)
    moved = rover.body("rover") - start
    assert moved[1] == pytest.approx(-0.36, abs=0.06) and abs(moved[0]) < 0.01 and abs(moved[2]) < 0.005
    before = rover.quat("rover").copy()
    rover.act(times=5, turn_left=0.2)
    w, _, _, z = rover.quat("rover")
    turned = 2 * (np.arctan2(z, w) - np.arctan2(before[3], before[0]))
    assert turned == pytest.approx(0.2 * 2 * 0.72 / 0.32 * 0.5, abs=0.12)
    assert rover.proprioception()["dd_base_ang_vel"] == pytest.approx(0.9, abs=0.15)


def test_each_joint_of_the_arm_goes_at_its_own_speed_and_stops_at_its_limit(rover):
    rover.act(times=5, shoulder_pan=0.5)
    rover.act(times=3)
    felt = rover.proprioception()
    assert felt["shoulder_pan_qpos"] == pytest.approx(0.5, abs=0.02), "half of 2 rad/s, half a second"
    assert felt["lift_qpos"] == pytest.approx(0.0, abs=0.02), "held against gravity"
    rover.act(times=12, lift=1.0)
    rover.act(times=3)
    assert rover.proprioception()["lift_qpos"] == pytest.approx(1.5, abs=0.02)


def test_the_gripper_closes_below_zero_and_opens_again(rover):
    rover.act(times=5, gripper=-1.0)
    assert rover.proprioception()["left_finger_joint_qpos"] == pytest.approx(0.0, abs=2e-3)
    rover.act(times=5, gripper=1.0)
    assert rover.proprioception()["right_finger_joint_qpos"] == pytest.approx(0.04, abs=2e-3)


def test_it_takes_hold_of_what_is_between_its_fingers(rover):
    """Assisted: the can between the fingers is gripped, stays in the lifted hand, and falls when it opens."""
    rover.act(times=2)
    between = rover.body("rover_hand") + np.array([0.0, -0.06, 0.04])
    rover.simulation.set_object_pose("can", between, (1, 0, 0, 0))
    rover.act(times=3, gripper=-1.0)
    assert rover.held == ["can"] and rover.simulation.predicate("in_hand_of_agent", "can")
    rover.act(times=6, lift=0.5, gripper=-1.0)
    assert rover.simulation.object_pose("can")[0][2] > between[2] + 0.1
    rover.act(times=3, gripper=1.0)
    assert rover.held == [None]


def test_two_of_it_have_names_of_their_own(folder, home):
    one, two = UrdfRobot.load(folder).at(-1.0, 0.5, 0.0), UrdfRobot.load(folder, name="other").at(-1.0, -1.0, 0.0)
    scene = ig2mj.load_scene(home, agents=[one, two])
    assert scene.tables.agent_names == ("rover", "other")
    assert scene.model.body("other_upper").id > scene.model.body("rover_hand").id


def test_a_robot_that_is_fixed_does_not_navigate(folder):
    with pytest.raises(EngineError, match="does not drive"):
        ig2mj.make("PointNavigation", robot=UrdfRobot.load(folder, {"base": "fixed"}), pool_size=1)


@pytest.mark.slow
def test_a_fixed_base_stays(folder, home):
    robot = UrdfRobot.load(folder, {"base": "fixed", "start": {"lift": 0.4}}).at(-1.0, 0.5, 0.0)
    world = GraspingWorld(home, robot)
    assert world.controller.action_names == ("shoulder_pan", "lift", "wrist", "gripper")
    world.act(times=5, shoulder_pan=1.0)
    np.testing.assert_allclose(world.body("rover"), [-1.0, 0.5, 0.0], atol=1e-6)
    assert world.proprioception()["lift_qpos"] == pytest.approx(0.4, abs=0.02)


@pytest.mark.parametrize(
    ("layout", "error", "said"),
    [
        ({"arm": ["sholder_pan"]}, UnknownNameError, r"joint of the robot \(.*arm\) .* near matches: shoulder_pan"),
        ({"camera": "camra_link"}, UnknownNameError, "camera_link"),
        ({"whels": []}, UnknownNameError, "wheels"),
        (
            {"wheels": ["left_wheel_joint"], "base": "differential"},
            InputError,
            "drive has two wheels, .* not 1",
        ),
        ({"base": "hovering"}, InputError, "use differential, skid_steer, omnidirectional or fixed"),
        ({"arm": ["wrist", "left_finger_joint"]}, InputError, "of the arm and of the gripper"),
        ({"gripper": ["left_wheel_joint"], "base": "fixed", "arm": []}, InputError, "no two ends"),
        ({"start": {"lift": 4.0}}, InputError, "goes from -1.5 to 1.5"),
        ({"start": {"lift": "up"}}, InputError, "table of numbers"),
        ({"arm": "wrist"}, InputError, "list of names"),
    ],
)
def test_a_layout_that_does_not_fit_is_refused(folder, layout, error, said):
    with pytest.raises(error, match=said):
        UrdfRobot.load(folder, layout)


def test_files_that_are_none_are_refused(folder, tmp_path):
    with pytest.raises(InputError, match="ig2mj convert robot"):
        UrdfRobot.load(tmp_path)
    broken = tmp_path / "layout.toml"
    broken.write_text("arm = [")
    with pytest.raises(InputError, match="is not TOML"):
        UrdfRobot.load(folder, broken)
    json = tmp_path / "layout.json"
    json.write_text('{"arm": ["wrist"]}')
    assert UrdfRobot.load(folder, json).layout.arm == ("wrist",)


def test_the_command_line_takes_the_urdf(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("IG2MJ_CACHE_DIR", str(tmp_path / "cache"))
    file = write_rover(tmp_path)
    wrong = tmp_path / "wrong.urdf"
    wrong.write_text(URDF.replace('link="hand"', 'link="hnd"'))
    assert call(["rollout", "PointNavigation", "--robot-urdf", str(wrong)]) == 2
    assert "hnd" in capsys.readouterr().err
    assert call(["rollout", "PointNavigation", "--robot-urdf", str(file), "--robot", "fetch"]) == 2
    assert call(["rollout", "PointNavigation", "--robot-layout", str(file)]) == 2
    capsys.readouterr()
    assert call(["rollout", "PointNavigation", "--robot-urdf", str(tmp_path / "none.urdf")]) == 2
    assert "none.urdf: --robot-urdf: is not a file" in capsys.readouterr().err
    assert call(["convert", "robot", "--urdf", str(file), "--out", str(tmp_path / "out"), "--no-report"]) == 0
    assert UrdfRobot.load(tmp_path / "out").name == "rover"


@pytest.mark.slow
def test_it_navigates_and_takes_part_in_an_activity(folder, tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("IG2MJ_CACHE_DIR", str(tmp_path / "cache"))
    file = write_rover(tmp_path)
    command = ["rollout", "PointNavigation", "--robot-urdf", str(file), "--pool-size", "2", "--json"]
    assert call(command) == 0
    assert '"robot": "rover"' in capsys.readouterr().out
    env = ig2mj.make("CookingMeat", robot=UrdfRobot.load(folder), pool_size=2)
    state = env.step(env.reset(0), np.zeros((1, 6), np.float32))
    assert env.action_names[0] == "forward" and np.isfinite(np.asarray(state.reward)).all()
