"""A body that hovers stretches and stoops where a program asks it to, and stays so until another one asks."""

import dataclasses
import types

import mujoco
import numpy as np
import pytest

import ig2mj
from ig2mj.agents import Humanoid
from ig2mj.agents.humanoid.frames import FINGER_CLOSED, FINGERS, SEGMENTS, THUMB_CLOSED
from ig2mj.agents.humanoid.hand import RADIUS
from ig2mj.geometry.host_rotations import quat_multiply, yaw_quat
from ig2mj.planning import execution
from ig2mj.planning.body_kinds import body_of
from ig2mj.planning.clearance import Obstacles, hand_way
from ig2mj.planning.driving import stretch
from ig2mj.planning.grasps import SWEEPS
from ig2mj.planning.phases import Phase, Programs
from ig2mj.planning.senses import sense
from ig2mj.planning.stances import reaching_all
from ig2mj.planning.world import PlannedWorld, Stance
from ig2mj.sampling.query import SceneQuery


@pytest.fixture(scope="module")
def robot(tiny_home_folder):
    scene = ig2mj.load_scene(tiny_home_folder, agents=[Humanoid().at(-0.45, 0.0, 0.0)])
    controller = scene.agents[0].controller(scene.tables, 0, 0.1)
    return body_of(scene, controller), controller.action_names, SceneQuery(scene).view


def test_the_body_rises_and_stays_there_in_the_next_program(robot):
    body, names, view = robot
    carry = execution.begin([[stretch(0.2)]])
    action, carry = execution.advance(body, 0, carry, view)
    assert action[0, names.index("body_z")] == pytest.approx(0.05) and carry.running.all()
    carry = execution.begin_some(carry, {0: [Phase(hand=0, reset=True)]})
    action, carry = execution.advance(body, 0, carry, view)
    assert action[0, names.index("body_z")] == pytest.approx(0.05)


def test_the_body_stays_stretched_where_an_earlier_program_was_longer(robot):
    body, names, view = robot
    carry = execution.begin([[Phase(limit=1, after="")] * 5])
    carry = execution.begin_some(carry, {0: [dataclasses.replace(stretch(0.2), limit=1)]})
    while carry.running.all():
        _, carry = execution.advance(body, 0, carry, view)
    carry = execution.begin_some(carry, {0: [Phase(hand=0, reset=True)]})
    action, carry = execution.advance(body, 0, carry, view)
    assert action[0, names.index("body_z")] == pytest.approx(0.05)


def test_the_body_stays_at_its_height_where_nothing_else_is_asked(robot):
    body, names, view = robot
    carry = execution.begin([[Phase(hand=0, reset=True)]])
    action, _ = execution.advance(body, 0, carry, view)
    assert action[0, names.index("body_z")] == pytest.approx(0.0, abs=0.01)
    assert np.isnan(Programs.pack([[Phase()]]).phases["rise"]).all()


class _Roof(Obstacles):
    """A slab at z = 0 over all points with x above 0, m."""

    def __init__(self):
        pass

    def clear(self, spheres):
        x, _, z, radius = spheres.T
        return not ((x + radius > 0) & (np.abs(z) < radius)).any()

    def clear_along(self, spheres, start, ahead, along):
        return all(self.clear(spheres + np.array([*(start + t * ahead), 0.0])) for t in along)

    def distance(self, points):
        return np.full(points.shape[:-1], 0.3)


def test_a_hand_goes_level_below_what_is_above_its_goal():
    ball = np.array([[0.0, 0.0, 0.0, 0.05]])
    start, goal = np.array([-0.4, 0.0, 0.4]), np.array([0.3, 0.0, -0.2])
    way = hand_way(_Roof(), ball, start, goal)
    assert way is not None and np.allclose(way, [[-0.4, 0.0, -0.2], goal])


class _Shoulder(PlannedWorld):
    """A robot with its shoulder 0.85 m above the floor where it stands, with room above it."""

    def __init__(self):
        self.body = types.SimpleNamespace(reach=1.15, rises=(-0.3, 0.25), stands=0.55)

    def shoulder(self, hand, stance):
        return np.array([*stance.xy, 0.85 + stance.rise])


def test_the_body_stretches_as_little_as_it_takes_to_reach_all_points():
    world, here = _Shoulder(), Stance((0.0, 0.0), 0.0)

    def reached(*points):
        return reaching_all(world, 0, here, np.array(points, float), _Roof())

    near, low, high = (0.8, 0.0, 0.9), (0.9, 0.0, 0.05), (0.0, 0.7, 1.85)
    level = reached(near)
    assert level is not None and level.rise == 0.0
    for points in ((near, low), (near, high)):
        found = reached(*points)
        assert found is not None
        away = [np.linalg.norm(world.shoulder(0, found) - p) for p in points]
        assert max(away) <= world.body.reach + 1e-9 and np.isclose(max(away), world.body.reach)
    assert reached(low, high) is None and reached((1.3, 0.0, 0.9)) is None


class _Standing(PlannedWorld):
    """A robot with room above it."""

    def __init__(self, body):
        self.body = body


def test_a_hand_reaches_what_lies_far_below_a_bed(robot):
    body, _, _ = robot
    world, can = _Standing(body), np.array([1.28, 0.0, 0.06])
    back, aside, _ = body.shoulders[0]
    found = reaching_all(world, 0, Stance((0.0, 0.0), -float(np.arctan2(aside, back))), can[None], _Roof())
    assert found is not None and np.linalg.norm(world.shoulder(0, found) - can) <= body.reach + 1e-9
    assert body.stands + found.rise > 0.0


@pytest.mark.parametrize("laden", [False, True])
def test_a_hand_that_follows_late_with_what_it_carries_comes_to_rest(robot, laden):
    body, names, view = robot
    senses, late, turned = sense(view, 0, body.hands), 2 * laden, [0.0] * 3
    yaw = names.index("left_hand_yaw")
    quat = senses.hand_quat[0, 0]
    w, x, y, z = map(float, quat_multiply(yaw_quat(0.5), quat))
    phase = Phase(hand=0, quat=(w, x, y, z), keeps=0 if laden else -1)
    rows = Programs.pack([[phase]]).at(np.zeros(1, int))
    for _ in range(40):
        hands = np.array(senses.hand_quat)
        hands[0, 0] = quat_multiply(yaw_quat(turned[-1 - late]), quat)
        now = dataclasses.replace(senses, hand_quat=hands)
        turned.append(turned[-1] + float(body.command(now, rows)[0, yaw]))
    assert np.allclose(turned[-6:], 0.5, atol=0.02)


def test_fingers_that_close_step_by_step_sweep_what_is_below_the_palm(robot):
    body, names, view = robot
    rows = Programs.pack([[Phase(hand=1, close=True, closes=0.1)]]).at(np.zeros(1, int))
    assert body.command(sense(view, 0, body.hands), rows)[0, names.index("right_hand_trigger")] == pytest.approx(0.1)
    spec = mujoco.MjSpec()
    Humanoid().attach(spec)
    model = spec.compile()
    data, name = mujoco.MjData(model), "humanoid_right_hand"
    outer = [model.body(f"{name}_{finger}_middle").id for finger in FINGERS[1:]]
    geoms = [g for g in range(model.ngeom) if model.geom_bodyid[g] in outer and model.geom_contype[g]]
    deepest = []
    for share in np.linspace(0.5, 1.0, 11):
        for finger in FINGERS:
            closed = THUMB_CLOSED if finger == "thumb" else FINGER_CLOSED
            for segment in SEGMENTS:
                data.joint(f"{name}_{finger}_{segment}_joint").qpos[0] = share * closed
        mujoco.mj_kinematics(model, data)
        palm = data.body(name).xpos + data.body(name).xmat.reshape(3, 3) @ body.grips[1]
        down = data.body(name).xmat.reshape(3, 3)[:, 2]
        ends = [
            data.geom_xpos[g] + side * model.geom_size[g, 1] * data.geom_xmat[g].reshape(3, 3)[:, 2]
            for g in geoms
            for side in (1, -1)
        ]
        deepest.append(max(float((e - palm) @ down) for e in ends) + RADIUS[1])
    assert SWEEPS < max(deepest) < SWEEPS + 0.01 and int(np.argmax(deepest)) < 10
