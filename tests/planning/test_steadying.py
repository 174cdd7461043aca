"""A light container is held by one hand while the other opens it or puts something into it."""

import types

import numpy as np
import pytest

import ig2mj
from ig2mj.agents.humanoid import Humanoid
from ig2mj.geometry.poses import matrices_on_host
from ig2mj.planning.clearance import Obstacles
from ig2mj.planning.domain import Domain
from ig2mj.planning.steadying import is_thrown_over, past_hand
from ig2mj.planning.world import PlannedWorld
from ig2mj.states.model import StateModel

JAR, STANDS = "jar_0", 0.99


class _World(PlannedWorld):
    """A robot with two hands, of which the second rests at (0, 0, 1), in a scene at its start."""

    def __init__(self, scene, opening=None):
        simulation = ig2mj.Simulation(scene)
        hands = types.SimpleNamespace(hand_spheres=lambda fingers, palm: np.array([[0.0, 0.0, 0.1, 0.05]]))
        self.body = types.SimpleNamespace(opening=opening, hands=np.arange(2), hand_spheres=hands.hand_spheres)
        self.domain = Domain(StateModel.of_manifest(scene.tables, scene.manifest), hands=2)
        self.world, self.found = 0, simulation.view

    view = property(lambda self: self.found)  # pyright: ignore
    held = property(lambda self: ["", JAR])  # pyright: ignore

    def hand_axes(self, hand, rotation=None):
        return np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, -1.0])

    def grip(self, hand):
        return np.array([0.0, 0.0, 1.0])


def scene_with(*objects, agents=()):
    return ig2mj.load_scene("small_home", objects=list(objects), agents=list(agents))


def test_what_is_light_and_tall_is_thrown_over_by_a_hand():
    scene = scene_with("jar", "backpack")
    world = _World(scene)
    assert is_thrown_over(world, JAR)
    for name in ("backpack_0", "fridge_0", "plate_0", "bowl_0", ""):
        assert not is_thrown_over(world, name)
    assert not is_thrown_over(_World(scene, opening=0.1), JAR)  # a gripper has no other hand


def test_a_hand_keeps_clear_of_the_other_hand_and_not_of_the_jar_that_this_holds():
    scene = scene_with("jar")
    world = _World(scene)
    everything = range(len(scene.tables.object_names))
    around = past_hand(world, Obstacles(scene, world.view, without=everything), 1)
    assert not around.clear(np.array([[0.0, 0.0, 1.14, 0.03]]))
    assert around.clear(np.array([[0.0, 0.0, 1.2, 0.03]]))


def upright(simulation):
    return float(matrices_on_host(np.asarray(simulation.object_pose(JAR)[1], float)[None])[0][2, 2])


@pytest.mark.slow
def test_a_jar_stands_where_it_is_opened_and_filled():
    """Friction of the hinge of its lid is more than what turns the jar over."""
    scene = scene_with("jar", "strawberry", agents=[Humanoid().at(-1.0, 0.0, 0.0)])
    simulation = ig2mj.Simulation(scene, grasping="assisted")
    for name in (JAR, "strawberry_0"):
        assert simulation.set_predicate("on_top", name, "breakfast_table_0")
    simulation.step(count=round(1.0 / scene.model.opt.timestep))
    assert simulation.agent.do("open", JAR).done and simulation.predicate("open", JAR)
    assert upright(simulation) > STANDS
    assert simulation.agent.do("grasp", "strawberry_0").done
    filled = simulation.agent.do("place_inside", "strawberry_0", JAR)
    assert filled.done and upright(simulation) > STANDS, filled
