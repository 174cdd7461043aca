"""Robots of one's own on every kind of base, with one finger, with suction, from MJCF; legs are refused."""

from __future__ import annotations

import pathlib

import mujoco
import numpy as np
import pytest
from ig2mj_converters.base.options import ConvertOptions
from ig2mj_converters.convert_robot import convert_robot
from robot_world import GraspingWorld
from rover import URDF, write_rover
from tiny_home import write_tiny_home
from urdf_parts import converted, joint, link, wheel

from ig2mj.agents.registry import find_robot, make_robot
from ig2mj.agents.urdf import Layout, UrdfRobot
from ig2mj.agents.urdf.summary import summary
from ig2mj.calibration.robot_hand import hand_of
from ig2mj.cli import call
from ig2mj.errors import EngineError, InputError, UnknownNameError

ARM_MJCF = """<mujoco model="mini">
<compiler angle="radian"/>
<default><default class="pad"><geom type="box" size="0.03 0.004 0.012" friction="1.5"/></default></default>
<worldbody>
<geom type="plane" size="2 2 0.1"/>
<body name="foot" {where}>{free}
  <geom type="box" size="0.1 0.1 0.05" pos="0 0 0.05" mass="4"/>
  <body name="upper" pos="0 0 0.1">
    <joint name="pan" axis="0 0 1" range="-2 2"/>
    <geom type="capsule" fromto="0 0 0 0 0 0.3" size="0.03" mass="1"/>
    <body name="fore" pos="0 0 0.3">
      <joint name="lift" axis="0 1 0" pos="0 0 0.02" range="-1.5 1.5"/>
      <geom type="capsule" fromto="0 0 0.02 0.3 0 0.02" size="0.025" mass="0.8"/>
      <body name="palm" pos="0.32 0 0.02">
        <site name="tool" pos="0.05 0 0"/>
        <camera name="wrist_cam" pos="0 0 0.05" xyaxes="0 -1 0 0 0 1"/>
        <geom type="box" size="0.02 0.05 0.02" mass="0.2"/>
        <body name="left_finger" pos="0.05 0.004 0">
          <joint name="left" type="slide" axis="0 1 0" range="0 0.03"/><geom class="pad" mass="0.03"/></body>
        <body name="right_finger" pos="0.05 -0.004 0">
          <joint name="right" type="slide" axis="0 -1 0" range="0 0.03"/><geom class="pad" mass="0.03"/></body>
      </body>
    </body>
  </body>
</body>
<body name="toy" pos="1 0 0.1"><freejoint/><geom size="0.05"/></body>
</worldbody>
<tendon><fixed name="grip"><joint joint="left" coef="0.5"/><joint joint="right" coef="0.5"/></fixed></tendon>
<actuator>
  <position joint="pan" kp="100" forcerange="-40 40"/>
  <position joint="lift" kp="100" forcerange="-40 40"/>
  <position tendon="grip" kp="200" forcerange="-60 60"/>
</actuator>
<keyframe><key name="home" qpos="{key} 0.3 0.2 0 0 1 0 0.1 1 0 0 0"/></keyframe>
</mujoco>"""


@pytest.fixture(scope="module")
def home(tmp_path_factory) -> pathlib.Path:
    return write_tiny_home(tmp_path_factory.mktemp("homes") / "home")


def mjcf(folder: pathlib.Path, text: str, name: str = "robot") -> pathlib.Path:
    """A robot's MJCF, converted."""
    file = folder / f"{name}.xml"
    file.write_text(text, encoding="utf-8")
    convert_robot(file, folder / "out", options=ConvertOptions(report=False))
    return folder / "out"


@pytest.fixture(scope="module")
def arm(tmp_path_factory) -> pathlib.Path:
    text = ARM_MJCF.format(where="", free="", key="")
    return mjcf(tmp_path_factory.mktemp("arm"), text)


def omni_wheels(count: int) -> list[str]:
    parts = []
    for k in range(count):
        angle = 2 * np.pi * k / count
        x, y = 0.12 * np.cos(angle), 0.12 * np.sin(angle)
        parts += wheel(f"wheel_{k}", f"{x:.4f} {y:.4f} -0.06")
        parts[-1] = (
            parts[-1]
            .replace('rpy="0 0 0"', "")
            .replace(f'xyz="{x:.4f} {y:.4f} -0.06"', f'xyz="{x:.4f} {y:.4f} -0.06" rpy="0 0 {angle - np.pi / 2:.4f}"')
        )
    return parts


@pytest.mark.slow
def test_wheels_that_point_in_different_directions_make_the_base_omnidirectional(tmp_path, home):
    robot = UrdfRobot.load(converted(tmp_path, *omni_wheels(3), name="kiwi"))
    assert robot.layout.base == "omnidirectional" and len(robot.layout.wheels) == 3 and robot.drives
    world = GraspingWorld(home, robot.at(-1.0, 0.5, -np.pi / 2))
    assert world.controller.action_names == ("forward", "left", "turn_left")
    start = world.body("kiwi").copy()
    world.act(times=5, left=0.3)
    moved = world.body("kiwi") - start
    assert moved[0] > 0.05 and abs(moved[1]) < 0.02, "it looks along -y, so that +x is on its left"
    felt = world.proprioception()
    assert felt["base_lin_vel_y"] > 0.1 and abs(felt["base_lin_vel_x"]) < 0.02
    assert abs(moved[2]) < 0.005, "it stays on the floor"


def test_a_layout_makes_four_wheels_omnidirectional(tmp_path):
    parts = []
    for end, x in (("front", 0.08), ("rear", -0.08)):
        for side, y in (("left", 0.12), ("right", -0.12)):
            parts += wheel(f"{end}_{side}_wheel", f"{x} {y} -0.06")
    folder = converted(tmp_path, *parts)
    assert UrdfRobot.load(folder).layout.base == "skid_steer"
    (folder / "layout.toml").write_text('base = "omnidirectional"\n')
    robot = UrdfRobot.load(folder)
    assert robot.layout.base == "omnidirectional" and len(robot.layout.wheels) == 4
    assert UrdfRobot.load(folder, {}).layout.base == "skid_steer", "entries that are given replace the file"


def test_a_written_layout_gives_the_same_robot(tmp_path):
    convert_robot(write_rover(tmp_path), tmp_path / "rover", options=ConvertOptions(report=False))
    found = UrdfRobot.load(tmp_path / "rover").layout
    (tmp_path / "rover" / "layout.toml").write_text(found.as_toml())
    assert UrdfRobot.load(tmp_path / "rover").layout == found


def test_legs_are_refused_unless_the_base_is_bolted_down(tmp_path):
    parts = []
    for leg in ("FL", "FR", "RL", "RR"):
        hip = '<limit lower="-1" upper="1" effort="20" velocity="5"/>'
        parts += [link(f"{leg}_hip"), link(f"{leg}_calf")]
        parts += [joint(f"{leg}_hip_joint", "revolute", "base", f"{leg}_hip", "0.1 0.1 0", "1 0 0", hip)]
        parts += [joint(f"{leg}_calf_joint", "revolute", f"{leg}_hip", f"{leg}_calf", "0 0 -0.2", "0 1 0", hip)]
    folder = converted(tmp_path, *parts, name="dog")
    with pytest.raises(InputError, match=r"robot 'dog' has legs \(FL_hip_joint, .*: legged robots are not supported"):
        UrdfRobot.load(folder)
    assert UrdfRobot.load(folder, {"base": "fixed"}).layout.base == "fixed"


def test_a_refused_robot_leaves_no_folder(tmp_path, monkeypatch, capsys):
    """An earlier conversion in the same place stays as it was."""
    monkeypatch.setattr("ig2mj.viewer.robot_picture.robot_picture", lambda *_, **__: _Picture())
    file, layout, out = write_rover(tmp_path), tmp_path / "mine.toml", tmp_path / "rover"
    layout.write_text('arm = ["shouldr_pan"]\n')
    convert = ["convert", "robot", "--urdf", str(file), "--out", str(out), "--no-report"]
    assert call([*convert, "--layout", str(layout)]) == 2
    assert "near matches: shoulder_pan" in capsys.readouterr().err and not out.exists()
    assert call(convert) == 0
    assert "2 warnings" in capsys.readouterr().out
    before = sorted(str(path.relative_to(out)) for path in out.rglob("*"))
    assert call([*convert, "--layout", str(layout)]) == 2
    assert sorted(str(path.relative_to(out)) for path in out.rglob("*")) == before


def test_wheels_that_are_steered_are_refused(tmp_path):
    parts = []
    turn = '<limit lower="-0.5" upper="0.5" effort="20" velocity="5"/>'
    for side, y in (("left", 0.12), ("right", -0.12)):
        parts += [
            link(f"{side}_hinge"),
            joint(f"{side}_hinge", "revolute", "base", f"{side}_hinge", "0.1 0 0", "0 0 1", turn),
        ]
        parts += [part.replace("base", f"{side}_hinge") for part in wheel(f"front_{side}", f"0 {y} -0.06")]
        parts += wheel(f"rear_{side}", f"-0.1 {y} -0.06")
    folder = converted(tmp_path, *parts, name="car")
    with pytest.raises(InputError, match=r"robot 'car' steers like a car \(left_hinge, right_hinge\): Ackermann"):
        UrdfRobot.load(folder)
    assert UrdfRobot.load(folder, {"base": "fixed"}).layout.base == "fixed"


def test_a_joint_that_carries_a_whole_gripper_is_of_the_arm(tmp_path):
    """As in pybullet's r2d2: "gripper_extension" slides the hand, and two joints named as a gripper's hang on it."""
    parts = [
        link("pole", "0.02 0.02 0.1"), link("one", "0.01 0.02 0.1", 0.05), link("two", "0.01 0.02 0.1", 0.05),
        joint("gripper_extension", "prismatic", "base", "pole", "0 0 0.2", "1 0 0"),
        joint("left_gripper_joint", "prismatic", "pole", "one", "0.06 0.01 0", "0 1 0"),
        joint("right_gripper_joint", "prismatic", "pole", "two", "0.06 -0.01 0", "0 -1 0"),
    ]  # fmt: skip
    layout = UrdfRobot.load(converted(tmp_path, *parts)).layout
    assert layout.arm == ("gripper_extension",) and layout.hand == "pole"
    assert layout.gripper == ("left_gripper_joint", "right_gripper_joint")


def test_fingers_hold_with_their_tips(tmp_path):
    """Blocks at the roots of the fingers, which nearly meet, count neither for the rays nor for the opening."""
    finger = (
        '<link name="{name}"><inertial><mass value="0.05"/><inertia ixx="1e-4" iyy="1e-4" izz="1e-4"/></inertial>'
        '<collision><geometry><box size="0.01 0.01 0.1"/></geometry></collision>'
        '<collision><origin xyz="0 {y} -0.045"/><geometry><box size="0.01 0.04 0.01"/></geometry></collision></link>'
    )
    parts = [
        link("hand", "0.06 0.1 0.02"), finger.format(name="one", y=-0.02), finger.format(name="two", y=0.02),
        joint("lift", "prismatic", "base", "hand", "0 0 0.4", "0 0 1"),
        joint("left_finger", "prismatic", "hand", "one", "0 0.05 0.06", "0 1 0"),
        joint("right_finger", "prismatic", "hand", "two", "0 -0.05 0.06", "0 -1 0"),
    ]  # fmt: skip
    robot = UrdfRobot.load(converted(tmp_path, *parts))
    hand = hand_of(robot)
    np.testing.assert_allclose(hand.point, (0, 0, 0.085), atol=1e-6)
    np.testing.assert_allclose(np.abs(hand.across), (0, 1, 0), atol=1e-6)
    assert hand.opening == pytest.approx(0.09 + 2 * 0.04, abs=1e-6)


def test_linkages_are_closed_wherever_their_motor_is(tmp_path):
    """A parallelogram: the passive link turns by as much as the driven one."""
    bar = '<joint name="{name}" axis="0 1 0" range="-2 2"/><geom type="capsule" fromto="0 0 0 0 0 0.1" size="0.01"/>'
    text = f"""<mujoco model="bars"><compiler angle="radian"/><worldbody><body name="foot">
    <geom type="box" size="0.1 0.1 0.05" mass="4"/>
    <body name="a" pos="0 0 0.1">{bar.format(name="driven")}
      <body name="c" pos="0 0 0.1"><joint name="coupler" axis="0 1 0" range="-2 2"/>
        <geom type="capsule" fromto="0 0 0 0.05 0 0" size="0.01"/></body></body>
    <body name="b" pos="0.05 0 0.1">{bar.format(name="passive")}</body>
    </body></worldbody><equality><connect body1="c" body2="b" anchor="0.05 0 0"/></equality>
    <actuator><position joint="driven" kp="10"/></actuator></mujoco>"""
    robot = UrdfRobot.load(mjcf(tmp_path, text))
    data = robot.body.posed({"driven": 0.4})
    at = {name: float(data.joint(f"bars_{name}").qpos[0]) for name in ("driven", "passive", "coupler")}
    assert at == pytest.approx({"driven": 0.4, "passive": 0.4, "coupler": -0.4}, abs=1e-3)


def test_a_gripper_of_one_finger_closes_against_its_hand(tmp_path):
    jaw = '<limit lower="0" upper="1.2" effort="5" velocity="2"/>'
    parts = [
        link("hand", "0.03 0.03 0.1"), link("jaw", "0.01 0.02 0.1", 0.05),
        joint("lift", "prismatic", "base", "hand", "0 0 0.4", "0 0 1"),
        joint("jaw_joint", "revolute", "hand", "jaw", "0.03 0 0", "0 1 0", jaw),
    ]  # fmt: skip
    robot = UrdfRobot.load(converted(tmp_path, *parts))
    assert (robot.layout.gripper, robot.layout.closed, robot.layout.hand) == (("jaw_joint",), "lower", "hand")
    (rays,) = robot.hand_rays()
    assert set(rays.start_bodies) == {"arm_jaw"} and set(rays.end_bodies) == {"arm_hand"}
    assert set(robot.finger_links) == {"jaw", "hand"}, "the fixed jaw presses, too"


@pytest.mark.slow
def test_a_suction_cup_holds_what_it_touches(tmp_path, home):
    """The tiny home's can, put under the cup, hangs on it and rises with the arm, and falls when suction ends."""
    lift = '<limit lower="0" upper="0.3" effort="100" velocity="0.5"/>'
    parts = [
        link("tool", "0.03 0.03 0.03"),
        '<link name="suction_cup"/>',
        joint("lift", "prismatic", "base", "tool", "0.3 0 0.6", "0 0 1", lift),
        '<joint name="cup" type="fixed"><parent link="tool"/><child link="suction_cup"/>'
        '<origin xyz="0 0 -0.016" rpy="3.14159 0 0"/></joint>',
    ]
    robot = UrdfRobot.load(converted(tmp_path, *parts)).at(-1.0, 0.5, -np.pi / 2)
    assert robot.layout.suction == ("suction_cup",) and robot.layout.grippers == ()
    world = GraspingWorld(home, robot)
    assert world.controller.action_names == ("lift", "suction_cup_suction")
    world.act(times=2)
    low, high = (float(a[0, world.scene.object_index("can"), 2]) for a in (world.view.aabb_low, world.view.aabb_high))
    above = float(world.simulation.object_pose("can")[0][2]) - low
    under = world.body("arm_tool") - [0, 0, 0.015 + (high - low) - above - 0.001]
    world.simulation.set_object_pose("can", under, (1, 0, 0, 0))
    world.act(times=2, suction_cup_suction=-1.0)
    assert world.held == ["can"]
    world.act(times=4, lift=1.0, suction_cup_suction=-1.0)
    assert world.simulation.object_pose("can")[0][2] > under[2] + 0.1
    world.act(times=3, suction_cup_suction=1.0)
    assert world.held == [None]


def test_mjcf_gives_its_joints_limits_start_frames_and_followers(arm):
    robot = UrdfRobot.load(arm)
    assert robot.layout == Layout(
        base="fixed",
        arm=("pan", "lift"),
        gripper=("left",),
        hand="fore",
        camera="wrist_cam",
        start={"pan": 0.3, "lift": 0.2, "left": 0.0},
    )
    description = robot.description
    assert (description.name, description.base) == ("mini", "foot")
    assert description.joint("pan").force == 40.0 and description.joint("left").force == 30.0
    assert description.leader("right") == "left", "both are pulled by one tendon"
    assert description.frames["tool"].on == "fore", "the palm is fixed to it"
    assert description.frames["tool"].pos == pytest.approx((0.37, 0, 0)), "from the joint of the link that moves it"
    np.testing.assert_allclose(description.frames["wrist_cam"].axes, np.eye(3), atol=1e-9)
    assert "toy" not in description.frames
    (rays,) = robot.hand_rays()
    np.testing.assert_allclose(rays.grasp_point, (0.385, 0, 0), atol=1e-6)  # the middle of the fingertips
    assert ("gripper", "left (closed at its lower limit)") in summary(robot)


def test_an_mjcf_robot_moves_as_mujoco_moves_its_file(arm, tmp_path):
    """Positions of all bodies at random joint positions, a joint with an anchor off its body's origin among them."""
    source = mujoco.MjModel.from_xml_string(ARM_MJCF.format(where="", free="", key=""))
    body, rng = UrdfRobot.load(arm).body, np.random.default_rng(0)
    for _ in range(5):
        q = {"pan": rng.uniform(-2, 2), "lift": rng.uniform(-1.5, 1.5), "left": rng.uniform(0, 0.03)}
        data = mujoco.MjData(source)
        for name, value in {**q, "right": q["left"]}.items():
            data.joint(name).qpos[0] = value
        mujoco.mj_kinematics(source, data)
        at = body.posed(q)
        for name in ("palm", "left_finger", "right_finger"):
            on, pos, _ = body.frame(name)
            origin, turn = body.pose(on, at)
            np.testing.assert_allclose(origin + turn @ pos, data.body(name).xpos, atol=1e-6)


def test_an_mjcf_base_on_slides_is_omnidirectional_and_stands_on_its_lowest_point(tmp_path, home):
    slides = (
        '<joint name="x" type="slide" axis="1 0 0"/><joint name="y" type="slide" axis="0 1 0"/>'
        '<joint name="yaw" axis="0 0 1" limited="false"/>'
    )
    folder = mjcf(tmp_path, ARM_MJCF.format(where="", free=slides, key="0 0 0"))
    robot = UrdfRobot.load(folder)
    assert robot.layout.base == "omnidirectional" and robot.layout.arm == ("pan", "lift")
    assert robot.body.standing(robot.layout) == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("<mujoco><worldbody/></mujoco>", "has no body that could be a robot"),
        ("<mujoco><worldbody><body><joint/></body></worldbody></mujoco>", "MuJoCo cannot load it"),
        (
            '<mujoco><worldbody><body><geom size="1"/><body pos="0 0 3"><joint type="ball"/><geom size="1"/><body>'
            '<joint/><geom size="1"/></body></body></body></worldbody></mujoco>',
            "is a ball joint between parts of the robot",
        ),
    ],
)
def test_mjcf_without_a_robot_is_refused(tmp_path, text, said):
    with pytest.raises(InputError, match=said):
        mjcf(tmp_path, text)


def test_a_folder_takes_the_place_of_a_robots_name(arm, tmp_path):
    assert make_robot(str(arm)).name == "mini" and find_robot(str(arm))[0] == "mini"
    assert find_robot("fetch")[0] == "fetch"
    with pytest.raises(EngineError, match=r"neither a name \(humanoid, .* nor a folder with robot.json"):
        make_robot(str(tmp_path))
    with pytest.raises(UnknownNameError, match=r"near matches: fetch; a folder that"):
        make_robot("fetchh")


def test_an_arm_that_is_bolted_down_stands_on_a_pedestal_in_activities(arm):
    robot = UrdfRobot.load(arm)
    raised = robot.for_activity(drives=False, camera_tilt=None, camera_pan=0.0)
    assert raised.layout.mount == pytest.approx(0.7), "its first joint, 0.1 m up, comes to 0.8 m"
    own = UrdfRobot.load(arm, {"mount": 0.2})
    assert own.for_activity(drives=False, camera_tilt=None, camera_pan=0.0).layout.mount == 0.2
    spec = mujoco.MjSpec()
    own.attach(spec, (0, 0, 0), (1, 0, 0, 0))
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_forward(model, data)
    assert data.body("mini").xpos[2] == pytest.approx(0.2)


def test_the_command_line_says_what_it_assigned_and_keeps_an_edited_layout(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("IG2MJ_CACHE_DIR", str(tmp_path / "cache"))
    monkeypatch.setattr("ig2mj.viewer.robot_picture.robot_picture", lambda robot: _Picture())
    out = tmp_path / "rover"
    convert = ["convert", "robot", "--urdf", str(write_rover(tmp_path)), "--out", str(out), "--no-report"]
    assert call(convert) == 0
    said = capsys.readouterr().out
    assert "differential drive (base_link)" in said and "shoulder_pan, lift, wrist -> hand" in said
    assert "hand: holds at 0.080 0.000 0.000 m" in said and "edit it to change" in said
    (out / "layout.toml").write_text('base = "fixed"\n')
    assert call(convert) == 0
    said = capsys.readouterr().out
    assert "kept from the earlier conversion" in said and "bolted to the floor" in said
    assert call(["robots", "show", str(out)]) == 0
    assert "bolted to the floor" in capsys.readouterr().out
    assert call(["convert", "robot", "--out", str(out)]) == 2
    assert "--urdf FILE or --mjcf FILE" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("command", "said"),
    [
        (["train", "PointNavigation", "--robot-urdf", "none.urdf"], "none.urdf: --robot-urdf: is not a file"),
        (["evaluate", "GraspingBook", "--robot-mjcf", "none.xml"], "none.xml: --robot-mjcf: is not a file"),
        (["rollout", "PointNavigation", "--robot-urdf", "{urdf}", "--robot", "fetch"], "either --robot or"),
        (["play", "PointNavigation", "--robot-mjcf", "{urdf}"], "is no MJCF (--robot-urdf takes it)"),
        (["view", "small_home", "--robot", "{folder}"], "nor a folder with robot.json"),
        (["demos", "collect", "CookingMeat", "--out", "x.h5", "--robot-layout", "{urdf}"], "--robot-layout needs"),
        (["robots", "show"], "name a robot"),
        (["robots", "try", "--robot-urdf", "none.urdf"], "is not a file"),
    ],
)
def test_options_of_ones_own_robot_are_checked_before_any_work(command, said, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    names = {"urdf": str(write_rover(tmp_path)), "folder": str(tmp_path)}
    assert call([part.format(**names) for part in command]) == 2
    assert said in capsys.readouterr().err


class _Picture:
    def save(self, file: pathlib.Path) -> None:
        file.write_bytes(b"")


def test_a_layout_of_another_robot_names_its_file(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("IG2MJ_CACHE_DIR", str(tmp_path / "cache"))
    layout = tmp_path / "mine.toml"
    layout.write_text('arm = ["shouldr_pan"]\n')
    file = write_rover(tmp_path)
    assert URDF in file.read_text()
    command = ["robots", "show", "--robot-urdf", str(file), "--robot-layout", str(layout)]
    assert call(command) == 2
    assert "near matches: shoulder_pan" in capsys.readouterr().err
