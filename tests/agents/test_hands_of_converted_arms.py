"""Arms of converted robots that carry hands: telescopes, grippers with one jaw, markers, and how fast fingers close."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
import pytest
from robot_world import RobotWorld
from urdf_parts import converted, follows, gripper, joint, link

from ig2mj.agents.kinematics import forward, inverse
from ig2mj.agents.urdf import UrdfRobot
from ig2mj.agents.urdf.grip import jaw_frame
from ig2mj.calibration.robot_hand import Arm, hand_of
from ig2mj.planning.physics import check_robot
from ig2mj.planning.steps import PlanningError
from ig2mj.scene.scene import load_scene

LIFT = '<limit lower="0" upper="0.5" effort="200" velocity="0.5"/>'
SEGMENT = '<limit lower="0" upper="0.13" effort="100" velocity="0.1"/>'
TURN = '<limit lower="-1.5" upper="1.5" effort="50" velocity="1"/>'
JAW = '<limit lower="-0.1" upper="1.7" effort="10" velocity="2"/>'


def telescope() -> list[str]:
    """A lift, a telescope of three segments that one motor moves, a wrist, and a gripper."""
    parts = [
        link("mast"), link("one"), link("two"), link("three"), link("wrist"),
        joint("mast_lift", "prismatic", "base", "mast", "0 0 0.2", "0 0 1", LIFT),
        joint("reach", "prismatic", "mast", "one", "0.05 0 0.1", "1 0 0", SEGMENT),
        joint("reach_2", "prismatic", "one", "two", "0.05 0 0", "1 0 0", follows("reach", 1.0)),
        joint("reach_3", "prismatic", "two", "three", "0.05 0 0", "1 0 0", follows("reach_2", 2.0, 0.01)),
        joint("yaw", "revolute", "three", "wrist", "0.05 0 0", "0 0 1", TURN),
    ]  # fmt: skip
    return [*parts, *gripper("", "wrist", "0.1 0 0")]


@pytest.fixture(scope="module")
def reaching(tmp_path_factory) -> UrdfRobot:
    return UrdfRobot.load(converted(tmp_path_factory.mktemp("robot"), *telescope()))


POSTURES = [[0.1, 0.0, 0.3, 0.0], [0.3, 0.1, -0.8, 0.2], [0.5, 0.05, 1.0, 0.1]]


def _names(robot: UrdfRobot) -> tuple[str, ...]:
    return tuple(robot.layout.arm[k] for k in robot.body.chain_joints(robot.layout, "hand"))


@pytest.mark.parametrize("q", POSTURES)
def test_segments_of_a_telescope_count_where_its_hand_is(reaching, q):
    names = _names(reaching)
    chain = reaching.body.chain(reaching.layout, "hand")
    assert len(names) == 4 and chain is not None and len(chain.slides) == 6
    pos = np.asarray(forward(chain, jnp.asarray([q], jnp.float32))[0])[0]
    there = reaching.body.pose("hand", reaching.body.posed(dict(zip(names, q, strict=True))))[0]
    assert pos == pytest.approx(there, abs=1e-5)


def test_a_jacobian_has_what_followers_add(reaching):
    chain = reaching.body.chain(reaching.layout, "hand")
    assert chain is not None
    jacobian = np.asarray(forward(chain, jnp.asarray([POSTURES[1]], jnp.float32))[2])[0]
    assert jacobian[:3, 1] == pytest.approx([4.0, 0.0, 0.0], abs=1e-5), "1 + 1 + 2"
    assert chain.travel[1] == pytest.approx(4 * 0.13)


def test_inverse_kinematics_reach_with_the_whole_telescope(reaching):
    chain = reaching.body.chain(reaching.layout, "hand")
    assert chain is not None
    pos, quat, _ = forward(chain, jnp.asarray([POSTURES[2]], jnp.float32))
    q = inverse(chain, jnp.zeros((1, 4), jnp.float32), pos, quat, np.zeros(4), iterations=40, posture=0.0)
    assert np.asarray(forward(chain, q)[0])[0] == pytest.approx(np.asarray(pos)[0], abs=5e-3)


@pytest.mark.parametrize("q", POSTURES[1:])
def test_postures_of_a_scene_move_followers_too(reaching, q, tiny_home_folder):
    hand = hand_of(reaching)
    arm = Arm(load_scene(tiny_home_folder, agents=[reaching]), reaching, hand)
    at, along, _ = arm.put(np.array(q))
    turned = np.array([np.cos(q[2]), np.sin(q[2]), 0.0])
    base = arm.data.body("arm").xpos
    straight = 0.05 + 4 * q[1] + 0.01 + 3 * 0.05
    assert at[:2] - base[:2] == pytest.approx([straight, 0.0] + 0.1 * turned[:2], abs=0.02)
    found, off, _ = arm.solve(np.array([0.2, 0.05, 0.0, 0.1]), at, along, None)
    assert off < 2e-3 and found.shape == (4,)


def jaw(*extra: str) -> list[str]:
    """A hand with a jaw that does not move, upright, and one that turns about its foot."""
    still = '<geometry><box size="0.02 0.04 0.1"/></geometry>'
    shape = f'<origin xyz="-0.02 0 0.05"/>{still}'
    turning = f'<origin xyz="0.005 0 0.05"/>{still.replace("0.02 0.04", "0.01 0.04")}'
    inertial = (
        '<inertial><mass value="0.2"/><inertia ixx="1e-3" iyy="1e-3" izz="1e-3" ixy="0" ixz="0" iyz="0"/></inertial>'
    )
    return [
        f'<link name="gripper">{inertial}<visual>{shape}</visual><collision>{shape}</collision></link>',
        f'<link name="jaw">{inertial}<visual>{turning}</visual><collision>{turning}</collision></link>',
        joint("lift", "prismatic", "base", "gripper", "0 0 0.2", "0 0 1", LIFT),
        joint("jaw_joint", "revolute", "gripper", "jaw", "0 0 0", "0 1 0", JAW),
        *extra,
    ]


def test_a_gripper_with_one_jaw_points_along_the_part_that_does_not_move(tmp_path):
    robot = UrdfRobot.load(converted(tmp_path, *jaw()))
    found = jaw_frame(robot.body, robot.layout.grippers[0])
    assert found is not None
    assert found.ahead == pytest.approx([0, 0, 1], abs=0.05) and found.across == pytest.approx([-1, 0, 0], abs=0.05)
    assert found.point[0] == pytest.approx(-0.01 + 0.026, abs=0.004), "the jaw's face is at -0.01 m"
    hand = hand_of(robot)
    assert hand.approach == pytest.approx(found.ahead) and hand.across == pytest.approx(found.across)


def test_grippers_with_two_fingers_have_no_jaw(reaching):
    assert jaw_frame(reaching.body, reaching.layout.grippers[0]) is None


def test_fingers_close_in_half_a_second_at_least(reaching, tiny_home_folder):
    world = RobotWorld(tiny_home_folder, reaching.at(-1.0, 0.5, 0.0))

    def opening() -> float:
        return world.proprioception()["finger_1_qpos"]

    start = opening()
    world.act(gripper=-1.0)
    assert start - opening() == pytest.approx(0.008, abs=0.003), "0.04 m in 0.5 s, although its joint goes at 0.2 m/s"
    world.act(gripper=-1.0, times=5)
    assert opening() == pytest.approx(0.0, abs=2e-3)
    world.act(gripper=1.0)
    assert opening() < 0.02


MARKER = (
    '<link name="mark"><inertial><mass value="{mass}"/>'
    '<inertia ixx="1e-9" iyy="1e-9" izz="1e-9" ixy="0" ixz="0" iyz="0"/></inertial>'
    '<collision><geometry><box size="{size} {size} {size}"/></geometry></collision></link>'
)


@pytest.mark.parametrize(("mass", "size", "collides"), [(1e-4, 0.005, False), (1e-4, 0.03, True), (0.01, 0.005, True)])
def test_a_link_that_marks_a_point_does_not_collide(tmp_path, mass, size, collides):
    mark = MARKER.format(mass=mass, size=size)
    robot = UrdfRobot.load(
        converted(tmp_path, *jaw(mark, joint("mark_joint", "fixed", "gripper", "mark", "0.02 0 0.3", "0 0 1")))
    )
    reaches = float(robot.body.shapes.points("gripper")[:, 2].max())
    assert (reaches > 0.2) == collides


def test_what_a_robot_lacks_for_primitives_is_named(reaching, tmp_path):
    turning = joint("turn", "revolute", "base", "tool", "0 0 0.2", "0 0 1", TURN)
    bare = UrdfRobot.load(converted(tmp_path, link("tool"), turning))
    for robot, lacks in ((reaching, "has no base that moves"), (bare, "has no hand that holds something")):
        with pytest.raises(PlanningError, match=lacks):
            check_robot(robot)
