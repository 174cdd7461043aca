"""Doors between rooms that are shut in a robot's way."""

import pytest

import ig2mj
from ig2mj.agents import Humanoid


@pytest.mark.slow
def test_a_primitive_names_the_shut_door_in_its_way():
    scene = ig2mj.load_scene("birch", agents=[Humanoid().at(-0.975, -2.375, 0.0)])
    simulation = ig2mj.Simulation(scene, grasping="assisted")
    outcome = simulation.agent.do("navigate_to", "pillow_1")
    assert (outcome.reason, outcome.detail) == ("no_path", "door_0 is shut in the way")
