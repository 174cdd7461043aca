"""Ways over the floor, clearance of hands, and following of programs, in the tiny home of the tests."""

import numpy as np
import pytest

import ig2mj
from ig2mj.agents.turtlebot import TurtleBot
from ig2mj.engine.native.engine import NativeEngine
from ig2mj.planning import execution
from ig2mj.planning.body_kinds import body_of
from ig2mj.planning.clearance import Obstacles, hand_way, straight
from ig2mj.planning.driving import drive
from ig2mj.planning.footprint import BaseFootprint, Disc
from ig2mj.planning.motion_planner import MotionPlanner
from ig2mj.planning.phases import Base, Phase, Programs, Until
from ig2mj.planning.stage import CoreStage
from ig2mj.sampling.query import SceneQuery

NARROW = BaseFootprint((Disc(0.05, 1.0, 0.2),))


@pytest.fixture(scope="module")
def with_robot(tiny_home_folder):
    return ig2mj.load_scene(tiny_home_folder, agents=[TurtleBot().at(-1.5, -1.5, 0.0)])


@pytest.fixture(scope="module")
def view(with_robot):
    return SceneQuery(with_robot).view


@pytest.fixture(scope="module")
def planner(with_robot):
    return MotionPlanner(with_robot)


def box_of(scene, view, name):
    o = scene.object_index(name)
    return np.asarray(view.aabb_low)[0, o], np.asarray(view.aabb_high)[0, o]


def test_the_footprint_of_a_robot_is_as_wide_as_its_base(with_robot, view):
    footprint = BaseFootprint.of_robot(with_robot, view)
    assert footprint.radius == pytest.approx(0.1775, abs=0.005)
    assert footprint.discs[-1].high < 0.6
    wider = footprint.holding(0.3, 0.4, 0.5)
    assert wider.radius == 0.5 and wider.discs[0].radius < 0.5


def test_free_cells_keep_the_footprint_clear_of_furniture_at_its_height(with_robot, view, planner):
    low, high = box_of(with_robot, view, "table")
    floor = planner.floor(view, NARROW)
    cells = floor.occupancy.middles(np.argwhere(floor.free))
    outside = np.maximum(np.maximum(low[:2] - cells, cells - high[:2]), 0)
    assert (np.linalg.norm(outside, axis=1) > 0.2 - 0.03).all()
    above = planner.floor(view, BaseFootprint((Disc(float(high[2]) + 0.02, 2.0, 0.2),)))
    middle = floor.occupancy.cells((low[:2] + high[:2]) / 2)
    assert not floor.free[tuple(middle)] and floor.free.sum() < above.free.sum()


def test_a_way_leads_around_what_stands_between(with_robot, view, planner):
    low, high = box_of(with_robot, view, "table")
    start = np.asarray(view.agent.base_pos)[0, 0, :2]
    middle = (low[:2] + high[:2]) / 2
    goal = middle + (middle - start) / np.linalg.norm(middle - start) * 0.9
    floor = planner.floor(view, NARROW)
    goal = floor.occupancy.middles(floor.nearest(goal, 2.0))
    plan = planner.plan_base(view, goal, footprint=NARROW, yaw=1.0)
    assert plan.reason == "" and plan.yaw == 1.0
    assert plan.length >= np.linalg.norm(goal - start) - 0.1
    np.testing.assert_allclose(plan.points[0], start, atol=1e-6)
    for one, other in zip(plan.points[1:-1], plan.points[2:], strict=True):
        line = one + np.linspace(0, 1, 20)[:, None] * (other - one)
        outside = np.maximum(np.maximum(low[:2] - line, line - high[:2]), 0)
        assert (np.linalg.norm(outside, axis=1) > 0.15).all()


def test_why_there_is_no_way(with_robot, view, planner):
    low, high = box_of(with_robot, view, "table")
    blocked = planner.plan_base(view, (low[:2] + high[:2]) / 2, footprint=NARROW)
    assert blocked.reason == "no_base" and "is not free floor" in blocked.detail
    assert planner.plan_base(view, (50.0, 0.0), footprint=NARROW).reason == "no_base"


def test_distances_to_pieces_are_those_to_their_faces(with_robot, view):
    low, high = box_of(with_robot, view, "table")
    x, y = (low[:2] + high[:2]) / 2
    others = [o for o in range(len(with_robot.object_names)) if o != with_robot.object_index("table")]
    table = Obstacles(with_robot, view, 0, others)
    away = table.distance(np.array([[x, y, high[2] + 0.1], [x, y, high[2] - 0.01], [x, y, high[2] + 5.0]]))
    np.testing.assert_allclose(away, [0.1, -0.01, 0.3], atol=1e-3)
    assert table.below(np.array([x, y]), 2.0, [with_robot.object_index("table")]) == pytest.approx(high[2], abs=1e-3)
    assert table.below(np.array([x + 5, y]), 2.0, [with_robot.object_index("table")]) == -np.inf


def test_a_hand_goes_over_what_blocks_the_straight_line(with_robot, view):
    low, high = box_of(with_robot, view, "table")
    y = float((low[1] + high[1]) / 2)
    others = [o for o in range(len(with_robot.object_names)) if o != with_robot.object_index("table")]
    table = Obstacles(with_robot, view, 0, others)
    spheres = np.array([[0.0, 0.0, 0.0, 0.05]])
    start, goal = np.array([low[0] - 0.2, y, high[2] - 0.02]), np.array([high[0] + 0.2, y, high[2] - 0.02])
    assert not straight(table, spheres, start, goal)
    way = hand_way(table, spheres, start, goal)
    assert way is not None and max(p[2] for p in way) > high[2] + 0.05
    np.testing.assert_allclose(way[-1], goal)
    assert hand_way(table, spheres, start, np.array([(low[0] + high[0]) / 2, y, high[2] - 0.01])) is None


def test_programs_of_worlds_of_different_lengths_are_packed_into_arrays():
    programs = [
        [Phase(Base.DRIVE, xy=(1.0, 2.0)), Phase(hand=1, pos=(0.0, 0.0, 1.0), close=True, until=Until.HELD)],
        [],
    ]
    packed = Programs.pack(programs)
    assert packed.length.tolist() == [2, 0]
    rows = packed.at(np.array([1, 0]))
    assert rows["hand"].tolist() == [1, -1] and rows["close"].tolist() == [1, -1]
    assert rows["moves"].tolist() == [1, 0] and rows["until"].tolist() == [Until.HELD, Until.THERE]


def test_a_robot_goes_around_another_one(tiny_home_folder):
    """It would push it along: robots are driven to where they are told."""
    agents = [TurtleBot(name="one").at(-1.0, -1.4, 0.0), TurtleBot(name="other").at(0.0, -1.4, 0.0)]
    scene = ig2mj.load_scene(tiny_home_folder, agents=agents)
    view = SceneQuery(scene).view
    floors = [MotionPlanner(scene, agent).floor(view) for agent in range(2)]
    cells = [tuple(floors[0].occupancy.cells(np.asarray(view.agent.base_pos)[0, agent, :2])) for agent in range(2)]
    assert [[bool(floor.free[cell]) for cell in cells] for floor in floors] == [[True, False], [False, True]]
    plan = MotionPlanner(scene, 0).plan_base(view, (1.0, -1.4))
    away = np.linalg.norm(np.diff(plan.points, axis=0), axis=1).sum()
    assert not plan.reason and away > 2.05, "2 m straight on, through the other one"


@pytest.mark.slow
def test_a_wheeled_robot_follows_ways_in_two_worlds_at_once(with_robot):
    stage = CoreStage(with_robot, NativeEngine(with_robot, 2))
    planner, body = MotionPlanner(with_robot), body_of(with_robot, stage.controller)
    floor = planner.floor(stage.view)
    goals = [floor.occupancy.middles(floor.nearest(goal, 1.0)) for goal in ((1.0, -1.5), (-1.5, 0.5))]
    plans = [planner.plan_base(stage.view, goal, world=w) for w, goal in enumerate(goals)]
    carry = execution.begin([drive(plan.points, 0.5) for plan in plans])
    for _ in range(300):
        action, carry = execution.advance(body, 0, carry, stage.view)
        stage.act(action)
        if not carry.running.any():
            break
    assert [carry.reason(w) for w in range(2)] == ["", ""]
    there = np.asarray(stage.view.agent.base_pos)[:, 0, :2]
    assert (np.linalg.norm(there - np.array(goals), axis=1) < 0.06).all()
