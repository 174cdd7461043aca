"""Table A.1's predicates about agents, and what agents do to states, with the bodies of all three robots."""

from __future__ import annotations

import dataclasses
import pathlib
from typing import Any

import jax
import numpy as np
import pytest
from robot_world import GraspingWorld
from scipy.spatial.transform import Rotation
from tiny_home import home_manifest, write_tiny_home

import ig2mj
from ig2mj.agents import Fetch, Humanoid, TurtleBot
from ig2mj.errors import Ig2mjError
from ig2mj.scene import manifest as mf

HALF = np.sqrt(0.5)

HEIGHT = {"humanoid": 0.6, "fetch": 0.0, "turtlebot": 0.0}

ROBOTS = {"humanoid": Humanoid, "fetch": Fetch, "turtlebot": TurtleBot}


@pytest.fixture(scope="module")
def home_with_map(tmp_path_factory) -> pathlib.Path:
    """The tiny home with a map: its kitchen is x, y in [-2, 2]."""
    folder = write_tiny_home(tmp_path_factory.mktemp("mapped") / "home")
    room_map = np.zeros((120, 120), np.int16)
    room_map[40:80, 40:80] = 1
    np.savez(
        folder / "rooms.npz",
        format_version=1,
        trav_resolution=0.1,
        room_map=room_map,
        resolution=0.1,
        names=np.array(["kitchen_0"]),
        types=np.array(["kitchen"]),
    )
    manifest = home_manifest()
    manifest.rooms = mf.RoomsEntry(file="rooms.npz", instances={"kitchen_0": mf.RoomEntry("kitchen")})
    mf.save_manifest(manifest, folder / "manifest.json")
    return folder


def standing(home, name: str, x: float, y: float, turn: float = 0.0) -> ig2mj.Simulation:
    """A robot somewhere in the tiny home, turned by so many degrees from x."""
    half = np.radians(turn) / 2
    robot = ROBOTS[name](pos=(x, y, HEIGHT[name]), quat=(np.cos(half), 0.0, 0.0, np.sin(half)))
    simulation = ig2mj.Simulation(ig2mj.load_scene(home, agents=[robot]))
    simulation.step(count=3)
    return simulation


@pytest.mark.parametrize(
    "name", ["humanoid", *(pytest.param(n, marks=pytest.mark.slow) for n in ROBOTS if n != "humanoid")]
)
def test_reach_room_contact_and_field_of_view_of_each_robot(home_with_map, name):
    """In reach: less than 2 m from the base. The ball is at (-1, -1), the cabinet at (1.5, 0)."""
    near = standing(home_with_map, name, -1.0, 0.6, turn=-90.0)
    assert near.predicate("in_reach_of_agent", "ball") and not near.predicate("in_reach_of_agent", "cabinet")
    assert near.predicate("in_same_room_as_agent", "ball")
    assert near.predicate("in_fov_of_agent", "ball")
    assert not near.predicate("in_hand_of_agent", "ball")
    assert near.predicate("in_contact_with", name, "floor") == (name != "humanoid"), "the humanoid floats"
    assert not near.predicate("in_contact_with", "ball", name)
    outside = standing(home_with_map, name, -1.0, -4.0, turn=-90.0)
    assert not outside.predicate("in_same_room_as_agent", "ball")
    assert not outside.predicate("in_reach_of_agent", "ball")
    assert not outside.predicate("in_fov_of_agent", "ball"), "behind it"


@pytest.mark.slow
def test_of_two_agents_in_one_home_either_counts(home_with_map):
    """The humanoid stands before the ball, Fetch before the cabinet, with the can in its gripper."""
    humanoid = Humanoid(pos=(-1.0, 0.6, 0.6), quat=(HALF, 0.0, 0.0, -HALF))
    fetch = Fetch(pos=(0.4, -1.1, 0.0), quat=(np.cos(0.4), 0.0, 0.0, np.sin(0.4)))
    world = GraspingWorld(home_with_map, humanoid, mode="sticky", others=(fetch,))
    simulation = world.simulation
    simulation.step(count=3)
    for name in ("ball", "cabinet"):
        assert simulation.predicate("in_reach_of_agent", name), name
        assert simulation.predicate("in_fov_of_agent", name), name
        assert simulation.predicate("in_same_room_as_agent", name), name
    assert simulation.predicate("in_contact_with", "fetch", "floor")
    assert not simulation.predicate("in_contact_with", "humanoid", "floor")
    with pytest.raises(Ig2mjError, match="of two agents"):
        simulation.predicate("in_contact_with", "humanoid", "fetch")
    put_into_hand(world, "fetch_gripper_link", "can")
    simulation.forward()
    assert simulation.predicate("in_hand_of_agent", "can") and not simulation.predicate("in_hand_of_agent", "ball")
    assert simulation.robots.holding == {
        "humanoid_left_hand": None, "humanoid_right_hand": None, "fetch_gripper_link": "can"
    }  # fmt: skip


def test_a_turtlebot_that_drives_into_a_ball_touches_it(tiny_home_folder):
    simulation = standing(tiny_home_folder, "turtlebot", -1.0, -0.3, turn=-90.0)
    touched = []
    for _ in range(30):
        simulation.robots.act(forward=0.6)
        touched.append(simulation.predicate("in_contact_with", "ball", "turtlebot"))
    assert not touched[0] and any(touched)
    assert simulation.object_pose("ball")[0][1] < -1.05, "and pushes it along"


def nearest_finger(simulation: ig2mj.Simulation, point: np.ndarray) -> float:
    """m from a point to the nearest finger's frame."""
    fingers = np.asarray(simulation.view.agent.finger_pos)[0]
    return float(np.linalg.norm(fingers - point, axis=1).min())


@pytest.mark.parametrize("name", ["humanoid", pytest.param("fetch", marks=pytest.mark.slow)])
def test_a_finger_within_ten_centimetres_of_the_button_flips_it_at_the_fifth_step(tiny_home_folder, name):
    """Table A.4: and flips it back no sooner than after it has left."""
    at = {"humanoid": (-0.78, 1.72), "fetch": (-1.05, 1.73)}[name]
    simulation = standing(tiny_home_folder, name, *at)
    button = np.array([-0.3, 1.6, 0.7])
    move = {"humanoid": {"right_hand_x": 0.01}, "fetch": {"eef_x": 0.2, "eef_z": -0.35}}[name]
    robots, core = simulation.robots, simulation.core
    action = np.zeros((1, len(robots.action_names)), np.float32)
    for key, value in move.items():
        action[0, robots.action_names.index(key)] = value
    near = 0
    for _ in range(120):
        ctrl, controllers = core.controls.act(action, simulation.view, robots.controllers)
        simulation.batch = dataclasses.replace(simulation.batch, controllers=controllers)
        simulation.step(np.asarray(ctrl)[0])
        near = near + 1 if nearest_finger(simulation, button) < 0.1 else 0
        assert simulation.predicate("toggled_on", "stove") == (near >= 5)
        if near == 12:
            break
    assert near == 12


def test_a_turtlebot_has_no_finger_to_press_with(tiny_home_folder):
    simulation = standing(tiny_home_folder, "turtlebot", -0.6, 1.6)
    simulation.robots.act(count=10, forward=0.2)
    assert not simulation.predicate("toggled_on", "stove")
    assert np.asarray(simulation.view.agent.finger_pos).shape == (1, 0, 3)


def put_into_hand(world: GraspingWorld, hand: str, name: str) -> None:
    """Switches on the constraint between a hand and an object as they are now."""
    grasping, tables, robots = world.grasping, world.scene.tables, world.simulation.robots
    number = tables.hand_body.tolist().index(world.scene.model.body(hand).id)
    body = np.full((1, len(tables.hand_body)), -1)
    body[0, number] = tables.graspable_object.tolist().index(world.scene.object_index(name))
    held = grasping.initial(1).replace(body=body, held=body >= 0, local=grasping._parameters(world.view, body))
    engine = world.simulation.engine
    engine.write(world.simulation.physics, jax.tree.map(np.asarray, grasping.write(held)))
    grasps = robots._core.hands.read(world.simulation.physics)
    world.simulation.batch = dataclasses.replace(world.simulation.batch, grasps=grasps)


@pytest.mark.parametrize("name", ["humanoid", pytest.param("fetch", marks=pytest.mark.slow)])
def test_a_held_knife_cuts_the_apple_under_its_blade(tmp_path, name):
    """Table A.4: more than 10 N on the blade. The apple is heavy, so that it does not roll away under it."""
    home = write_tiny_home(tmp_path / "home")
    text, light = (home / "scene.xml").read_text(), 'mesh="apple" density="600"'
    assert light in text
    (home / "scene.xml").write_text(text.replace(light, light.replace("600", "9000")))
    at = {"humanoid": (-0.2, 0.62, 0.62), "fetch": (-0.33, 0.85, 0.0)}[name]
    robot = ROBOTS[name](pos=at, quat=(HALF, 0.0, 0.0, -HALF))
    world = GraspingWorld(home, robot, mode="mitten", targets=["knife"])
    simulation, robots, scene = world.simulation, world.simulation.robots, world.scene
    hand = {"humanoid": "humanoid_right_hand", "fetch": "fetch_gripper_link"}[name]
    ahead = {"humanoid": 0.14, "fetch": 0.03}[name]  # a long lever would turn Fetch's wrist instead of pressing
    simulation.set_object_pose("knife", world.body(hand) + np.array([0, -ahead, -0.12]), (HALF, 0.0, 0.0, -HALF))
    put_into_hand(world, hand, "knife")
    assert robots.holding[hand] == "knife" and simulation.predicate("in_hand_of_agent", "knife")
    blade = scene.model.geom("knife/slicer")
    upright = Rotation.from_quat(np.roll(simulation.object_pose("knife")[1], -1))

    def step_towards(goal: np.ndarray) -> None:
        pos, quat = simulation.object_pose("knife")
        now = pos + Rotation.from_quat(np.roll(quat, -1)).apply(blade.pos)
        turned = Rotation.from_quat(np.roll(world.quat(robot.name), -1)).inv()
        move = np.clip(10 * turned.apply(goal - now), -1, 1)
        prefix, scale = ("right_hand", 0.04) if name == "humanoid" else ("eef", 1.0)
        wish: dict[str, Any] = {f"{prefix}_{a}": float(m * scale) for a, m in zip("xyz", move, strict=True)}
        if name == "fetch":  # an action keeps the orientation of the moment, which the blade's load turns
            turn = turned.apply((upright * Rotation.from_quat(np.roll(quat, -1)).inv()).as_rotvec())
            wish |= {f"eef_r{a}": float(m) for a, m in zip("xyz", np.clip(10 * turn, -1, 1), strict=True)}
        robots.act(**wish)

    def above(height: float) -> np.ndarray:
        return simulation.object_pose("apple")[0] + np.array([0, 0, height])

    for _ in range(30):
        step_towards(above(0.1))
    assert not simulation.predicate("sliced", "apple")
    for k in range(30):
        step_towards(above(0.06 - 0.006 * k))
        if simulation.predicate("sliced", "apple"):
            break
    assert simulation.predicate("sliced", "apple")
    assert robots.holding[hand] == "knife"
