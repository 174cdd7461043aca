"""What can be attached to something else is brought there: planned, said, offered, set and carried out."""

from __future__ import annotations

import pytest

import ig2mj
from ig2mj.agents.humanoid import Humanoid
from ig2mj.planning.grounding import ground_steps
from ig2mj.planning.kinematic import kinematic_episodes
from ig2mj.planning.solver import solve
from ig2mj.planning.steps import PlanningError, Step
from ig2mj.planning.task_planner import TaskPlanner
from ig2mj.planning.words import NotUnderstoodError
from ig2mj.sampling.conditions import Condition
from ig2mj.web.planning import offers
from tests.planning.test_pouring import done, planned, problem, rung

LAMP = ("table_lamp@on_top:coffee_table_0", "light_bulb@on_top:breakfast_table_0")
PAIR = (*LAMP, "with:attached:light_bulb_0>table_lamp_0@0,0,0.46")
ANYWHERE = (*LAMP, "with:attached:light_bulb_0>table_lamp_0")
GOAL = "(attached light_bulb_0 table_lamp_0)"


@pytest.mark.slow
@pytest.mark.parametrize("goal", [GOAL, "attach the light bulb to the table lamp", "screw the bulb into the lamp"])
def test_a_bulb_is_taken_and_attached(goal):
    assert planned(goal, PAIR) == ["grasp light_bulb_0", "attach light_bulb_0 table_lamp_0"]


def test_it_comes_after_placements():
    steps = planned(f"(and {GOAL} (on_top table_lamp_0 breakfast_table_0))", PAIR)
    assert steps[-1].startswith("attach") and "place_on_top table_lamp_0 breakfast_table_0" in steps


@pytest.mark.slow
def test_what_cannot_be_attached_is_refused_with_the_remedy():
    with pytest.raises(PlanningError, match="add 'with:attached:light_bulb_0>table_lamp_0'"):
        planned(GOAL, LAMP)
    _, known = problem(GOAL, PAIR)
    off = Condition("attached", ("light_bulb_0", "table_lamp_0"), False)
    assert known.impossible(off) == "no primitive takes 'light_bulb_0' off 'table_lamp_0'"
    with pytest.raises(NotUnderstoodError, match="cannot attach mug_0"):
        planned("attach the mug to the table lamp", PAIR)


def test_pages_and_ground_steps_have_it():
    found, known = problem(GOAL, PAIR)
    asked = ("attach", "light_bulb_0", "table_lamp_0")
    assert offers(known, "table_lamp_0", ("light_bulb_0",))["Attach light_bulb_0"] == asked
    assert [s for s in ground_steps(known, found) if s.primitive == "attach"] == [Step("attach", asked[1:])]


def test_it_is_set_on_the_symbolic_rung_and_the_hand_is_empty_then():
    made = rung("(and)", PAIR)
    assert "no hand holds" in done(made, "attach", "light_bulb_0", "table_lamp_0").detail
    assert done(made, "grasp", "light_bulb_0").done and done(made, "attach", "light_bulb_0", "table_lamp_0").done
    assert made.facts(0).held == () and made.facts(0).holds("attached", "light_bulb_0", "table_lamp_0")


@pytest.mark.slow
def test_its_motion_is_planned_on_the_kinematic_rung():
    found, known = problem(GOAL, PAIR)
    ((_, made),) = kinematic_episodes(known, found, None, [0])
    (result,) = solve(TaskPlanner(known, found.goal), made)
    assert result.success, [(str(r.step), r.outcome) for r in result.steps]
    assert made.facts(0).held == ()


@pytest.mark.slow
@pytest.mark.parametrize(
    "objects", [PAIR, (*LAMP, "with:attached:light_bulb_0>table_lamp_0")], ids=["place", "anywhere"]
)
def test_the_humanoid_attaches_a_bulb_that_stays_where_it_is(objects):
    scene = ig2mj.load_scene("small_home", agents=[Humanoid().at(-1.0, 0.0, 0.0)], objects=objects)
    simulation = ig2mj.Simulation(scene, grasping="assisted")
    for request in ("grasp light_bulb_0", "attach light_bulb_0 table_lamp_0", "navigate_to fridge_0"):
        outcome = simulation.agent.do(*request.split())
        assert outcome.done, f"{request}: {outcome}"
    assert simulation.holds(GOAL)
