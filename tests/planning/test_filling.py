"""Containers are filled with water below a tap: what is planned, said and offered, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest

import ig2mj
from ig2mj.agents.humanoid import Humanoid
from ig2mj.cli.common.planning import domain_of, expression_of
from ig2mj.errors import AbilityError
from ig2mj.planning.domain import Domain
from ig2mj.planning.grounding import ground_steps
from ig2mj.planning.pddl import write_pddl
from ig2mj.planning.problem import problem_of
from ig2mj.planning.requests import RequestSource
from ig2mj.planning.steps import PlanningError, Step, make_step
from ig2mj.planning.symbolic import start_facts, symbolic_episodes
from ig2mj.planning.task_planner import TaskPlanner
from ig2mj.predicates.literals import AbilityWarning, resolve
from ig2mj.predicates.logic import Atom
from ig2mj.sampling.conditions import Condition
from ig2mj.states.model import StateModel
from ig2mj.web.planning import offers

WET = Condition("filled", ("bowl_0", "water"))


def domain(*objects: str) -> Domain:
    scene = ig2mj.load_scene("small_home", objects=objects)
    return Domain(StateModel.of_manifest(scene.tables, scene.manifest))


def planned(goal: str, folder=None) -> list[str]:
    problem = problem_of("small_home", expression_of("small_home", goal, (), "humanoid"), ())
    known = domain_of(problem, "humanoid")
    facts = start_facts(known, problem.scene, problem.pool("held_out", 1), 0)
    plan = TaskPlanner(known, problem.goal).plan(facts)
    if folder is not None:
        write_pddl(folder, problem.name, facts, plan)
    return [str(step) for step in plan.steps]


@pytest.mark.slow
@pytest.mark.parametrize("goal", ["(filled bowl_0 water)", "(contains bowl_0 water)", "fill the bowl with water"])
def test_a_bowl_is_filled_below_a_tap_that_runs(goal):
    assert planned(goal)[2:] == ["toggle_on sink_0", "grasp bowl_0", "fill bowl_0 sink_0"]


@pytest.mark.slow
def test_what_lies_in_a_bowl_is_taken_out_first():
    out, down = planned("(filled bowl_0 water)")[:2]
    assert out == "grasp apple_0" and down.startswith("place_on_top apple_0 ")
    assert planned("(and (filled bowl_0 water) (inside apple_0 bowl_0))")[-1] == "fill bowl_0 sink_0"
    problem = problem_of("small_home", "(filled bowl_0 water)")
    known = domain_of(problem, "humanoid")
    ((_, rung),) = symbolic_episodes(known, problem.scene, None, [0])
    assert rung.facts(0).things_in("bowl_0") == ("apple_0",)
    for words in ("toggle_on sink_0", "grasp bowl_0"):
        rung.begin(0, make_step(words.split()[0], words.split()[1:]))
        assert rung.advance()[0].done
    rung.begin(0, make_step("fill", ("bowl_0", "sink_0")))
    assert rung.advance()[0].detail == "apple_0 is in bowl_0"


@pytest.mark.slow
def test_the_humanoid_takes_an_apple_out_of_the_bowl_that_it_is_asked_to_fill():
    scene = ig2mj.load_scene("small_home", agents=[Humanoid().at(-1.0, 0.0, 0.0)], substances=["water"])
    simulation = ig2mj.Simulation(scene, grasping="assisted")
    for request in ("toggle_on sink_0", "grasp bowl_0", "fill bowl_0 sink_0"):
        outcome = simulation.agent.do(*request.split())
        assert outcome.done, f"{request}: {outcome}"
    assert simulation.holds("(and (filled bowl_0 water) (not (inside apple_0 bowl_0)))")


def test_water_that_is_in_use_already_is_so_once():
    problem = problem_of("small_home", "(filled bowl_0 water)", ("substances:water",))
    assert problem.model.substances is not None and problem.model.substances.names.count("water") == 1


def test_an_exported_plan_has_the_action_and_water_as_a_constant(tmp_path):
    planned("(filled bowl_0 water)", tmp_path)
    text = (tmp_path / "domain.pddl").read_text()
    assert "(:constants water - substance)" in text and "(:action fill" in text
    assert "(filled bowl_0 water)" in (tmp_path / "problem.pddl").read_text()


@pytest.mark.parametrize(
    ("goal", "said"),
    [
        ("(filled bowl_0 milk)", "no container that can be carried holds enough milk"),
        ("(filled sofa_0 water)", "'sofa_0' is no container"),
    ],
)
def test_what_no_primitive_does_is_refused_with_the_reason(goal, said):
    with pytest.raises(PlanningError, match=said):
        planned(goal)


def test_where_no_water_is_in_use_the_reason_names_the_option():
    assert "--substances water" in domain().impossible(WET)
    known = domain("substances:water")
    assert known.impossible(WET) == ""
    assert "takes water out" in known.impossible(Condition("contains", ("bowl_0", "water"), False))


def test_pages_offer_it_and_requests_and_ground_steps_have_it():
    known = domain("substances:water")
    assert offers(known, "sink_0", ("bowl_0",))["Fill bowl_0"] == ("fill", "bowl_0", "sink_0")
    assert "Fill apple_0" not in offers(known, "sink_0", ("apple_0",))
    problem = problem_of("small_home", "(filled bowl_0 water)")
    assert Step("fill", ("bowl_0", "sink_0")) in set(ground_steps(domain_of(problem, "humanoid"), problem))
    source = RequestSource(
        known, (*known.tools[:1], *known.knives[:1], "apple_0", "fish_0", "spray", "spoon", "bulb", "lamp")
    )
    drawn = [source.draw("fill", np.random.default_rng(seed)) for seed in range(20)]
    taken = {request.step.arguments[0] for request in drawn if request is not None}
    assert taken and taken <= set(known.fillable)


def test_a_goal_that_asks_it_of_what_is_no_container_warns_or_is_refused():
    model = domain("substances:water").model
    with pytest.warns(AbilityWarning, match="'coffee_table_0': it is no container of substances"):
        assert not resolve(model, Atom("filled", ("coffee_table_0", "water"))).able
    with pytest.raises(AbilityError, match="no container"):
        resolve(model, Atom("contains", ("sofa_0", "water")), strict=True)
    assert resolve(model, Atom("filled", ("bowl_0", "water"))).able
