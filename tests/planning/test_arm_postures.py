"""Inverse kinematics of an arm on wheels: postures for poses that its joints reach."""

import numpy as np
import pytest

import ig2mj
from ig2mj.agents import Fetch
from ig2mj.agents.grasping.grasp import MAX_DISTANCE
from ig2mj.agents.task_robot import TaskRobot
from ig2mj.planning import grasps
from ig2mj.planning.arm_model import FASTEST, POINTS, STEPS
from ig2mj.planning.arms import BACK, DRAWN_BACK, PART, ArmBody, in_parts
from ig2mj.planning.body_kinds import body_of
from ig2mj.planning.clearance import Obstacles
from ig2mj.planning.phases import Base, Phase, Programs
from ig2mj.planning.senses import Senses


@pytest.fixture(scope="module")
def body(tiny_home_folder):
    scene = ig2mj.load_scene(tiny_home_folder, agents=[Fetch().at(-0.45, 0.0, 0.0)])
    robot = scene.agents[0]
    assert isinstance(robot, TaskRobot)
    found = body_of(scene, robot.controller(scene.tables, 0, 0.1))
    assert isinstance(found, ArmBody)
    return found


def test_almost_all_poses_that_an_arm_reaches_have_a_posture(body):
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


class _Ball(Obstacles):
    """Nothing but a point."""

    def __init__(self, at):
        self._at = at

    def clear(self, spheres):
        return bool((np.linalg.norm(spheres[:, :3] - self._at, axis=1) > spheres[:, 3]).all())


def follower(body: ArmBody, at, quat, monkeypatch):
    """Of the arm at rest of a robot at the origin, whose links have room."""
    found = body.follower(np.zeros(0), True, (np.zeros(3), 0.0), quat, _Ball(np.asarray(at, float)))
    monkeypatch.setattr(found, "_clear", lambda joints: True)
    return found


@pytest.mark.slow
def test_a_hand_needs_room_where_its_arm_brings_it(body, monkeypatch):
    """Inverse kinematics bring a hand off the straight line to a point near the robot's base."""
    hand, far = np.array([[0.0, 0.0, 0.0, 0.1]]), np.full(3, 9.0)
    quat = np.array(body.turned(0, np.array([0.0, 1.0, 0.0]), np.array([1.0, 0.0, -1.0]) / np.sqrt(2)))
    model, start = body.model, body.model.hand(body._at_rest[None])[0][0]
    goals = [np.array([x, y, z]) for x in (0.45, 0.6, 0.75) for y in (-0.3, 0.0, 0.3) for z in (0.15, 0.5, 0.9)]
    strayed = 0.0
    for goal in goals:
        joints = model.follow(body._at_rest, goal[None], quat[None])
        if joints is None:
            continue
        along, middle = goal - start, model.hand(joints)[0]
        share = np.clip((middle - start) @ along / (along @ along), 0.0, 1.0)
        off = np.linalg.norm(middle - (start + share[:, None] * along), axis=1)
        worst = int(np.argmax(off))
        if off[worst] < 0.1:
            continue
        strayed = max(strayed, float(off[worst]))
        on_line = start + share[worst] * along
        assert follower(body, far, quat, monkeypatch)([goal], hand)
        assert not follower(body, middle[worst], quat, monkeypatch)([goal], hand)
        if np.linalg.norm(middle - on_line, axis=1).min() > 0.12:
            assert follower(body, on_line, quat, monkeypatch)([goal], hand)
    assert strayed > 0.1


def test_what_a_hand_carries_goes_in_parts(body):
    """Of the program, phases that keep what is held and follow another of the hand."""
    ends = [(0.6, 0.0, 1.0), (0.6, 0.0, 0.5)]
    parts = body.prepared([Phase(hand=0, pos=p, keeps=3) for p in ends])
    points = np.array([p.pos for p in parts])
    assert np.linalg.norm(np.diff(points, axis=0), axis=1).max() <= PART + 1e-9
    assert parts[0].pos == ends[0] and parts[-1] == Phase(hand=0, pos=ends[1], keeps=3)
    assert all(p.after == "" and p.keeps == 3 for p in parts[1:-1])
    assert len(body.prepared([Phase(hand=0, pos=p) for p in ends])) == len(ends)
    assert np.allclose(in_parts(np.zeros(3), [np.array([0.2, 0.0, 0.0])])[0], (0.1, 0.0, 0.0))


def asked(body: ArmBody, still: int, keeps: int) -> float:
    """m that a hand 0.4 m above its goal is asked to move in an agent step, after some in which it has not moved."""
    quat = np.array([[1.0, 0.0, 0.0, 0.0]])
    here = np.array([[0.6, 0.0, 1.0]])
    at = Senses(
        np.zeros((1, 3)),
        quat,
        here[None] - body.grips[:1],
        quat[None],
        np.ones((1, 1, 1), bool),
        np.zeros((1, 1), bool),
    )
    rows = Programs.pack([[Phase(hand=0, pos=(0.6, 0.0, 0.6), keeps=keeps)]]).at(np.zeros(1, int))
    _, move, _ = body._hand_step(at, {**rows, "still": np.array([still])})
    return float(np.linalg.norm(move))


def test_a_laden_hand_that_is_blocked_is_asked_for_less_than_would_cost_it_what_it_holds(body):
    """Servos add up what is asked of a blocked hand."""
    assert asked(body, 0, keeps=0) == asked(body, 1, keeps=0) == pytest.approx(FASTEST)
    assert sum(asked(body, still, keeps=0) for still in range(1, 60)) < MAX_DISTANCE
    assert sum(asked(body, still, keeps=-1) for still in range(1, 6)) > MAX_DISTANCE, "an empty one loses nothing"


def test_a_base_whose_arm_turns_it_comes_back(body):
    """In phases of the hand; one that drives does as it is asked."""
    quat = np.array([[np.cos(0.05), 0.0, 0.0, np.sin(0.05)]])  # turned by 0.1 rad to the left, and 3 cm ahead
    hand = np.array([[[0.6, 0.0, 1.0]]])
    at = Senses(np.array([[0.03, 0.0, 0.0]]), quat, hand, quat[None], np.zeros((1, 1, 1), bool), np.zeros((1, 1), bool))
    names = list(body._names)
    forward, turn = names.index("forward"), names.index("turn_left")
    for phase, back in ((Phase(hand=0, pos=(0.6, 0.0, 0.6)), True), (Phase(), False)):
        rows = Programs.pack([[phase]]).at(np.zeros(1, int))
        action = body.command(at, {**rows, "stays": np.zeros((1, 3))})[0]
        assert (action[forward] < 0.0 and action[turn] < 0.0) == back
        assert abs(action[turn]) <= BACK and (back or action[turn] == 0.0)
    rows = Programs.pack([[Phase(Base.TURN, yaw=1.0)]]).at(np.zeros(1, int))
    assert body.command(at, {**rows, "stays": np.zeros((1, 3))})[0][turn] > 0.0


def test_a_hand_that_carries_something_is_moved_back_to_where_it_does_by_little(body):
    """While the base drives: what is asked of a hand that something holds adds up."""
    held = np.ones((1, 1, 1), bool)
    moves = []
    for aside in (0.0, 0.003, 0.05):
        hand = (body.carry[0] + [0.0, aside, 0.0] - body.grips[0])[None, None]
        quat = np.array([[1.0, 0.0, 0.0, 0.0]])
        at = Senses(np.zeros((1, 3)), quat, hand, quat[None], held, np.zeros((1, 1), bool))
        moves.append(float(np.linalg.norm(body._carried_back(at, np.ones(1, bool))[0])))
    assert moves[0] == pytest.approx(0.0, abs=1e-6) and 0.0 < moves[1] < moves[2] <= DRAWN_BACK + 1e-9
    assert not body._carried_back(at, np.zeros(1, bool)).any(), "where the base stands, the hand is asked by its phase"


def test_a_way_whose_point_a_hand_comes_no_nearer_to_is_given_up_early(body):
    _, quat = body.model.hand(body.model.rest[None])
    for point, most in (([3.0, 0.0, 1.0], STEPS / 2), ([0.5, 0.0, 0.9], STEPS)):
        points = np.tile(np.array(point, np.float32), (POINTS, 1))
        joints, number = body.model._follow(np.asarray(body.model.rest), points, np.tile(quat, (POINTS, 1)))
        steps = int(np.argmax((np.asarray(joints) == np.asarray(joints)[-1]).all(1)))
        assert 0 < steps < most and (number[-1] == POINTS) == (point[0] < 1.0)
    assert body.model.follow(body.model.rest, np.array([[3.0, 0.0, 1.0]]), quat) is None


def test_ways_that_begin_where_a_hand_turns_follow_it_there_once(body, monkeypatch):
    quat, followed = np.array(body.turned(0, [0.0, 1.0, 0.0], [1.0, 0.0, 0.0])), []
    found = follower(body, [0.0, 0.0, 9.0], quat, monkeypatch)
    old = found._followed
    monkeypatch.setattr(found, "_followed", lambda points, q: followed.append(len(points)) or old(points, q))
    for x in (0.5, 0.6):
        assert found([np.array([x, 0.0, 0.9])], np.zeros((0, 4)), np.array([0.5, 0.1, 0.9])) is not None
    assert len(followed) == 3


class _Front(Obstacles):
    """Of a drawer: 2 cm thick and 20 cm high from a height (m) on, 5 cm before x = 0."""

    def __init__(self, height):
        self._middle = np.array([-0.05, 0.0, height + 0.1])

    def distance(self, points):
        beyond = np.abs(points - self._middle) - [0.01, 0.5, 0.1]
        return np.linalg.norm(np.maximum(beyond, 0.0), axis=-1) + np.minimum(beyond.max(-1), 0.0)


@pytest.mark.parametrize(("height", "passes"), [(0.0, True), (0.2, False), (0.9, True)])
def test_a_gripper_does_not_come_to_a_grasp_through_the_front_of_a_drawer(body, height, passes):
    """The gripper is level, at 0.3 m."""
    at, across, out = np.array([[0.0, 0.0, 0.3]]), np.array([[0.0, 1.0, 0.0]]), np.array([[1.0, 0.0, 0.0]])
    assert grasps._passes(body, _Front(height), at, across, out).tolist() == [passes]
