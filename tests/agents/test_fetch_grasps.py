"""Fetch takes objects by its two fingers."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from robot_world import GraspingWorld, can

from ig2mj.agents import Fetch

BESIDE_TABLE = {"pos": (0.3, 0.85, 0.0), "quat": (np.sqrt(0.5), 0.0, 0.0, -np.sqrt(0.5))}
"""It faces the table, the can 0.65 m ahead."""


def apart(world: GraspingWorld) -> float:
    """m between the two anchors of the constraint."""
    return float(world.grasping._distance(world.view, world.grasps)[0, 0])


def fingers_around_the_can(home, **options) -> GraspingWorld:
    world = GraspingWorld(home, Fetch(**BESIDE_TABLE), **options)
    world.gripper_to(can(world) + np.array([0, 0, 0.2]), 25, gripper=1.0)
    world.gripper_to(can(world) + np.array([0, 0, 0.045]), 12, gripper=1.0)
    return world


@pytest.mark.slow
def test_fetch_holds_what_its_closing_fingers_touch_and_carries_it(tiny_home_folder):
    world = fingers_around_the_can(tiny_home_folder)
    assert world.held == [None]
    robots, core = world.simulation.robots, world.simulation.core
    action = np.zeros((1, 11), np.float32)
    action[0, -1] = -1.0
    ctrl, controllers = core.controls.act(action, world.view, robots.controllers)
    world.simulation.batch = dataclasses.replace(world.simulation.batch, controllers=controllers)
    for _ in range(15):
        before = can(world)
        world.simulation.step(np.asarray(ctrl)[0])
        if world.held[0]:
            break
    assert world.held == ["can"]
    assert apart(world) < 1e-4, "the constraint begins at the present pose"
    assert np.linalg.norm(can(world) - before) < 2e-3
    before, anchors = can(world), []
    for _ in range(15):
        world.step()
        anchors.append(apart(world))
    assert max(anchors) < 2.5e-3, "what the fingers' speed makes of it"
    assert np.linalg.norm(can(world) - before) < 3e-3
    assert world.proprioception()["grasp_0"] == 1
    world.act(times=12, eef_z=1.0, gripper=-1.0)
    assert world.held == ["can"] and can(world)[2] > before[2] + 0.1
    world.act(times=3, gripper=1.0)
    assert world.held == [None]


def test_fetch_lifts_by_friction_alone(tiny_home_folder):
    world = fingers_around_the_can(tiny_home_folder, mode="physical")
    before = can(world)
    world.act(times=6, gripper=-1.0)
    world.act(times=12, eef_z=1.0, gripper=-1.0)
    assert world.held == [None] and not np.asarray(world.view.held).any()
    assert can(world)[2] > before[2] + 0.1
    world.act(times=4, gripper=1.0)
    assert can(world)[2] < before[2] + 0.05, "and drops it"


@pytest.mark.slow
def test_an_open_mitten_of_fetch_sticks(tiny_home_folder):
    world = GraspingWorld(tiny_home_folder, Fetch(**BESIDE_TABLE), mode="mitten", targets=["can"])
    start = can(world)
    world.gripper_to(start + np.array([0, 0, 0.2]), 25, gripper=1.0)
    assert world.held == [None]
    world.gripper_to(start + np.array([0.05, 0, 0.03]), 12, gripper=1.0)
    assert world.held == ["can"]
    world.act(times=8, eef_z=1.0, gripper=1.0)
    assert can(world)[2] > start[2] + 0.05


@pytest.mark.slow
def test_what_is_held_goes_along_when_fetch_drives(tiny_home_folder):
    world = fingers_around_the_can(tiny_home_folder)
    world.act(times=4, gripper=-1.0)
    world.act(times=8, eef_z=1.0, gripper=-1.0)
    before, base = can(world), world.body("fetch").copy()
    world.act(times=8, forward=-0.3, gripper=-1.0)
    assert world.held == ["can"]
    moved = world.body("fetch") - base
    assert moved[1] > 0.15
    assert can(world) - before == pytest.approx(moved, abs=0.03)
