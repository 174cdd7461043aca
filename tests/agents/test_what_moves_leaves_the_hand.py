"""What moves by other means than physics leaves the hand that holds it: nothing is flung, and all stays finite.

One world of the native engine; `tests/worlds/test_hands_of_batches.py` has batches and the other engines.
"""

from __future__ import annotations

import pathlib

import mujoco
import numpy as np
import pytest
from robot_world import FACING_TABLE, GraspingWorld, can

import ig2mj
from ig2mj.agents import Humanoid

RIGHT = "humanoid_right_hand"
MODES = ("sticky", pytest.param("assisted", marks=pytest.mark.slow), pytest.param("mitten", marks=pytest.mark.slow))
HALVES = ("apple_half_0", "apple_half_1")
CALM = 2.5
"""m/s: no more than what falls for a quarter of a second."""


def in_hand(home, mode: str, name: str, above: float) -> GraspingWorld:
    """The right hand holds an object that was put into it."""
    world = GraspingWorld(home, Humanoid(**FACING_TABLE), mode, targets=[name] if mode == "mitten" else ())
    world.act(times=2)
    palm, turn = world.body(RIGHT), world.simulation.data.body(RIGHT).xmat.reshape(3, 3)
    tip = turn.T @ (world.body(f"{RIGHT}_middle_middle") - palm)
    world.simulation.set_object_pose(name, palm + turn @ (tip + np.array([0, 0, above])), (1, 0, 0, 0))
    for _ in range(12):
        world.act(right_hand_trigger=0.0 if mode == "mitten" else 0.25)
        if world.held[1]:
            break
    world.act(times=3)
    assert world.held == [None, name]
    return world


@pytest.fixture(scope="module")
def file_of_grasp(tiny_home_folder, tmp_path_factory) -> pathlib.Path:
    """A world in which the right hand holds the apple."""
    world = in_hand(tiny_home_folder, "sticky", "apple", -0.045)
    file = tmp_path_factory.mktemp("held") / "world.npz"
    world.simulation.save(file)
    return file


@pytest.fixture(scope="module", params=MODES)
def apple_in_hand(request, tiny_home_folder, file_of_grasp):
    """A world of each mode, and that file."""
    targets = ["apple"] if request.param == "mitten" else ()
    return GraspingWorld(tiny_home_folder, Humanoid(**FACING_TABLE), request.param, targets=targets), file_of_grasp


@pytest.fixture
def holding(apple_in_hand) -> GraspingWorld:
    world, file = apple_in_hand
    world.simulation.load(file)
    assert world.held == [None, "apple"]
    return world


def speed(world: GraspingWorld, *names: str) -> float:
    """m/s of the fastest of some objects."""
    rows = [world.scene.object_index(name) for name in names]
    return float(np.linalg.norm(np.asarray(world.view.object_linvel)[0, rows], axis=-1).max())


def hand_speed(world: GraspingWorld) -> float:
    return float(np.linalg.norm(np.asarray(world.view.agent.hand_linvel)[0], axis=-1).max())


def grasp_constraints(world: GraspingWorld) -> int:
    return int(world.simulation.data.eq_active.sum())


def test_what_is_put_elsewhere_is_let_go_at_once_and_falls(holding):
    simulation = holding.simulation
    hand = holding.body(RIGHT)
    simulation.set_object_pose("apple", (-1.0, 0.5, 1.0))
    assert holding.held == [None, None] and grasp_constraints(holding) == 0
    assert not holding.view.held.any() and not simulation.predicate("in_hand_of_agent", "apple")
    assert speed(holding, "apple") == 0
    for k in range(6):
        holding.step()
        assert simulation.object_pose("apple")[0][:2] == pytest.approx([-1.0, 0.5], abs=1e-3)
        assert speed(holding, "apple") == pytest.approx(9.8 * (k + 1) / 30, abs=0.05)
        assert hand_speed(holding) < 0.2
    assert np.linalg.norm(holding.body(RIGHT) - hand) < 0.02


def test_a_cut_apple_leaves_the_hand_and_its_halves_are_not_flung(holding):
    holding.simulation.set_state("sliced", "apple", True)
    assert holding.held == [None, None] and grasp_constraints(holding) == 0
    for _ in range(6):
        holding.step()
        assert np.isfinite(holding.simulation.data.qvel).all()
        assert speed(holding, *HALVES) < CALM and hand_speed(holding) < 0.5
    assert "apple" not in holding.held
    assert holding.simulation.object_pose("apple")[0][0] > 20, "the whole is parked"


def test_a_knife_cuts_what_is_held_as_a_setter_does(holding):
    """The rule's own cut, within a step: the blade comes down with more than 10 N."""
    simulation = holding.simulation
    place, slicer = simulation.object_pose("apple")[0], np.array([0.06, 0.0, 0.0])
    simulation.set_object_pose("knife", place - slicer + [0, 0, 0.05], (1, 0, 0, 0))
    adr = simulation.model.joint("knife/free").dofadr[0]
    for _ in range(20):
        simulation.data.qvel[adr + 2] = -3.0
        holding.step()
        if simulation.state("sliced", "apple"):
            break
    assert simulation.state("sliced", "apple")
    assert "apple" not in holding.held
    for _ in range(6):
        assert speed(holding, *HALVES, "knife") < 6.0
        holding.step()
    assert np.isfinite(simulation.data.qvel).all()


def test_what_is_sampled_elsewhere_is_let_go_and_the_robot_stays_where_it_is(holding):
    simulation = holding.simulation
    palm = holding.body(RIGHT)
    assert simulation.set_predicate("on_top", "apple", "cabinet"), simulation.last_sampling
    assert holding.held == [None, None] and grasp_constraints(holding) == 0
    holding.act(times=3)
    assert simulation.predicate("on_top", "apple", "cabinet")
    assert speed(holding, "apple") < 0.05 and hand_speed(holding) < 0.2
    assert np.linalg.norm(holding.body(RIGHT) - palm) < 0.05, "controllers remember their targets"


def test_a_reset_empties_the_hand_and_a_restored_world_brings_its_grasp(apple_in_hand):
    world, file = apple_in_hand
    world.simulation.load(file)
    world.simulation.reset()
    assert world.held == [None, None] and grasp_constraints(world) == 0
    empty = file.with_name("empty.npz")
    world.simulation.save(empty)
    world.simulation.load(file)
    assert world.held == [None, "apple"] and grasp_constraints(world) == 1
    world.act(times=2)
    assert world.held == [None, "apple"] and speed(world, "apple") < 0.1
    world.simulation.load(empty)
    assert world.held == [None, None] and grasp_constraints(world) == 0
    world.act()
    assert np.isfinite(world.simulation.data.qvel).all() and speed(world, "apple") < 0.1


def test_a_joint_of_the_robot_that_is_set_takes_the_hand_away_from_what_it_held(holding):
    simulation = holding.simulation
    height = simulation.object_pose("apple")[0][2]
    simulation.set_joint(f"{RIGHT}_z", simulation.joint(f"{RIGHT}_z") + 0.3)
    assert holding.held == [None, None] and grasp_constraints(holding) == 0
    holding.step()
    assert speed(holding, "apple") < 0.5 and simulation.object_pose("apple")[0][2] <= height + 0.01


def test_a_hand_that_is_reset_leaves_what_it_held(holding):
    """A hand beyond its reach jumps back; the apple does not fly after it."""
    simulation = holding.simulation
    simulation.set_joint(f"{RIGHT}_x", simulation.joint(f"{RIGHT}_x") + 0.9)
    simulation.set_object_pose("apple", holding.body(RIGHT) + np.array([0, 0, -0.3]))
    simulation.robots.act(right_hand_reset=1)
    assert holding.held[1] is None
    assert speed(holding, "apple") < CALM and np.isfinite(simulation.data.qvel).all()


def test_what_somebody_moves_in_mujocos_own_data_is_let_go_when_the_view_is_brought_up_to_date(holding):
    simulation = holding.simulation
    simulation.forward()
    assert holding.held == [None, "apple"], "nothing has moved"
    adr = simulation.model.joint("apple/free").qposadr[0]
    simulation.data.qpos[adr : adr + 3] = (-1.0, 0.5, 1.0)
    simulation.forward()
    assert holding.held == [None, None] and grasp_constraints(holding) == 0
    holding.step()
    assert speed(holding, "apple") < 0.5


def test_moving_one_thing_keeps_another_in_the_hand(holding):
    holding.simulation.set_object_pose("box", (-1.0, -0.5, 0.5))
    holding.simulation.set_joint("cabinet_door_hinge", 0.5)
    holding.simulation.set_state("open", "cabinet", True)
    holding.simulation.set_state("temperature", "apple", 80.0)
    assert holding.held == [None, "apple"] and grasp_constraints(holding) == 1


def test_a_closed_sticky_hand_takes_hold_again_of_what_is_put_back_into_it(tiny_home_folder):
    world = in_hand(tiny_home_folder, "sticky", "can", -0.05)
    place = can(world)
    world.simulation.set_object_pose("can", place + np.array([-1.0, 0, 0]))
    world.step()
    assert world.held == [None, None]
    world.simulation.set_object_pose("can", place)
    world.act()
    assert world.held == [None, "can"]


@pytest.mark.slow
def test_a_mitten_takes_hold_again_only_after_the_contact_has_ended(tiny_home_folder):
    world = in_hand(tiny_home_folder, "mitten", "can", -0.05)
    simulation = world.simulation
    place = can(world)
    simulation.set_object_pose("can", place)  # where it is: the hand still touches it
    assert world.held == [None, None]
    gravity = simulation.model.opt.gravity.copy()
    simulation.model.opt.gravity[:] = 0  # it stays in the hand
    touched = []
    for _ in range(6):
        world.step()
        touched.append(bool(np.asarray(world.view.agent.touching)[0, 0, world.scene.object_index("can")]))
        if not touched[-1]:
            break
        assert world.held == [None, None]
    assert touched[0]
    simulation.model.opt.gravity[:] = gravity
    simulation.set_object_pose("can", place + np.array([-1.0, 0, 0.3]))
    world.step()
    assert world.held == [None, None]
    simulation.set_object_pose("can", place)
    world.step()
    assert world.held == [None, "can"], "a new touch"


def test_a_door_that_is_set_open_leaves_the_hand_and_the_drawer_beside_it_does_not(tiny_home_folder):
    scene = ig2mj.load_scene(tiny_home_folder, agents=[Humanoid(pos=(0.75, 0.12, 0.6))])
    simulation = ig2mj.Simulation(scene, grasping="sticky")
    names = [simulation.model.equality(e).name for e in range(simulation.model.neq)]
    door = names.index(f"{RIGHT}/grasp/cabinet_door")
    model, data = simulation.model, simulation.data
    # A connect whose anchors are where both bodies are now.
    bodies = [model.body(name).id for name in (RIGHT, "cabinet_door")]
    eq_data = np.array(model.eq_data[:, :11])
    eq_data[door, :3] = 0
    back, turn = np.zeros(3), np.zeros(4)
    mujoco.mju_negPose(back, turn, data.xpos[bodies[1]], data.xquat[bodies[1]])
    at = np.zeros(3)
    mujoco.mju_rotVecQuat(at, data.xpos[bodies[0]], turn)
    eq_data[door, 3:6] = at + back
    row = simulation.engine.export(simulation.physics, 0)
    whole = np.array(row.whole("eq_data"))
    whole[door, :11] = eq_data[door]
    active = np.array(row.whole("eq_active"))
    active[door] = True
    simulation.physics = simulation.engine.load(simulation.physics, row.with_whole(eq_active=active, eq_data=whole))
    assert simulation.robots.holding[RIGHT] == "cabinet"
    simulation.set_joint("cabinet_drawer_slide", 0.1)
    assert simulation.robots.holding[RIGHT] == "cabinet"
    simulation.set_joint("cabinet_door_hinge", 0.8)
    assert simulation.robots.holding[RIGHT] is None
    simulation.step()
    assert simulation.joint("cabinet_door_hinge") == pytest.approx(0.8, abs=0.05)
