"""Ways of hands: the straight line, via points, RRT-Connect, and why there is none."""

import numpy as np
import pytest

import ig2mj
from ig2mj.agents import Humanoid
from ig2mj.agents.fetch import Fetch
from ig2mj.planning import rrt_connect
from ig2mj.planning.hand_collision import HandCollision
from ig2mj.planning.motion_planner import MotionPlanner
from ig2mj.planning.steps import PlanningError
from ig2mj.sampling.query import SceneQuery

UNDER_THE_TABLE = (-0.15, 0.0, 0.25)
"""From where the left hand is, above the edge of the table, neither a line nor via points lead there."""


@pytest.fixture(scope="module")
def scene(tiny_home_folder):
    return ig2mj.load_scene(tiny_home_folder, agents=[Humanoid().at(-0.45, 0.0, 0.0)])


@pytest.fixture(scope="module")
def view(scene):
    return SceneQuery(scene).view


@pytest.fixture(scope="module")
def planner(scene):
    return MotionPlanner(scene)


def test_a_hand_takes_the_straight_line_where_it_is_free(view, planner):
    goal, quat = (-0.3, 0.3, 0.7), np.array([1.0, 0.0, 0.0, 0.0])
    plan = planner.plan_hand(view, goal, quat=quat)
    assert (plan.reason, plan.method, len(plan.points)) == ("", "straight", 2)
    np.testing.assert_allclose(plan.points[-1], goal)
    np.testing.assert_allclose(plan.quats[0], np.asarray(view.agent.hand_quat)[0, 0], atol=1e-5)
    assert abs(plan.quats[-1] @ quat) == pytest.approx(1.0, abs=1e-4)
    assert plan.length == pytest.approx(float(np.linalg.norm(plan.points[1] - plan.points[0])))


def test_why_a_hand_has_no_way(view, planner):
    assert planner.plan_hand(view, (3.0, 0.0, 0.5)).reason == "no_base"
    inside = planner.plan_hand(view, (-0.15, 0.0, 0.48))
    assert inside.reason == "no_grasp" and inside.detail.endswith("table")
    assert inside.points.shape == (1, 3)


def test_what_does_not_count_is_no_obstacle(scene, view, planner):
    table = scene.object_index("table")
    assert planner.plan_hand(view, UNDER_THE_TABLE, without=[table]).method == "via"


@pytest.mark.skipif(not rrt_connect.is_installed(), reason='OMPL is not installed (pip install "ig2mj[plan]")')
def test_rrt_connect_finds_the_way_that_lines_and_via_points_do_not(scene, view, planner):
    plan = planner.plan_hand(view, UNDER_THE_TABLE)
    assert (plan.reason, plan.method) == ("", "rrt_connect")
    collision = HandCollision(scene, view, 0, planner._body.grips[0])
    for one, other in zip(plan.points[:-1], plan.points[1:], strict=True):
        for share in np.linspace(0.0, 1.0, 1 + int(np.linalg.norm(other - one) / 0.02)):
            assert collision.clear(one + share * (other - one), plan.quats[0])
    again = planner.plan_hand(view, UNDER_THE_TABLE)
    np.testing.assert_array_equal(plan.points, again.points)


def test_without_ompl_the_reason_names_the_extra(view, planner, monkeypatch):
    monkeypatch.setattr("ig2mj.planning.hand_way.is_installed", lambda: False)
    monkeypatch.setattr("ig2mj.planning.motion_planner.is_installed", lambda: False)
    plan = planner.plan_hand(view, UNDER_THE_TABLE)
    assert plan.reason == "no_path" and "[plan]" in plan.detail


def test_arms_and_hands_that_are_not_there_are_refused(view, planner, tiny_home_folder):
    with pytest.raises(PlanningError, match="hands 0 to 1, not 2"):
        planner.plan_hand(view, (0.0, 0.0, 1.0), hand=2)
    with pytest.raises(PlanningError, match="float: plan_hand"):
        planner.plan_arm(view, (0.0, 0.0, 1.0))
    scene = ig2mj.load_scene(tiny_home_folder, agents=[Fetch().at(-1.4, -1.2, 0.0)])
    with pytest.raises(PlanningError, match="plan_arm"):
        MotionPlanner(scene).plan_hand(view, (0.0, 0.0, 1.0))


@pytest.mark.slow
def test_an_arm_has_a_way_in_its_joints_or_a_reason(tiny_home_folder):
    scene = ig2mj.load_scene(tiny_home_folder, agents=[Fetch().at(-1.4, -1.2, 0.0)])
    view, planner = SceneQuery(scene).view, MotionPlanner(scene)
    goal = np.array([-0.7, -1.2, 0.9])
    plan = planner.plan_arm(view, goal, quat=(0.7071, 0.0, 0.7071, 0.0))
    assert plan.reason == "" and plan.names[0] == "fetch_torso_lift_joint"
    model = planner._any_body.model
    pos, _ = model.hand(plan.joints[-1:])
    np.testing.assert_allclose(pos[0] + (-1.4, -1.2, 0.0), goal, atol=0.02)
    low, high = model.chain.lower, model.chain.upper
    assert (plan.joints >= low - 1e-5).all() and (plan.joints <= high + 1e-5).all()
    assert planner.plan_arm(view, (3.0, 0.0, 0.5)).reason == "no_base"
    assert planner.plan_arm(view, (-0.7, -1.2, -0.05), quat=(0.7071, 0.0, 0.7071, 0.0)).reason in (
        "no_grasp",
        "no_base",
    )
