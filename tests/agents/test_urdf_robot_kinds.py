"""Robots of one's own of all kinds: with joints that follow others, without an arm, with several grippers or wheels."""

from __future__ import annotations

import pathlib

import mujoco
import numpy as np
import pytest
from robot_world import GraspingWorld
from tiny_home import write_tiny_home
from urdf_parts import converted, follows, gripper, joint, link, wheel

import ig2mj
from ig2mj.agents.urdf import Layout, UrdfRobot
from ig2mj.agents.urdf.base_motion import drive
from ig2mj.agents.urdf.references import Coupling
from ig2mj.errors import InputError, UnknownNameError


@pytest.fixture(scope="module")
def home(tmp_path_factory) -> pathlib.Path:
    return write_tiny_home(tmp_path_factory.mktemp("homes") / "home")


class Stepped:
    """A scene with a robot, in MuJoCo alone."""

    def __init__(self, home: pathlib.Path, robot: UrdfRobot):
        self.scene = ig2mj.load_scene(home, agents=[robot])
        self.model, self.data = self.scene.model, mujoco.MjData(self.scene.model)
        mujoco.mj_resetDataKeyframe(self.model, self.data, 0)

    def run(self, seconds: float, **controls: float) -> None:
        for name, value in controls.items():
            self.data.actuator(name).ctrl[0] = value
        mujoco.mj_step(self.model, self.data, round(seconds / self.model.opt.timestep))

    def at(self, joint: str) -> float:
        return float(self.data.joint(joint).qpos[0])


def test_a_finger_that_follows_another_is_where_that_one_puts_it_open_and_closed(tmp_path, home):
    robot = UrdfRobot.load(converted(tmp_path, *gripper("", "base", "0 0 0.4")))
    assert robot.layout.gripper == ("finger_1",) and robot.layout.hand == "hand"
    world = Stepped(home, robot.at(-1.0, 0.5, 0.0))
    assert (world.at("arm_finger_1"), world.at("arm_finger_2")) == pytest.approx((0.04, 0.04)), "open at the start"
    world.run(0.5, arm_finger_1=0.04)
    assert world.at("arm_finger_2") == pytest.approx(0.04, abs=1e-3)
    world.run(0.5, arm_finger_1=0.0)
    assert (world.at("arm_finger_1"), world.at("arm_finger_2")) == pytest.approx((0.0, 0.0), abs=1e-3)
    assert len(robot.hand_rays()) == 1, "both fingers hold, although one motor moves them"


@pytest.mark.parametrize("start", [0.0, 0.3, -0.2])
@pytest.mark.parametrize(("multiplier", "offset"), [(1.0, 0.0), (-0.5, 0.1), (2.0, -0.25)])
def test_a_follower_is_multiplier_x_leader_plus_offset_after_any_start(tmp_path, home, start, multiplier, offset):
    limit = '<limit lower="-1" upper="1" effort="50" velocity="2"/>'
    folder = converted(
        tmp_path,
        link("one"), link("two"), link("three"),
        joint("lead", "revolute", "base", "one", "0 0 0.2", "0 0 1", limit),
        joint("follow", "revolute", "base", "two", "0 0.2 0.2", "0 0 1", follows("lead", multiplier, offset, -3, 3)),
        joint("last", "revolute", "base", "three", "0 -0.2 0.2", "0 0 1", follows("follow", 2.0, 0.1, -9, 9)),
    )  # fmt: skip
    world = Stepped(home, UrdfRobot.load(folder, {"start": {"lead": start}}).at(-1.0, 0.5, 0.3))

    def errors() -> tuple[float, float]:
        lead, follow, last = (world.at(f"arm_{name}") for name in ("lead", "follow", "last"))
        return follow - (multiplier * lead + offset), last - (2.0 * follow + 0.1)

    assert world.at("arm_lead") == pytest.approx(start)
    assert errors() == pytest.approx((0, 0), abs=1e-9), "at the start"
    for target in (start, 0.4, -0.4):
        world.run(1.0, arm_lead=target)
        assert world.at("arm_lead") == pytest.approx(target, abs=0.02)
        assert errors() == pytest.approx((0, 0), abs=0.01)


def test_a_relation_between_joints_holds_for_other_references():
    rng = np.random.default_rng(0)
    for _ in range(20):
        coupling = Coupling("a", "b", rng.normal(size=5), *rng.normal(size=2))
        follower_ref, leader_ref = rng.normal(size=2)
        moved = Coupling("a", "b", coupling.about(follower_ref, leader_ref), follower_ref, leader_ref)
        for leader in rng.normal(size=5):
            assert moved.position(leader) == pytest.approx(coupling.position(leader), abs=1e-9)


def test_what_follows_a_joint_without_room_to_move_stays_where_that_one_puts_it(tmp_path, home):
    stuck = '<limit lower="0.2" upper="0.2" effort="1" velocity="1"/>'
    folder = converted(
        tmp_path,
        link("one"), link("two"), link("three"),
        joint("lead", "prismatic", "base", "one", "0 0 0.2", "0 0 1", stuck),
        joint("follow", "prismatic", "base", "two", "0 0.2 0.2", "0 0 1", follows("lead", 2.0, 0.1)),
        joint("turn", "continuous", "one", "three", "0 0 0.1", "0 0 1"),
    )  # fmt: skip
    robot = UrdfRobot.load(folder)
    assert robot.layout.arm == ("turn",)
    world = Stepped(home, robot.at(-1.0, 0.5, 0.0))
    world.run(0.5)
    assert world.at("arm_follow") == pytest.approx(0.5, abs=1e-3)
    base = world.data.body("arm").xpos
    assert world.data.body("arm_three").xpos[2] - base[2] == pytest.approx(0.5, abs=1e-3), "0.2 + 0.2 + 0.1"


TIES = """
  <tendon><fixed name="rope"><joint joint="arm_lift" coef="1"/><joint joint="arm_finger_1" coef="2"/></fixed></tendon>
  <equality><tendon name="tie" tendon1="rope" polycoef="0.1 0 0 0 0" active="false"/>
    <connect name="pin" body1="arm_left_finger" body2="arm_hand" anchor="0 0 0.01" active="false"/>
    <weld name="glue" body1="arm_right_finger" body2="arm" active="false"/></equality>
  <actuator><position name="motor" joint="arm_lift"/></actuator>
  <sensor><jointpos name="felt" joint="arm_lift"/><framepos name="seen" objtype="body" objname="arm_hand"/>
    <framepos name="base" objtype="body" objname="arm"/><actuatorfrc name="pulled" actuator="motor"/></sensor>
"""


@pytest.mark.parametrize("name", ["arm", "other", "x"])
def test_tendons_equalities_and_sensors_of_its_file_come_along(tmp_path, home, name):
    """What they measure at the joints' references is what they measured there in the robot's own file."""
    folder = converted(tmp_path, *gripper("", "base", "0 0 0.4"))
    file = folder / "object.xml"
    text = file.read_text(encoding="utf-8")
    file.write_text(text.replace("<keyframe>", f"{TIES}<keyframe>"), encoding="utf-8")
    alone = mujoco.MjModel.from_xml_path(str(file))
    robot = UrdfRobot.load(folder, {"start": {"lift": 0.2}}, name=name).at(-1.0, 0.5, 0.7)
    model = ig2mj.load_scene(home, agents=[robot]).model

    def names(count: int, of) -> set[str]:
        return {of(k).name.removeprefix(name).removeprefix(":") for k in range(count)}

    assert names(model.ntendon, model.tendon) == {"rope"}
    assert names(model.nsensor, model.sensor) == {"felt", "seen", "base"}
    assert {"tie", "pin", "glue", "_finger_2/mimic"} <= names(model.neq, model.equality)
    assert names(model.nu, model.actuator) == {"_lift", "_finger_1"}, "its motors are the agent's own servos"
    tie = model.equality(f"{name}:tie").id
    assert model.tendon_length0[0] == pytest.approx(0.2 + 2 * 0.04)
    assert model.tendon_length0[0] + model.eq_data[tie, 0] == pytest.approx(alone.tendon_length0[0] + 0.1)
    assert model.tendon_lengthspring[0] == pytest.approx(alone.tendon_lengthspring[0])
    glue, own = model.equality(f"{name}:glue").id, alone.equality("glue").id
    np.testing.assert_allclose(model.eq_data[glue, :11], alone.eq_data[own, :11], atol=1e-9)
    pin = model.equality(f"{name}:pin")
    data = mujoco.MjData(model)
    for joint_name in ("lift", "finger_1", "finger_2"):
        data.joint(f"{name}_{joint_name}").qpos[0] = 0.0
    mujoco.mj_kinematics(model, data)
    one, two = (data.site_xpos[int(site[0])] for site in (pin.obj1id, pin.obj2id) for site in [np.atleast_1d(site)])
    np.testing.assert_allclose(one, two, atol=1e-6)  # at joint positions 0 the two ends of the pin meet


def test_two_robots_of_one_file_keep_their_own_relations(tmp_path, home):
    folder = converted(tmp_path, *gripper("", "base", "0 0 0.4"))
    one = UrdfRobot.load(folder).at(-1.0, 0.5, 0.0)
    other = UrdfRobot.load(folder, {"start": {"finger_1": 0.01}}, name="other").at(-1.0, -1.0, 0.0)
    model = ig2mj.load_scene(home, agents=[one, other]).model
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    assert data.joint("arm_finger_2").qpos[0] == pytest.approx(0.04)
    assert data.joint("other_finger_2").qpos[0] == pytest.approx(0.01)
    mujoco.mj_step(model, data, 60)
    assert data.joint("other_finger_2").qpos[0] == pytest.approx(data.joint("other_finger_1").qpos[0], abs=1e-3)


def test_a_base_without_arm_hand_or_camera_drives(tmp_path, home):
    parts = [*wheel("left_wheel", "0 0.12 -0.06"), *wheel("right_wheel", "0 -0.12 -0.06")]
    parts += ['<link name="caster"><collision><geometry><sphere radius="0.02"/></geometry></collision></link>']
    at = '<parent link="base"/><child link="caster"/><origin xyz="-0.1 0 -0.1"/>'
    parts += [f'<joint name="c" type="fixed">{at}</joint>']
    robot = UrdfRobot.load(converted(tmp_path, *parts, name="cart"))
    assert robot.layout == Layout("differential", wheels=("left_wheel_joint", "right_wheel_joint"))
    world = GraspingWorld(home, robot.at(-1.0, 0.5, -np.pi / 2))
    assert world.controller.action_names == ("forward", "turn_left")
    assert world.controller.proprioception_names == ("dd_base_lin_vel", "dd_base_ang_vel")
    start = world.body("cart").copy()
    world.act(times=5, forward=0.5)
    assert world.body("cart")[1] - start[1] < -0.1


def test_four_wheels_drive_as_two_sides(tmp_path, home):
    sides = {"left": 0.12, "right": -0.12}
    parts = []
    for end, x in (("front", 0.08), ("rear", -0.08)):
        for side, y in sides.items():
            parts += wheel(f"{end}_{side}_wheel", f"{x} {y} -0.06")
    robot = UrdfRobot.load(converted(tmp_path, *parts, name="husky"))
    assert robot.layout.wheels == tuple(f"{end}_{side}_wheel_joint" for side in sides for end in ("front", "rear"))
    assert drive(robot.body, robot.layout)[1] == pytest.approx(0.24)
    world = Stepped(home, robot.at(-1.0, 0.5, 0.0))
    start = world.data.body("husky").xpos.copy()
    world.run(1.0, **{f"husky_{name}": 3.0 for name in robot.layout.wheels})
    moved = world.data.body("husky").xpos - start
    assert moved[0] == pytest.approx(0.18, abs=0.05) and abs(moved[1]) < 0.01


def test_nothing_that_moves_is_a_robot_too(tmp_path, home):
    robot = UrdfRobot.load(converted(tmp_path, name="post"))
    assert robot.layout == Layout("fixed")
    world = GraspingWorld(home, robot.at(-1.0, 0.5, 0.0))
    assert world.controller.action_names == ()
    world.act(times=1)


@pytest.fixture(scope="module")
def two_hands(tmp_path_factory) -> pathlib.Path:
    made = tmp_path_factory.mktemp("two")
    return converted(made, *gripper("l_", "base", "0 0.3 0.4"), *gripper("r_", "base", "0 -0.3 0.4"), name="twin")


@pytest.mark.slow
def test_each_gripper_of_several_has_a_hand_and_a_number_of_its_own(two_hands, home):
    robot = UrdfRobot.load(two_hands)
    assert [(g.joints, g.hand) for g in robot.layout.grippers] == [
        (("l_finger_1",), "l_hand"),
        (("r_finger_1",), "r_hand"),
    ]
    assert [hand.palm for hand in robot.hand_rays()] == ["twin_l_hand", "twin_r_hand"]
    world = GraspingWorld(home, robot.at(-1.0, 0.5, 0.0))
    assert world.controller.action_names == ("l_lift", "r_lift", "l_hand_gripper", "r_hand_gripper")
    assert world.held == [None, None]
    world.act(times=5, l_hand_gripper=-1.0, r_hand_gripper=1.0)
    felt = world.proprioception()
    assert felt["l_finger_1_qpos"] == pytest.approx(0.0, abs=2e-3)
    assert felt["r_finger_1_qpos"] == pytest.approx(0.04, abs=2e-3)
    between = world.body("twin_r_hand") + np.array([0.0, 0.0, 0.06])
    world.simulation.set_object_pose("can", between, (1, 0, 0, 0))
    world.act(times=3, l_hand_gripper=-1.0, r_hand_gripper=-1.0)
    assert world.held == [None, "can"]


def test_grippers_are_named_in_a_layout(two_hands):
    given = [
        {"joints": ["r_finger_1"], "hand": "r_hand", "closed": "upper"},
        {"joints": ["l_finger_1"], "hand": "l_hand"},
    ]
    robot = UrdfRobot.load(two_hands, {"grippers": given})
    assert robot.layout.hands == ("r_hand", "l_hand") and robot.layout.gripper == ("r_finger_1", "l_finger_1")
    assert [robot.body.start_of(name, robot.layout) for name in robot.layout.gripper] == [0.0, 0.04]
    single = UrdfRobot.load(two_hands, {"gripper": ["l_finger_1"], "arm": ["l_lift", "r_lift"]})
    assert single.layout.grippers[0].hand == "l_hand" and not single.layout.several


@pytest.mark.parametrize(
    ("entry", "error", "said"),
    [
        ({"grippers": [{"joints": ["l_finger_1"]}]}, InputError, "no 'hand'"),
        ({"grippers": [{"joints": ["l_finger"], "hand": "l_hand"}]}, UnknownNameError, "l_finger_1"),
        ({"grippers": [{"joints": [], "hand": "l_hand"}]}, InputError, "joints and a hand"),
        ({"grippers": "l_hand"}, InputError, "list of tables"),
        ({"grippers": [{"joints": ["l_finger_1"], "hand": "l_hand", "close": "upper"}]}, UnknownNameError, "closed"),
        ({"grippers": [{"joints": ["l_finger_1"], "hand": "l_hand"}] * 2}, InputError, "of two grippers"),
        ({"grippers": [], "hand": "l_hand"}, InputError, "both 'grippers' and 'hand'"),
    ],
)
def test_grippers_that_do_not_fit_are_refused(two_hands, entry, error, said):
    with pytest.raises(error, match=said):
        UrdfRobot.load(two_hands, entry)


def test_its_name_is_the_urdfs_and_its_colour_grey(tmp_path):
    folder = converted(tmp_path, name="my robot")
    robot = UrdfRobot.load(folder)
    assert robot.name == "my_robot"
    model = mujoco.MjModel.from_xml_path(str(folder / "object.xml"))
    r, g, b, a = model.geom_rgba[model.geom("my_robot/visual_0").id]
    assert r == g == b and a == 1.0


def two_fingers(left: str, right: str) -> list[str]:
    """Two fingers that are not tied to each other, 6 cm on the left and on the right of a hand; as URDF of joints."""
    return [
        link("hand", "0.06 0.2 0.04"),
        joint("lift", "prismatic", "base", "hand", "0 0 0.4", "0 0 1"),
        *(link(f"{side}_finger", "0.02 0.01 0.06", 0.05) for side in ("left", "right")),
        joint("left_finger_joint", "prismatic", "hand", "left_finger", "0 0.06 0.05", "0 1 0", left),
        joint("right_finger_joint", "prismatic", "hand", "right_finger", "0 -0.06 0.05", "0 1 0", right),
    ]


@pytest.mark.parametrize(
    ("left", "right", "closed"),
    [
        ((0, 0.04), (-0.04, 0), (0, 0)),
        ((-0.04, 0), (0, 0.04), (-0.04, 0.04)),
        ((-0.05, -0.01), (0.01, 0.05), (-0.05, 0.05)),
    ],
)
def test_each_finger_is_closed_at_the_limit_at_which_it_is_nearer_to_the_other(tmp_path, home, left, right, closed):
    limits = [f'<limit lower="{low}" upper="{high}" effort="20" velocity="0.2"/>' for low, high in (left, right)]
    robot = UrdfRobot.load(converted(tmp_path, *two_fingers(*limits)))
    world = GraspingWorld(home, robot)
    opened = [sum(pair) - end for pair, end in zip((left, right), closed, strict=True)]
    np.testing.assert_allclose([robot.body.start_of(n, robot.layout) for n in robot.layout.gripper], opened)
    names = [f"{robot.name}_{name}" for name in robot.layout.gripper]
    world.act(times=10, gripper=-1.0)
    np.testing.assert_allclose([world.simulation.joint(name) for name in names], closed, atol=2e-3)
    world.act(times=10, gripper=1.0)
    np.testing.assert_allclose([world.simulation.joint(name) for name in names], opened, atol=2e-3)


def test_a_leader_is_closed_at_its_upper_limit_where_that_brings_its_follower_nearer(tmp_path):
    leader = '<limit lower="-0.04" upper="0" effort="20" velocity="0.2"/>'
    robot = UrdfRobot.load(converted(tmp_path, *two_fingers(leader, follows("left_finger_joint", -1.0))))
    assert robot.layout.gripper == ("left_finger_joint",) and robot.layout.closed == "lower"
    turned = '<limit lower="0" upper="0.04" effort="20" velocity="0.2"/>'
    parts = "".join(two_fingers(turned, follows("left_finger_joint", -1.0)))
    robot = UrdfRobot.load(converted(tmp_path, parts.replace('axis xyz="0 1 0"', 'axis xyz="0 -1 0"')))
    assert robot.layout.closed == "upper"
    assert UrdfRobot.load(tmp_path / "out", {"closed": "lower"}).layout.closed == "lower"


@pytest.mark.parametrize(
    "names",
    [
        ("wheel_fl", "wheel_rl", "wheel_fr", "wheel_rr"),
        ("leftFront_wheel", "left_rear_wheel", "r_front_wheel", "right_rear_wheel"),
    ],
)
def test_wheels_named_by_their_corners_drive_as_two_sides(tmp_path, names):
    parts = []
    for name, xyz in zip(names, ("0.1 0.12", "-0.1 0.12", "0.1 -0.12", "-0.1 -0.12"), strict=True):
        parts += wheel(name, f"{xyz} -0.06")
    robot = UrdfRobot.load(converted(tmp_path, *parts))
    assert robot.layout.wheels == tuple(f"{name}_joint" for name in names)


FLOATING = '<joint name="free" type="floating"><parent link="{}"/><child link="{}"/><origin xyz="0 0 0.5"/></joint>'


def test_a_robot_that_floats_in_an_empty_root_has_the_floating_link_as_its_base(tmp_path, home):
    parts = [*wheel("left_wheel", "0 0.12 -0.06"), *wheel("right_wheel", "0 -0.12 -0.06")]
    plain = UrdfRobot.load(converted(tmp_path, *parts))
    robot = UrdfRobot.load(converted(tmp_path, *parts, '<link name="world"/>', FLOATING.format("world", "base")))
    assert (robot.description.base, robot.layout) == (plain.description.base, plain.layout) == ("base", plain.layout)
    assert robot.body.height == pytest.approx(plain.body.height)
    assert ig2mj.load_scene(home, agents=[robot]).model.body("arm").mass > 0


def test_a_floating_joint_between_parts_of_a_robot_is_refused(tmp_path):
    with pytest.raises(InputError, match="joint 'free': a floating joint cuts the robot in two"):
        converted(tmp_path, link("part"), FLOATING.format("base", "part"))


def test_a_gripper_without_a_hand_is_none_or_refused(tmp_path, home):
    folder = converted(tmp_path, *gripper("", "base", "0 0 0.4"))
    robot = UrdfRobot.load(folder, {"hand": ""})
    assert (robot.layout.gripper, robot.layout.grippers, robot.layout.hand) == ((), (), None)
    assert "finger_1" in GraspingWorld(home, robot).controller.action_names
    with pytest.raises(InputError, match="a gripper has no hand"):
        UrdfRobot.load(folder, {"hand": "", "gripper": ["finger_1"]})


def test_fingers_of_a_linkage_are_its_longest_branches_and_close_at_the_upper_limit(tmp_path):
    parts = [link("hand"), joint("lift", "prismatic", "base", "hand", "0 0 0.4", "0 0 1")]
    for side, y, axis in (("left", 0.03, "1 0 0"), ("right", -0.03, "-1 0 0")):
        leads = side == "left"
        turns = '<limit lower="0" upper="0.8" effort="20" velocity="1"/>'
        outer = turns if leads else follows("finger_joint")
        parts += [
            *(link(f"{side}_{part}", "0.02 0.01 0.04", 0.05) for part in ("inner_knuckle", "outer_knuckle", "tip")),
            joint(f"{side}_inner_joint", "revolute", "hand", f"{side}_inner_knuckle", f"0 {y / 2} 0.03", axis,
                  follows("finger_joint")),
            joint("finger_joint" if leads else "right_outer_joint", "revolute", "hand", f"{side}_outer_knuckle",
                  f"0 {y} 0.03", axis, outer),
            joint(f"{side}_tip_joint", "revolute", f"{side}_outer_knuckle", f"{side}_tip", "0 0 0.05", axis,
                  follows("finger_joint", -1.0)),
        ]  # fmt: skip
    robot = UrdfRobot.load(converted(tmp_path, *parts))
    assert (robot.layout.gripper, robot.layout.closed) == (("finger_joint",), "upper")
    (rays,) = robot.hand_rays()
    assert {*rays.start_bodies, *rays.end_bodies} == {"arm_left_tip", "arm_right_tip"}
