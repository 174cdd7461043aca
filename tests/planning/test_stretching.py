"""A body that hovers stretches and stoops where a program asks it to, and stays so until another one asks."""

import numpy as np
import pytest

import ig2mj
from ig2mj.agents import Humanoid
from ig2mj.planning import execution
from ig2mj.planning.body_kinds import body_of
from ig2mj.planning.clearance import Obstacles, hand_way
from ig2mj.planning.driving import stretch
from ig2mj.planning.phases import Phase, Programs
from ig2mj.sampling.query import SceneQuery


@pytest.fixture(scope="module")
def robot(tiny_home_folder):
    scene = ig2mj.load_scene(tiny_home_folder, agents=[Humanoid().at(-0.45, 0.0, 0.0)])
    controller = scene.agents[0].controller(scene.tables, 0, 0.1)
    return body_of(scene, controller), controller.action_names.index("body_z"), SceneQuery(scene).view


def test_the_body_rises_and_stays_there_in_the_next_program(robot):
    body, height, view = robot
    carry = execution.begin([[stretch(0.2)]])
    action, carry = execution.advance(body, 0, carry, view)
    assert action[0, height] == pytest.approx(0.05) and carry.running.all()
    carry = execution.begin_some(carry, {0: [Phase(hand=0, reset=True)]})
    action, carry = execution.advance(body, 0, carry, view)
    assert action[0, height] == pytest.approx(0.05)


def test_the_body_stays_at_its_height_where_nothing_else_is_asked(robot):
    body, height, view = robot
    carry = execution.begin([[Phase(hand=0, reset=True)]])
    action, _ = execution.advance(body, 0, carry, view)
    assert action[0, height] == pytest.approx(0.0, abs=0.01)
    assert np.isnan(Programs.pack([[Phase()]]).rise).all()


class _Roof(Obstacles):
    """A slab at z = 0 over all points with x above 0, m."""

    def __init__(self):
        pass

    def clear(self, spheres):
        x, _, z, radius = spheres.T
        return not ((x + radius > 0) & (np.abs(z) < radius)).any()


def test_a_hand_goes_level_below_what_is_above_its_goal():
    ball = np.array([[0.0, 0.0, 0.0, 0.05]])
    start, goal = np.array([-0.4, 0.0, 0.4]), np.array([0.3, 0.0, -0.2])
    way = hand_way(_Roof(), ball, start, goal)
    assert way is not None and np.allclose(way, [[-0.4, 0.0, -0.2], goal])
