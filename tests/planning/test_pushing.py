"""Objects are brought into contact with others, or out of the way."""

import numpy as np
import pytest

import ig2mj
from ig2mj.agents.humanoid import Humanoid
from ig2mj.planning import primitives
from ig2mj.planning.pushing import push_aside
from ig2mj.planning.steps import Outcome


@pytest.mark.slow
def test_what_a_hand_can_take_is_put_onto_the_other_object(tiny_home_folder):
    scene = ig2mj.load_scene(tiny_home_folder, agents=[Humanoid().at(-1.4, -1.2, 0.0)])
    simulation = ig2mj.Simulation(scene, grasping="assisted")
    assert not simulation.predicate("in_contact_with", "apple", "stove")
    outcome = simulation.agent.do("push", "apple", "stove")
    assert outcome.done and simulation.predicate("in_contact_with", "apple", "stove"), outcome


@pytest.mark.slow
def test_what_bars_the_way_is_pushed_aside(tiny_home_folder, monkeypatch):
    scene = ig2mj.load_scene(tiny_home_folder, agents=[Humanoid().at(-1.4, -0.2, 0.0)])
    simulation = ig2mj.Simulation(scene, grasping="assisted")
    place = simulation.view.object_com[0, scene.object_index("ball")][:2]

    def aside(world, step):
        done = yield from push_aside(world, step.object, lambda floor: floor.nearest(place, 0.06) is not None)
        return Outcome("" if done else "no_path")

    monkeypatch.setitem(primitives.ACTIONS, "navigate_to", aside)
    assert simulation.agent.do("navigate_to", "ball").done
    assert np.linalg.norm(simulation.view.object_com[0, scene.object_index("ball")][:2] - place) > 0.2
