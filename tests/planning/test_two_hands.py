"""What one hand of the humanoid does not lift is taken, carried and put down by both."""

import dataclasses

import numpy as np
import pytest
from heavy_crate import write_heavy_crate

import ig2mj
from ig2mj.agents.fetch import Fetch
from ig2mj.agents.humanoid import Humanoid
from ig2mj.planning import execution
from ig2mj.planning.body_kinds import body_of
from ig2mj.planning.domain import Domain
from ig2mj.planning.kinematic import kinematic_episodes
from ig2mj.planning.phases import Phase, Programs, Until
from ig2mj.planning.problem import problem_of
from ig2mj.planning.senses import Senses
from ig2mj.planning.steps import make_step
from ig2mj.planning.symbolic import SymbolicRung
from ig2mj.planning.task_planner import TaskPlanner
from ig2mj.predicates.compile import compile_expression
from ig2mj.predicates.host_queries import HostQueries
from ig2mj.sampling.many import make_sampler


@pytest.fixture
def crate(tmp_path):
    """A simulation of a crate of a mass, kg, with the humanoid."""

    def make(mass):
        scene = ig2mj.load_scene(write_heavy_crate(tmp_path, mass), agents=[Humanoid().at(-1.4, -0.2, 0.0)])
        return ig2mj.Simulation(scene, grasping="assisted")

    return make


def holding(simulation, name="ball"):
    """Number of hands that hold an object."""
    return int(np.asarray(simulation.view.held)[0, :, simulation.scene.object_index(name)].sum())


@pytest.mark.slow
def test_both_hands_put_onto_a_table_what_one_does_not_lift(crate):
    simulation = crate(40.0)
    taken = simulation.agent.do("grasp", "ball")
    assert taken.done and holding(simulation) == 2, taken
    assert simulation.view.aabb_low[0, simulation.scene.object_index("ball"), 2] > 0.5
    full = simulation.agent.do("grasp", "can")
    assert full.reason == "no_grasp" and "full" in full.detail
    put = simulation.agent.do("place_on_top", "ball", "table")
    assert put.done and simulation.predicate("on_top", "ball", "table") and holding(simulation) == 0, put


@pytest.mark.slow
def test_both_hands_let_go_together(crate):
    simulation = crate(40.0)
    assert simulation.agent.do("grasp", "ball").done
    assert simulation.agent.do("release", "ball").done and holding(simulation) == 0
    assert simulation.agent.do("grasp", "can").done
    outcome = simulation.agent.do("grasp", "ball")
    assert outcome.reason == "no_grasp" and "both hands are needed" in outcome.detail


@pytest.mark.slow
def test_what_one_hand_lifts_is_taken_by_one(crate):
    simulation = crate(25.0)
    assert simulation.agent.do("grasp", "ball").done and holding(simulation) == 1


@pytest.mark.slow
def test_what_both_hands_do_not_lift_is_refused_at_once(crate):
    outcome = crate(60.0).agent.do("grasp", "ball")
    assert outcome.reason == "no_grasp" and "too heavy" in outcome.detail and outcome.time == 0.0


@pytest.fixture(scope="module")
def sampler(tmp_path_factory):
    return make_sampler(ig2mj.load_scene(write_heavy_crate(tmp_path_factory.mktemp("home"), 40.0)))


@pytest.fixture(scope="module")
def domain(sampler):
    return Domain.of_robot(sampler.model, Humanoid())


def test_a_heavy_object_takes_two_hands_of_a_robot_that_has_them(domain):
    assert domain.hands_for("ball") == 2 and domain.hands_for("can") == 1
    assert domain.hands_taken(["ball"]) == 2 and domain.hands_taken(["can", "apple"]) == 2
    assert dataclasses.replace(domain, hands=1).hands_for("ball") == 1
    assert Domain.of_robot(domain.model, Fetch()).hands_for("ball") == 1


def test_plans_put_down_everything_before_both_hands_are_taken(domain, sampler):
    goal = "(and (on_top can stove) (on_top apple stove) (on_top ball table))"
    planner = TaskPlanner(domain, compile_expression(domain.model, goal, questions=HostQueries.of(domain.model)))
    rung = SymbolicRung(domain, sampler, [sampler.start])
    assert _done(rung, "grasp", "can") == _done(rung, "grasp", "apple") == ""
    assert _done(rung, "grasp", "ball") == "no_grasp"
    steps = [str(step) for step in planner.plan(rung.facts(0)).steps]
    taken = steps.index("grasp ball")
    for name in ("can", "apple"):
        put = next(k for k, step in enumerate(steps) if step.startswith(("release " + name, "place_on_top " + name)))
        assert put < taken
    assert _done(rung, "release", "can") == _done(rung, "release", "apple") == _done(rung, "grasp", "ball") == ""
    assert _done(rung, "grasp", "can") == "no_grasp"


def _done(rung, *words):
    rung.begin(0, make_step(words[0], words[1:]))
    return rung.advance()[0].reason


@pytest.mark.slow
def test_both_hands_carry_on_the_kinematic_rung(tmp_path):
    problem = problem_of(str(write_heavy_crate(tmp_path, 40.0)), "(on_top ball table)")
    ((_, rung),) = kinematic_episodes(Domain.of_robot(problem.model, Humanoid()), problem, None, [0])
    assert _done(rung, "grasp", "ball") == ""
    assert rung._robots[0].held == ["ball", "ball"] and rung.facts(0).held == ("ball",)
    assert _done(rung, "place_on_top", "ball", "table") == ""
    assert rung._robots[0].held == ["", ""] and rung.facts(0).holds("on_top", "ball", "table")


def _senses(held):
    zero = np.zeros((1, 2, 3))
    unit = np.tile([1.0, 0.0, 0.0, 0.0], (1, 2, 1))
    return Senses(zero[:, 0], unit[:, 0], zero, unit, np.array([held]), np.zeros((1, 3), bool))


@pytest.mark.parametrize(("both", "lost"), [(False, False), (True, True)])
def test_a_phase_of_both_hands_fails_when_one_of_them_loses_the_object(both, lost):
    rows = Programs.pack([[Phase(hand=0, keeps=1, both=both)]]).at(np.zeros(1, int))
    one = _senses([[False, True, False], [False, False, False]])
    assert execution._lost(one, rows)[0] == lost
    two = _senses([[False, True, False], [False, True, False]])
    assert not execution._lost(two, rows)[0]


def test_a_planned_body_moves_both_hands_by_the_same(crate_body):
    body = crate_body
    rows = Programs.pack([[Phase(hand=0, pos=(0.0, 0.0, 1.0), both=True, close=False, until=Until.EMPTY)]])
    held = [[False, True, False], [False, True, False]]
    action = body.command(_senses(held), rows.at(np.zeros(1, int)))[0]
    left, right = action[12:20], action[20:28]
    assert left[2] > 0 and np.allclose(left[:3], right[:3]) and left[6] == right[6] < 0
    assert np.allclose(right[3:6], 0)


@pytest.fixture
def crate_body(tmp_path):
    scene = ig2mj.load_scene(write_heavy_crate(tmp_path, 40.0), agents=[Humanoid()])
    robot = scene.agents[0]
    return body_of(scene, robot.controller(scene.tables, 0))
