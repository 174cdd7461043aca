"""Primitives that the humanoid carries out by its own actions, in the tiny home of the tests."""

import pytest

import ig2mj
from ig2mj.agents.humanoid import Humanoid
from ig2mj.agents.turtlebot import TurtleBot
from ig2mj.errors import EngineError, UnknownNameError
from ig2mj.planning import PlanningError


def simulation_of(folder, robot, **options):
    return ig2mj.Simulation(ig2mj.load_scene(folder, agents=[robot]), **options)


@pytest.mark.slow
def test_the_humanoid_takes_an_apple_puts_it_on_the_table_and_works_a_cabinet(tiny_home_folder):
    simulation = simulation_of(tiny_home_folder, Humanoid().at(-1.4, -1.2, 0.0), grasping="assisted")
    agent = simulation.agent
    for primitive, *arguments in (
        ("navigate_to", "apple"),
        ("grasp", "ball"),
        ("place_on_top", "ball", "table"),
        ("toggle_on", "stove"),
    ):
        outcome = agent.do(primitive, *arguments)
        assert outcome.done, f"{primitive} {arguments}: {outcome}"
    assert simulation.predicate("on_top", "ball", "table") and simulation.predicate("toggled_on", "stove")
    assert agent.facts.held == ()


@pytest.mark.slow
def test_requests_that_cannot_be_carried_out_are_refused(tiny_home_folder):
    simulation = simulation_of(tiny_home_folder, Humanoid().at(-1.4, -1.2, 0.0))
    agent = simulation.agent
    assert agent is simulation.robots["humanoid"]
    with pytest.raises(PlanningError, match="grasping='assisted'"):
        agent.do("grasp", "apple")
    with pytest.raises(UnknownNameError, match="no object is named 'aple'"):
        agent.do("navigate_to", "aple")
    with pytest.raises(UnknownNameError, match="near matches: grasp"):
        agent.do("gasp", "apple")
    with pytest.raises(UnknownNameError, match="no robot is named 'fetch'"):
        simulation.robots["fetch"]


def test_robots_without_hands_and_scenes_without_robots_say_so(tiny_home, tiny_home_folder):
    with pytest.raises(PlanningError, match="motion of the hands of robot 'turtlebot' cannot be planned"):
        _ = simulation_of(tiny_home_folder, TurtleBot().at(-1.4, -1.2, 0.0)).agent
    with pytest.raises(EngineError, match="without robots"):
        _ = ig2mj.Simulation(tiny_home).agent
