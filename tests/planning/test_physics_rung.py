"""Primitives that the humanoid carries out by its own actions, in the tiny home of the tests."""

import numpy as np
import pytest

import ig2mj
from ig2mj.agents.fetch import Fetch
from ig2mj.agents.humanoid import Humanoid
from ig2mj.agents.turtlebot import TurtleBot
from ig2mj.errors import EngineError, UnknownNameError
from ig2mj.planning import BatchAgent, PlanningError


def simulation_of(folder, robot, **options):
    return ig2mj.Simulation(ig2mj.load_scene(folder, agents=[robot]), **options)


def done(simulation, *requests):
    """Carries out primitives, and asserts that each succeeds."""
    for request in requests:
        outcome = simulation.agent.do(*request.split())
        assert outcome.done, f"{request}: {outcome}"


@pytest.mark.slow
def test_the_humanoid_puts_an_apple_on_the_table_and_switches_a_stove_on(tiny_home_folder):
    simulation = simulation_of(tiny_home_folder, Humanoid().at(-1.4, -1.2, 0.0), grasping="assisted")
    done(simulation, "grasp apple", "place_on_top apple table", "toggle_on stove")
    assert simulation.predicate("on_top", "apple", "table") and simulation.predicate("toggled_on", "stove")
    assert simulation.agent.facts.held == ()
    assert "no hand holds apple" in simulation.agent.do("place_inside", "apple", "cabinet").detail


@pytest.mark.slow
def test_the_humanoid_wipes_dust_off_a_table(tiny_home_folder):
    simulation = simulation_of(tiny_home_folder, Humanoid().at(-1.4, -1.2, 0.0), grasping="assisted")
    simulation.set_state("dusty", "table", True)
    done(simulation, "grasp sponge", "wipe table sponge")
    assert not simulation.predicate("dusty", "table") and simulation.agent.facts.held == ("sponge",)


@pytest.mark.slow
def test_the_humanoid_cuts_an_apple_and_opens_a_cabinet(tiny_home_folder):
    simulation = simulation_of(tiny_home_folder, Humanoid().at(-1.4, -1.2, 0.0), grasping="assisted")
    done(simulation, "grasp knife", "slice apple knife", "release knife", "open cabinet")
    assert simulation.predicate("sliced", "apple") and simulation.predicate("open", "cabinet")


@pytest.mark.slow
def test_fetch_takes_an_apple_in_its_gripper_and_lets_it_go(tiny_home_folder):
    simulation = simulation_of(tiny_home_folder, Fetch().at(-1.4, -1.2, 0.0), grasping="assisted")
    done(simulation, "grasp apple")
    assert simulation.agent.facts.held == ("apple",)
    done(simulation, "release apple")
    assert simulation.agent.facts.held == ()


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


@pytest.mark.slow
def test_a_hand_that_somebody_else_has_moved_goes_back_before_the_robot_goes_on(tiny_home_folder):
    """At rest a hand is at the height of counters: what it holds there would wedge the robot in, and cannot be turned
    next to its body."""
    scene = ig2mj.load_scene(tiny_home_folder, agents=[Humanoid().at(0.3, 0.75, -1.5)])
    agent = BatchAgent.of_scene(scene, 1)
    assert agent.do("grasp", "can")[0].done
    names = agent.rung.stage.controller.action_names
    for _ in range(6):
        agent.rung.stage.act(np.array([[1.0 * name.endswith("_reset") for name in names]], np.float32))
    outcome = agent.do("place_on_top", "can", "stove")[0]
    assert outcome.reason not in ("timeout", "no_path") and outcome.time < 30.0, "a can that falls over may be anywhere"


def test_scenes_without_robots_say_so(tiny_home):
    with pytest.raises(EngineError, match="without robots"):
        _ = ig2mj.Simulation(tiny_home).agent


@pytest.mark.slow
def test_a_robot_without_hands_drives_and_says_what_it_lacks(tiny_home_folder):
    simulation = simulation_of(tiny_home_folder, TurtleBot().at(-1.4, -1.2, 0.0), grasping="assisted")
    with pytest.raises(PlanningError, match="robot 'turtlebot' has no hand: 'grasp' takes one"):
        simulation.agent.do("grasp", "apple")
    done(simulation, "navigate_to stove")
    base = simulation.view.agent.base_pos[0, 0, :2]
    assert ((base - simulation.view.object_com[0, simulation.scene.object_index("stove"), :2]) ** 2).sum() < 1.1**2


@pytest.mark.slow
def test_what_another_robot_holds_is_not_taken_from_it(tiny_home_folder):
    agents = [Humanoid(name="one").at(-1.4, -1.2, 0.0), Humanoid(name="other").at(1.0, -1.4, 0.0)]
    simulation = ig2mj.Simulation(ig2mj.load_scene(tiny_home_folder, agents=agents), grasping="assisted")
    one, other = (simulation.robots[name] for name in ("one", "other"))
    assert one.do("grasp", "apple").done
    outcome = other.do("grasp", "apple")
    assert (outcome.reason, outcome.detail) == ("no_grasp", "apple is held by robot 'one' (let it release it first)")
    assert other.do("toggle_on", "stove").done, "both act in one world"
    assert one.facts.held == ("apple",)
    with pytest.raises(EngineError, match="has 2 robots: name one"):
        _ = simulation.agent


@pytest.mark.slow
def test_a_robot_carries_out_a_primitive_in_all_worlds_of_a_batch(tiny_home_folder):
    agents = [TurtleBot(name="idle").at(1.2, -1.4, 0.0), Humanoid(name="acting").at(-1.4, -1.2, 0.0)]
    scene = ig2mj.load_scene(tiny_home_folder, agents=agents)
    with pytest.raises(UnknownNameError, match="no robot is named 'actin'"):
        BatchAgent.of_scene(scene, 2, "actin")
    agent = BatchAgent.of_scene(scene, 2, "acting")
    outcomes = agent.do("toggle_on", "stove")
    assert len(outcomes) == 2 and all(outcome.done for outcome in outcomes)
    stove = scene.object_index("stove")
    assert agent.rung.stage.states.toggled_on[:, stove].all()
