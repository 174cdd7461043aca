"""Objects are sprayed with what an atomizer holds: planned, said, offered, set and carried out."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
import pytest

import ig2mj
from ig2mj.agents.humanoid import Humanoid
from ig2mj.planning.domain import Domain
from ig2mj.planning.grounding import ground_steps
from ig2mj.planning.kinematic import kinematic_episodes
from ig2mj.planning.solver import solve
from ig2mj.planning.steps import Step
from ig2mj.planning.task_planner import TaskPlanner
from ig2mj.planning.words import NotUnderstoodError
from ig2mj.states.substances.applying import REACH, in_cone
from ig2mj.web.planning import offers
from tests.planning.test_pouring import amounts, done, planned, problem, rung

SPRAY = ("atomizer@on_top:coffee_table_0", "substances:water@atomizer_0,vinegar")
STEPS = ["grasp atomizer_0", "spray breakfast_table_0 atomizer_0 water"]


@pytest.mark.slow
@pytest.mark.parametrize(
    "goal",
    [
        "(covered breakfast_table_0 water)",
        "spray the breakfast table",
        "spray the breakfast table with water",
        "spray water onto the breakfast table",
        "spray the breakfast table with the atomizer",
    ],
)
def test_a_table_is_sprayed_with_what_an_atomizer_holds(goal):
    assert planned(goal, SPRAY) == STEPS


@pytest.mark.slow
def test_cloth_is_soaked_by_a_spray_or_below_a_tap_whichever_is_shorter():
    assert planned("(saturated dishtowel_0 water)", SPRAY)[-1] == "spray dishtowel_0 atomizer_0 water"
    assert planned("(saturated dishtowel_0 water)", ())[-1] == "soak dishtowel_0 sink_0"


def test_words_for_what_no_spray_holds_say_so():
    with pytest.raises(NotUnderstoodError, match="no spray that can be carried contains vinegar"):
        planned("spray vinegar onto the breakfast table", SPRAY)


def test_a_robot_with_one_hand_has_nothing_to_spray_with():
    found, known = problem("(covered breakfast_table_0 water)", SPRAY)
    assert known.sprays == ("atomizer_0",) and Domain(found.model, 1).sprays == ()
    assert Step("spray", ("breakfast_table_0", "atomizer_0", "water")) in set(ground_steps(known, found))
    offered = offers(known, "sofa_0", ("atomizer_0",), {"atomizer_0": ["water"]})
    assert offered["Spray with water"] == ("spray", "sofa_0", "atomizer_0", "water")


@pytest.mark.slow
@pytest.mark.parametrize("step, meant", [
    (("spray", "mug_0"), "covered"), (("spray", "dishtowel_0"), "saturated"),
    (("spray", "breakfast_table_0"), "covered"), (("pour", "mug_0"), "contains"),
    (("pour", "coffee_table_0"), "covered"),
])  # fmt: skip
def test_what_gets_a_substance_says_what_is_meant(step, meant):
    """A spray fills nothing, not even what something could be poured into."""
    _, known = problem("(covered breakfast_table_0 water)", SPRAY)
    name, target = step
    arguments = (target, "atomizer_0", "water") if name == "spray" else ("atomizer_0", target, "water")
    (condition,) = known.meant(Step(name, arguments)).also
    assert (condition.predicate, condition.arguments) == (meant, (target, "water"))


def test_states_are_set_and_litres_stay_the_same():
    made = rung("(and)", SPRAY)
    assert done(made, "grasp", "atomizer_0").done and done(made, "grasp", "mug_0").done
    asked = ("spray", "breakfast_table_0", "atomizer_0", "water")
    assert "the hands are full" in done(made, *asked).detail
    assert done(made, "release", "mug_0").done
    before = amounts(made)
    assert done(made, *asked).done and made.facts(0).holds("covered", "breakfast_table_0", "water")
    assert sum(amounts(made)) == pytest.approx(sum(before), abs=1e-6)
    assert "contains no vinegar" in done(made, *asked[:3], "vinegar").detail


@pytest.mark.slow
def test_its_motion_is_planned_on_the_kinematic_rung():
    found, known = problem("(covered breakfast_table_0 water)", SPRAY)
    ((_, made),) = kinematic_episodes(known, found, None, [0])
    (result,) = solve(TaskPlanner(known, found.goal), made)
    assert result.success, [(str(r.step), r.outcome) for r in result.steps]


def test_a_cone_is_the_same_for_one_world_on_the_host_and_for_a_batch():
    rng = np.random.default_rng(0)
    points = rng.uniform(-0.4, 0.4, (1, 40, 20, 3)).astype(np.float32)
    normals = rng.normal(size=points.shape).astype(np.float32)
    ahead = np.array([0.6, 0.0, -0.8], np.float32)[None, None, None]
    nozzle, others = np.zeros((1, 1, 1, 3), np.float32), np.arange(40) != 3
    host = in_cone(points, normals, nozzle, ahead, others)
    batch = in_cone(jnp.asarray(points), jnp.asarray(normals), nozzle, ahead, others)
    assert isinstance(host[0], np.ndarray) and np.array_equal(host[0], np.asarray(batch[0]))
    assert host[0].any() and not host[0][0, 3].any() and host[1][host[0]].max() <= REACH


@pytest.mark.slow
def test_the_humanoid_sprays_a_table_alone_and_switches_the_atomizer_off():
    scene = ig2mj.load_scene("small_home", agents=[Humanoid().at(-1.0, 0.0, 0.0)], objects=SPRAY)
    simulation = ig2mj.Simulation(scene, grasping="assisted")
    assert simulation.agent.do("grasp", "atomizer_0").done
    assert not simulation.predicate("toggled_on", "atomizer_0")
    outcome = simulation.agent.do(*STEPS[1].split())
    assert outcome.done, outcome
    assert not simulation.predicate("toggled_on", "atomizer_0")
    covered = [n for n in scene.object_names if simulation.predicate("covered", n, "water")]
    assert covered == ["breakfast_table_0"]
