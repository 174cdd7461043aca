"""`Simulation.set_predicate`: one world is changed so that a predicate holds, or stays as it was."""

from __future__ import annotations

import numpy as np
import pytest

import ig2mj
from ig2mj.errors import StateError, UnknownNameError


@pytest.fixture
def simulation():
    return ig2mj.Simulation("small_home")


def test_a_placement_is_made_true_in_a_running_world(simulation):
    simulation.step(count=10)
    time = simulation.time
    assert not simulation.predicate("on_top", "apple_0", "plate_0")
    assert simulation.set_predicate("on_top", "apple_0", "plate_0", seed=1)
    assert simulation.predicate("on_top", "apple_0", "plate_0")
    assert simulation.time == time
    simulation.step(count=30)
    assert simulation.predicate("on_top", "apple_0", "plate_0")


def test_states_and_joints_are_set_the_same_way(simulation):
    assert simulation.set_predicate("frozen", "fish_0")
    assert simulation.predicate("frozen", "fish_0")
    assert simulation.set_predicate("open", "fridge_0")
    assert simulation.predicate("open", "fridge_0")
    assert simulation.set_predicate("open", "fridge_0", value=False)
    assert not simulation.predicate("open", "fridge_0")


def test_what_cannot_be_done_leaves_the_world_as_it_was(simulation):
    before = np.array(simulation.data.qpos)
    assert not simulation.set_predicate("inside", "plate_0", "mug_0")
    assert sum(simulation.last_sampling.values()) > 0
    assert np.array_equal(simulation.data.qpos, before)


def test_what_can_never_be_is_an_error(simulation):
    with pytest.raises(StateError, match="fixed"):
        simulation.set_predicate("on_top", "fridge_0", "sofa_0")
    with pytest.raises(UnknownNameError, match="near matches"):
        simulation.set_predicate("on_top", "aple_0", "plate_0")
