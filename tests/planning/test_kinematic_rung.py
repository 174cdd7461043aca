"""The kinematic rung: motion is planned as in physics, and its result is set."""

import numpy as np
import pytest

from ig2mj.planning.domain import Domain
from ig2mj.planning.joints import OPEN_TO
from ig2mj.planning.kinematic import kinematic_episodes
from ig2mj.planning.phases import Phase
from ig2mj.planning.problem import problem_of
from ig2mj.planning.pushing import BEHIND, PRESS
from ig2mj.planning.rung import Rung
from ig2mj.planning.solver import solve
from ig2mj.planning.steps import make_step
from ig2mj.planning.task_planner import TaskPlanner


@pytest.fixture(scope="module")
def rung(tiny_home_folder):
    problem = problem_of(str(tiny_home_folder), "(and (on_top apple table) (open cabinet))")
    ((_, rung),) = kinematic_episodes(Domain(problem.model, 2), problem, None, [0])
    return rung


def do(rung, *words):
    rung.begin(0, make_step(words[0], words[1:]))
    return rung.advance()[0]


@pytest.mark.slow
def test_what_a_hand_takes_goes_along_until_it_is_put_down(rung):
    assert isinstance(rung, Rung)
    outcome = do(rung, "grasp", "apple")
    assert outcome.done and outcome.planning > 0.0 and outcome.time == 0.0
    assert rung.facts(0).held == ("apple",)
    robot, stage = rung._robots[0], rung._stage
    held = np.asarray(stage.view.object_pos)[0, stage.scene.object_index("apple")]
    base = np.asarray(stage.view.agent.base_pos)[0, 0]
    np.testing.assert_allclose(base[:2], robot.xy, atol=1e-4)
    np.testing.assert_allclose(np.asarray(stage.view.agent.hand_pos)[0], [pos for pos, _ in robot.hands], atol=1e-4)
    assert np.linalg.norm(held - base) < 1.2
    assert do(rung, "place_on_top", "apple", "table").done
    assert rung.facts(0).held == () and rung.facts(0).holds("on_top", "apple", "table")


@pytest.mark.slow
def test_an_arm_carries_its_hand_to_where_it_is_planned(tiny_home_folder):
    problem = problem_of(str(tiny_home_folder), "(on_top apple table)")
    ((_, rung),) = kinematic_episodes(Domain(problem.model, 1), problem, None, [0], robot="fetch")
    assert do(rung, "grasp", "apple").done
    robot, stage = rung._robots[0], rung._stage
    agent = stage.view.agent
    np.testing.assert_allclose(np.asarray(agent.base_pos)[0, 0, :2], robot.xy, atol=1e-3)
    np.testing.assert_allclose(np.asarray(agent.hand_pos)[0], [pos for pos, _ in robot.hands], atol=2e-2)
    held = np.asarray(stage.view.object_pos)[0, stage.scene.object_index("apple")]
    assert np.linalg.norm(held - robot.hands[0][0]) < 0.3
    assert do(rung, "place_on_top", "apple", "table").done
    assert rung.facts(0).holds("on_top", "apple", "table")


@pytest.mark.slow
def test_what_a_hand_pushes_goes_by_its_stroke_without_the_way_up_to_it(tiny_home_folder):
    problem = problem_of(str(tiny_home_folder), "(on_top apple table)")
    ((_, rung),) = kinematic_episodes(Domain(problem.model, 2), problem, None, [0])
    index = rung.domain.index("can")
    before = np.asarray(rung._symbolic.show(0).view.object_pos)[0, index].copy()
    stroke, here = BEHIND + 0.1 + PRESS, [float(v) for v in before]
    program = [
        Phase(hand=0, pos=(here[0], here[1] - BEHIND, here[2])),
        Phase(hand=0, pos=(here[0], here[1] - BEHIND + stroke, here[2]), object=index),
    ]
    assert rung._follow(0, program, make_step("navigate_to", ("can",))) == ""
    after = np.asarray(rung._symbolic.show(0).view.object_pos)[0, index]
    np.testing.assert_allclose(after - before, [0.0, 0.1, 0.0], atol=0.01)


def test_failures_have_the_reasons_of_physics(rung):
    assert do(rung, "place_on_top", "can", "stove").reason == "no_grasp"
    assert do(rung, "grasp", "table").reason == "no_grasp"


@pytest.mark.slow
def test_an_episode_is_solved_by_planned_motion():
    problem = problem_of("small_home", "(inside apple_0 fridge_0)")
    planner = TaskPlanner(Domain(problem.model, 2), problem.goal)
    for _, rung in kinematic_episodes(planner.domain, problem, None, [0]):
        (result,) = solve(planner, rung)
        assert result.success
        assert [r.step.primitive for r in result.steps] == ["open", "grasp", "place_inside"]


@pytest.mark.slow
def test_what_is_opened_stands_as_wide_open_as_a_hand_opens_it(tiny_home_folder):
    problem = problem_of(str(tiny_home_folder), "(open cabinet)")
    for number in range(3):
        ((_, rung),) = kinematic_episodes(Domain(problem.model, 2), problem, None, [number])
        assert do(rung, "open", "cabinet").done
        assert rung.facts(0).open_share("cabinet") > OPEN_TO - 0.05
