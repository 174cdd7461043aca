"""Doors between rooms that are shut in a robot's way."""

import pytest

import ig2mj
from ig2mj.agents import Humanoid
from ig2mj.agents.turtlebot import TurtleBot

KITCHEN = (-0.975, -2.375, 0.0)

pytestmark = pytest.mark.slow


def test_the_humanoid_opens_the_shut_door_in_its_way():
    scene = ig2mj.load_scene("birch", agents=[Humanoid().at(*KITCHEN)])
    simulation = ig2mj.Simulation(scene, grasping="assisted")
    assert simulation.agent.do("navigate_to", "pillow_1").done


def test_a_robot_without_hands_names_the_shut_door_in_its_way():
    scene = ig2mj.load_scene("birch", agents=[TurtleBot().at(*KITCHEN)])
    outcome = ig2mj.Simulation(scene).agent.do("navigate_to", "pillow_1")
    assert (outcome.reason, outcome.detail) == ("no_path", "door_0 is shut in the way")
