"""Objects are brought into contact with others, or out of the way."""

import collections
from types import SimpleNamespace

import numpy as np
import pytest

import ig2mj
from ig2mj.agents.humanoid import Humanoid
from ig2mj.planning import primitives, pushing
from ig2mj.planning.moves import tries_left
from ig2mj.planning.pushing import push_aside
from ig2mj.planning.steps import Outcome, Step


def test_a_gripper_tries_again_less_often_what_it_has_tried_in_vain():
    assert [tries_left(8, missed, opening=0.1) for missed in (0, 3, 8, 20)] == [8, 5, 2, 2]
    assert tries_left(4, 9, opening=None) == 4, "a palm has all of its tries"


def test_what_has_no_place_on_the_other_is_put_next_to_it_and_pushed(monkeypatch):
    world = SimpleNamespace(held=["mat_0", ""], facts=SimpleNamespace(holds=lambda *_: gap[0] <= 0.0))
    world.body, world.missed = SimpleNamespace(opening=None), collections.Counter()
    gap, done = [0.6], list[str]()

    def place(predicate, until=""):
        def put(world, step):
            yield from ()
            done.append(step.primitive)
            if predicate == "on_top":
                return Outcome("no_base")
            world.held[0] = ""
            return Outcome()

        return put

    def stroke(world, name, ways, failed):
        yield from ()
        done.append("stroke")
        gap[0] -= 0.4
        return "", 0.4

    monkeypatch.setattr(pushing, "is_graspable", lambda *_: True)
    monkeypatch.setattr(pushing, "place", place)
    monkeypatch.setattr(pushing, "_push_once", stroke)
    monkeypatch.setattr(pushing, "_towards", lambda *_: [(np.array([1.0, 0.0, 0.0]), gap[0])])
    with pytest.raises(StopIteration) as end:
        next(pushing.push(world, Step("push", ("mat_0", "plant_0"))))  # pyright: ignore
    assert done == ["place_on_top", "place_next_to", "stroke", "stroke"]
    assert end.value.value.done and end.value.value.attempts == 2, "strokes that go on are no further tries"


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
