"""Objects are brought into contact with others."""

import pytest

import ig2mj
from ig2mj.agents.humanoid import Humanoid


@pytest.mark.slow
def test_what_a_hand_can_take_is_put_onto_the_other_object(tiny_home_folder):
    scene = ig2mj.load_scene(tiny_home_folder, agents=[Humanoid().at(-1.4, -1.2, 0.0)])
    simulation = ig2mj.Simulation(scene, grasping="assisted")
    assert not simulation.predicate("in_contact_with", "apple", "stove")
    outcome = simulation.agent.do("push", "apple", "stove")
    assert outcome.done and simulation.predicate("in_contact_with", "apple", "stove"), outcome
