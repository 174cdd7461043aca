"""Bags are opened by turning them over: their flap falls open, and stays above its hinge."""

import types

import numpy as np
import pytest

import ig2mj
from ig2mj.agents.humanoid import Humanoid
from ig2mj.geometry.poses import matrices_on_host
from ig2mj.planning import turning_open
from ig2mj.planning.turning_open import PARTS, turns
from ig2mj.planning.world import PlannedWorld

UP = np.array([0.0, 0.0, 1.0])
BAG, STANDS = "backpack_0", 0.99


def down(orientation):
    """Where gravity points in the frame of what is turned so."""
    return orientation.T @ -UP


@pytest.mark.parametrize("turn", [1.8, 2.4, 2.9])
def test_a_bag_is_turned_head_down_the_long_way_and_back_over_its_side(turn):
    """The flap is pressed shut until the bag is upside down, and then it follows; over the side, gravity is along its
    hinge, and turns it at no angle."""
    axis = np.array([0.0, -1.0, 0.0])
    found = [down(r) for r in turns(np.eye(3), axis, turn)]
    assert np.allclose(found[0], -UP) and np.allclose(found[-1], -UP)
    over = np.unwrap([np.arctan2(g[2], g[0]) for g in found[: PARTS + 1]])
    assert (np.diff(over) > 0.0).all() and over[-1] == pytest.approx(1.5 * np.pi - turn)
    assert np.allclose([g @ axis for g in found[: PARTS + 1]], 0.0)
    assert abs(found[PARTS + 2] @ axis) == pytest.approx(1.0)
    back = [g - (g @ axis) * axis for g in found[PARTS + 2 :]]
    assert all(np.allclose(np.cross(g, UP), 0.0) and g @ UP < 1e-9 for g in back)


class _World(PlannedWorld):
    """A robot whose hands float, with an apple in one of them."""

    def __init__(self):
        self.body = types.SimpleNamespace(opening=None)

    held = property(lambda self: ["apple", ""])  # pyright: ignore


@pytest.mark.parametrize(("at", "held", "full"), [(0.5, "", True), (0.5, "can", False), (1.5, "", False)])
def test_a_bag_about_a_loose_thing_is_not_empty_whatever_counts_as_inside(at, held, full):
    """What lies in a bag that has fallen over would be thrown out of it."""

    class Around(_World):
        held = property(lambda self: [hand, ""])  # pyright: ignore
        facts = property(lambda self: types.SimpleNamespace(box=lambda name: (np.zeros(3), np.ones(3))))  # pyright: ignore

        def com(self, name):
            return np.full(3, {"can": at, BAG: 0.5}[name])

    hand, world = held, Around()
    world.domain = types.SimpleNamespace(loose=("can", BAG))  # pyright: ignore
    assert turning_open._has_content(world, BAG) == full


def upright(simulation):
    quat = simulation.object_pose(BAG)[1]
    return float(matrices_on_host(np.asarray(quat, float)[None])[0][2, 2])


@pytest.mark.slow
def test_a_backpack_stands_open_after_it_was_turned_over_and_is_filled():
    scene = ig2mj.load_scene("small_home", objects=["backpack"], agents=[Humanoid().at(-1.0, 0.0, 0.0)])
    simulation = ig2mj.Simulation(scene, grasping="assisted")
    simulation.set_object_pose(BAG, (-0.2, 0.3, 0.0))
    simulation.step(count=round(1.0 / scene.model.opt.timestep))
    assert not simulation.predicate("open", BAG)
    opened = simulation.agent.do("open", BAG)
    assert opened.done and simulation.predicate("open", BAG), opened
    assert upright(simulation) > STANDS
    assert np.allclose(simulation.object_pose(BAG)[0][:2], (-0.2, 0.3), atol=0.1)
    assert simulation.agent.do("grasp", "apple_0").done
    put = simulation.agent.do("place_inside", "apple_0", BAG)
    assert put.done and simulation.predicate("inside", "apple_0", BAG), put
