"""Faults of iGibson that show in a whole world (docs/design/rules.md); the others are tested with their state."""

from __future__ import annotations

import functools

import jax
import numpy as np
import pytest

import ig2mj
from ig2mj.agents.floating_hand import add_floating_hand


@pytest.fixture
def world(tiny_home) -> ig2mj.Simulation:
    return ig2mj.Simulation(tiny_home)


def test_what_the_agent_sees_can_be_asked_before_the_first_step(tiny_home_folder):
    above_the_box = functools.partial(add_floating_hand, pos=(0.1, 0.0, 1.5))  # its camera looks straight down
    world = ig2mj.Simulation(ig2mj.load_scene(tiny_home_folder, agents=[above_the_box]))
    assert world.predicate("in_fov_of_agent", "box")
    assert not world.predicate("in_fov_of_agent", "ball")  # on the floor, 1.5 m to the side


def test_setting_a_sliced_object_works_and_sets_its_halves(world):
    world.set_state("sliced", "apple", True)
    world.set_state("frozen", "apple", True)
    assert world.predicate("frozen", "apple")
    assert world.predicate("frozen", "apple_half_0") and world.predicate("frozen", "apple_half_1")


def test_contacts_of_sleeping_objects_are_kept(world):
    world.step(count=150)
    assert not world.view.awake[0, world.scene.object_index("box")]
    assert world.predicate("in_contact_with", "box", "table")
    world.set_object_pose("box", (0.1, 0.0, 0.9))
    assert not world.predicate("in_contact_with", "box", "table")


def test_predicates_of_a_restored_world_are_those_of_its_own_state(world, tmp_path):
    world.save(tmp_path / "before.npz")
    assert world.predicate("on_top", "box", "table")
    world.set_object_pose("box", (-1.0, 0.5, 0.05))
    world.step()
    assert not world.predicate("on_top", "box", "table")
    world.load(tmp_path / "before.npz")
    assert world.predicate("on_top", "box", "table")


def test_two_runs_are_the_same(tiny_home):
    ends = []
    for _ in range(2):
        world = ig2mj.Simulation(tiny_home, seed=7)
        world.set_state("frozen", "apple", True)
        world.set_state("dusty", "table", True)
        world.set_state("toggled_on", "sink", True)
        world.step(count=8)
        ends.append(world.states)
    for a, b in zip(*map(jax.tree.leaves, ends), strict=True):
        assert np.array_equal(np.asarray(a), np.asarray(b), equal_nan=True)


def test_fixed_objects_have_their_own_pose(world):
    # The cabinet and the table are part of the house, and still have poses and centres of mass of their own.
    view = world.view
    for name, place in (("table", (0, 0)), ("cabinet", (1.5, 0)), ("stove", (0, 1.6))):
        assert np.allclose(view.object_com[0, world.scene.object_index(name), :2], place, atol=0.1)
    assert world.predicate("inside", "book", "cabinet")
