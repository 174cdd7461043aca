"""Fetch: its kinematics against MuJoCo's, inverse kinematics, drive, gripper, order of numbers."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from robot_world import RobotWorld
from scipy.spatial.transform import Rotation

from ig2mj.agents.fetch import Fetch
from ig2mj.agents.fetch.figures import CHAIN, CHAIN_JOINTS, JOINTS, LOWER, UPPER, WHEEL_RADIUS, start_positions
from ig2mj.agents.kinematics import forward, inverse, solve_positive
from ig2mj.errors import UnknownNameError
from ig2mj.geometry.poses import rotation_angle

START = (-0.2, -1.2, 0.0)
REST = start_positions("diagonal30")[CHAIN_JOINTS]


def lone_fetch() -> tuple[mujoco.MjModel, mujoco.MjData]:
    spec = mujoco.MjSpec.from_string("<mujoco><option timestep='0.00833333' gravity='0 0 -9.8'/></mujoco>")
    Fetch().attach(spec)
    model = spec.compile()
    return model, mujoco.MjData(model)


def drawn_positions(count: int) -> np.ndarray:
    low, high = np.maximum(LOWER, -3)[CHAIN_JOINTS], np.minimum(UPPER, 3)[CHAIN_JOINTS]
    return np.random.default_rng(0).uniform(low, high, (count, len(low))).astype(np.float32)


def test_forward_kinematics_and_jacobian_are_mujocos():
    model, data = lone_fetch()
    names = [f"fetch_{JOINTS[k].name}" for k in CHAIN_JOINTS]
    gripper = model.body("fetch_gripper_link").id
    dofs = [model.joint(n).dofadr[0] for n in names]
    for q in drawn_positions(5):
        for name, value in zip(names, q, strict=True):
            data.qpos[model.joint(name).qposadr[0]] = value
        mujoco.mj_forward(model, data)
        rows = np.zeros((6, model.nv))
        mujoco.mj_jac(model, data, rows[:3], rows[3:], data.xpos[gripper], gripper)
        pos, quat, jacobian = forward(CHAIN, q[None])
        np.testing.assert_allclose(pos[0], data.xpos[gripper], atol=1e-5)
        assert float(rotation_angle(quat[0], data.xquat[gripper].astype(np.float32))) < 2e-3
        np.testing.assert_allclose(jacobian[0], rows[:, dofs], atol=1e-5)


def test_masses_and_limits_are_the_makers():
    model, _ = lone_fetch()
    assert model.body_subtreemass[0] == pytest.approx(120.93, abs=0.01)
    assert model.joint("fetch_elbow_flex_joint").range == pytest.approx([-2.251, 2.251])
    assert model.actuator("fetch_shoulder_lift").forcerange == pytest.approx([-131.76, 131.76])


def test_the_base_drives_onto_a_carpet_of_13_mm_from_before_its_edge():
    spec = mujoco.MjSpec.from_string("<mujoco><option timestep='0.0025' gravity='0 0 -9.8'/></mujoco>")
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[5, 5, 1])
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=[1, 1, 0.0065], pos=[1.21, 0, 0.0065])
    Fetch().attach(spec)
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    for _ in range(400):
        mujoco.mj_step(model, data)
    floor = float(data.body("fetch").xpos[2])
    for side in "rl":
        data.actuator(f"fetch_{side}_wheel").ctrl = 0.2 / WHEEL_RADIUS
    for _ in range(1600):
        mujoco.mj_step(model, data)
    assert data.body("fetch").xpos == pytest.approx([0.8, 0.0, floor + 0.013], abs=0.12)
    assert data.body("fetch").xpos[2] - floor == pytest.approx(0.013, abs=0.001)


@pytest.mark.slow
def test_inverse_kinematics_reaches_near_poses_within_limits():
    q = np.clip(np.random.default_rng(1).normal(REST, 0.2, (50, 8)), CHAIN.lower, CHAIN.upper).astype(np.float32)
    goal, turn, _ = forward(CHAIN, q)
    begin = np.tile(REST.astype(np.float32), (50, 1))
    solution = np.asarray(inverse(CHAIN, begin, goal, turn, REST, iterations=40, posture=0.0))
    pos, quat, _ = forward(CHAIN, solution)
    assert np.percentile(np.linalg.norm(pos - goal, axis=1), 90) < 5e-3
    assert np.percentile(rotation_angle(quat, turn), 90) < 2e-2
    assert (solution >= CHAIN.lower - 1e-6).all() and (solution <= CHAIN.upper + 1e-6).all()


def test_small_systems_are_solved():
    root = np.random.default_rng(2).normal(size=(7, 6, 6)).astype(np.float32)
    matrix = root @ root.transpose(0, 2, 1) + np.eye(6, dtype=np.float32)
    right = root[:, 0]
    np.testing.assert_allclose(
        solve_positive(matrix, right), np.linalg.solve(matrix, right[..., None])[..., 0], atol=1e-4
    )


@pytest.mark.slow
def test_the_gripper_goes_where_it_is_told_and_the_arm_holds_still(tiny_home_folder):
    """A full command is 0.2 m, of which kv = 2 makes a fifth in 0.1 s; orientation stays."""
    world = RobotWorld(tiny_home_folder, Fetch(pos=START))
    world.act(times=10)
    rest, turned = np.array(world.body("fetch_gripper_link")), np.array(world.quat("fetch_gripper_link"))
    world.act(times=10)
    assert np.linalg.norm(world.body("fetch_gripper_link") - rest) < 3e-3, "zero command"
    world.act(times=5, eef_z=-1)
    moved = world.body("fetch_gripper_link") - rest
    assert -0.2 < moved[2] < -0.08
    assert np.linalg.norm(moved[:2]) < 0.2 * -moved[2]
    assert float(rotation_angle(turned, world.quat("fetch_gripper_link"))) < 0.1


def test_base_head_and_gripper(tiny_home_folder):
    world = RobotWorld(tiny_home_folder, Fetch(pos=START))
    world.act(times=5, gripper=1)
    felt = world.proprioception()
    assert list(felt)[:2] == ["camera_qpos_sin_pan", "camera_qpos_sin_tilt"] and list(felt)[-1] == "trunk_qpos"
    assert felt["gripper_0_qpos_left"] == pytest.approx(0.05, abs=2e-3)
    assert felt["trunk_qpos"] == pytest.approx(0.385, abs=5e-3)
    world.act(times=8, gripper=-1, head_pan=0.5)
    felt = world.proprioception()
    assert felt["gripper_0_qpos_left"] == pytest.approx(0, abs=3e-3)
    assert np.asarray(world.controller.grip(world.state)) == pytest.approx(1)
    assert felt["camera_qpos_sin_pan"] == pytest.approx(np.sin(0.8 * 0.5 * 1.57), abs=0.05)
    before = np.array(world.body("fetch"))
    world.act(times=5, forward=0.3)
    assert felt["grasp_0"] == -1
    assert world.body("fetch")[0] - before[0] == pytest.approx(0.5 * 0.3 * 17.4 * 0.0613, rel=0.3)
    upright = Rotation.from_quat(np.roll(world.quat("fetch"), -1)).apply([0, 0, 1])
    assert upright[2] > 0.999


def test_a_pinned_base_stays_where_it_is_while_the_arm_works(tiny_home_folder):
    """Free, it rocks on its wheels and turns as the arm is swung aside."""
    moved = []
    for pinned in (False, True):
        world = RobotWorld(tiny_home_folder, Fetch(pos=START, proprioception="experiments", pinned=pinned))
        before = np.r_[world.body("fetch"), world.quat("fetch")]
        world.act(times=10, eef_y=1, eef_x=-1, forward=0.3)
        world.act(times=10, eef_y=-1, eef_z=1)
        moved.append(np.abs(np.r_[world.body("fetch"), world.quat("fetch")] - before).max())
        felt = world.proprioception()
        assert len(felt) == 49 and np.isfinite(list(felt.values())).all()
    assert moved[0] > 0.05 and moved[1] == 0.0


def test_the_experiments_proprioception_is_49_numbers_with_the_servos_torques(tiny_home_folder):
    """The paper's: gripper's position, Euler angles in the base's frame, has grasped, (q, qd, torque) of 14 joints."""
    world = RobotWorld(tiny_home_folder, Fetch(pos=START, proprioception="experiments"))
    world.act(times=4, forward=0.2, eef_z=-1, eef_rx=0.5, gripper=1)
    felt = world.proprioception()
    assert len(felt) == 49 and list(felt)[:8][-2:] == ["has_grasped", "r_wheel_position"]
    turned = Rotation.from_quat(np.roll(world.quat("fetch"), -1)).inv()
    gripper = turned * Rotation.from_quat(np.roll(world.quat("fetch_gripper_link"), -1))
    assert list(felt.values())[:3] == pytest.approx(
        turned.apply(world.body("fetch_gripper_link") - world.body("fetch")), abs=2e-3
    )
    told = Rotation.from_euler("xyz", list(felt.values())[3:6])
    assert (told.inv() * gripper).magnitude() < 1e-2
    model, data = world.simulation.engine.to_mujoco(world.simulation.physics, 0)
    mujoco.mj_forward(model, data)
    for joint in JOINTS:
        name = joint.name.removesuffix("_joint")
        assert felt[f"{name}_position"] == pytest.approx(data.joint(f"fetch_{joint.name}").qpos[0], abs=1e-4)
        assert felt[f"{name}_velocity"] == pytest.approx(data.joint(f"fetch_{joint.name}").qvel[0], abs=1e-4)
        assert felt[f"{name}_torque"] == pytest.approx(data.actuator(f"fetch_{name}").force[0], rel=1e-2, abs=0.02)


def test_an_unknown_pose_or_list_is_named():
    with pytest.raises(UnknownNameError, match="diagonal30"):
        Fetch(pose="diagonal31")
    with pytest.raises(UnknownNameError, match="experiments"):
        Fetch(proprioception="experiment")


@pytest.mark.slow
@pytest.mark.parametrize("up", [1.0, -1.0])
def test_the_slow_trunk_does_not_slow_down_the_arm(up):
    """The trunk's limit is 0.1 m/s; a full command is a goal 0.2 m ahead."""
    world = RobotWorld("small_home", Fetch(pos=START))
    before = world.body("fetch_gripper_link").copy()
    world.act(times=10, eef_z=up)
    assert up * (world.body("fetch_gripper_link") - before)[2] > 0.25
