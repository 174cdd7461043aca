"""What stirring makes is planned from its ingredients, said, offered, set and carried out."""

from __future__ import annotations

import numpy as np
import pytest

import ig2mj
from ig2mj.agents.registry import make_robot
from ig2mj.planning.grounding import ground_steps
from ig2mj.planning.kinematic import kinematic_episodes
from ig2mj.planning.solver import solve
from ig2mj.planning.steps import PlanningError, Step
from ig2mj.planning.task_planner import TaskPlanner
from ig2mj.planning.words import NotUnderstoodError
from ig2mj.web.planning import offers
from tests.planning.test_pouring import done, planned, problem, rung

SPOON = ("spoon@on_top:coffee_table_0",)
APART = (*SPOON, "carafe@on_top:breakfast_table_0", "substances:salt@mug_0,water@carafe_0,seawater")
TOGETHER = (*SPOON, "substances:salt@bowl_0,water@bowl_0,seawater")
GOAL = "(contains bowl_0 seawater)"


@pytest.mark.parametrize("goal", [GOAL, "(filled bowl_0 seawater)"])
def test_ingredients_are_poured_together_and_stirred(goal):
    steps = planned(goal, APART)
    assert {"pour mug_0 bowl_0 salt", "pour carafe_0 bowl_0 water"} < set(steps)
    assert steps[-2:] == ["grasp spoon_0", "mix bowl_0 spoon_0 seawater"]


@pytest.mark.slow
def test_what_is_there_already_is_only_stirred():
    assert planned(GOAL, TOGETHER) == ["grasp spoon_0", "mix bowl_0 spoon_0 seawater"]
    assert planned("stir the bowl with the spoon", TOGETHER)[-1] == "mix bowl_0 spoon_0 seawater"
    assert planned("mix seawater in the bowl", TOGETHER)[-1] == "mix bowl_0 spoon_0 seawater"


@pytest.mark.slow
def test_without_ingredients_or_stirrer_it_is_refused():
    with pytest.raises(PlanningError, match="seawater"):
        planned(GOAL, (*SPOON, "substances:water@carafe_0,salt,seawater", "carafe@on_top:breakfast_table_0"))
    with pytest.raises(PlanningError, match="seawater"):
        planned(GOAL, TOGETHER[1:])
    with pytest.raises(NotUnderstoodError, match="no recipe that is stirred"):
        planned("stir the mug", TOGETHER)
    with pytest.raises(NotUnderstoodError, match="no container of substances"):
        planned("stir the apple", TOGETHER)


def test_litres_stay_the_same_on_the_symbolic_rung():
    made = rung("(and)", TOGETHER)
    assert "no hand holds spoon_0" in done(made, "mix", "bowl_0", "spoon_0", "seawater").detail
    assert done(made, "grasp", "spoon_0").done
    before = np.asarray(made.state(0)[1].volume).sum()
    assert done(made, "mix", "bowl_0", "spoon_0", "seawater").done
    after = np.asarray(made.state(0)[1].volume)
    assert after.sum() == pytest.approx(before) and made.facts(0).holds("contains", "bowl_0", "seawater")
    assert not made.facts(0).holds("contains", "bowl_0", "salt")
    assert "lacks" in done(made, "mix", "bowl_0", "spoon_0", "seawater").detail


@pytest.mark.slow
def test_its_motion_is_planned_on_the_kinematic_rung():
    found, known = problem(GOAL, TOGETHER)
    ((_, made),) = kinematic_episodes(known, found, None, [0])
    (result,) = solve(TaskPlanner(known, found.goal), made)
    assert result.success, [(str(r.step), r.outcome) for r in result.steps]


@pytest.mark.slow
def test_pages_and_ground_steps_have_it_and_exported_plans_the_recipe(tmp_path):
    found, known = problem(GOAL, TOGETHER)
    asked = ("mix", "bowl_0", "spoon_0", "seawater")
    assert offers(known, "bowl_0", ("spoon_0",))["Mix seawater with spoon_0"] == asked
    assert Step("mix", asked[1:]) in set(ground_steps(known, found))
    planned(GOAL, TOGETHER, folder=tmp_path)
    text = (tmp_path / "problem.pddl").read_text()
    assert "(stirs spoon_0)" in text and "(part_of salt seawater)" in text and "(contains bowl_0 salt)" in text
    assert "(:action mix" in (tmp_path / "domain.pddl").read_text()


@pytest.mark.slow
@pytest.mark.parametrize("robot", ["humanoid", "fetch"])
def test_a_robot_stirs_salt_and_water_in_a_bowl(robot):
    scene = ig2mj.load_scene("small_home", agents=[make_robot(robot).at(-1.0, 0.0, 0.0)], objects=TOGETHER)
    simulation = ig2mj.Simulation(scene, grasping="assisted")
    before = np.asarray(simulation.states.volume).sum()
    for request in ("grasp spoon_0", "mix bowl_0 spoon_0 seawater"):
        outcome = simulation.agent.do(*request.split())
        assert outcome.done, f"{request}: {outcome}"
    assert simulation.predicate("contains", "bowl_0", "seawater")
    assert np.asarray(simulation.states.volume).sum() == pytest.approx(before, rel=1e-5)
