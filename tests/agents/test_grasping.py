"""Assistive grasping (paper, appendix A.1): what is held, carried and let go of."""

from __future__ import annotations

import pathlib

import jax
import numpy as np
import pytest
from robot_world import FACING_TABLE, GraspingWorld, can, over_the_can, reach
from tiny_home import write_tiny_home

import ig2mj
from ig2mj.agents import FloatingHand, Humanoid
from ig2mj.agents.grasping import Grasping
from ig2mj.errors import EngineError, UnknownNameError

CAN_VOLUME = np.pi * 0.03**2 * 0.12
"""m^3 of the home's can."""


def home_with_can(folder: pathlib.Path, kilograms: float) -> pathlib.Path:
    write_tiny_home(folder)
    text = (folder / "scene.xml").read_text()
    old = 'name="can/collision_0" type="cylinder" size="0.03 0.06" density="300"'
    assert old in text
    (folder / "scene.xml").write_text(text.replace(old, old.replace("300", f"{kilograms / CAN_VOLUME:.1f}")))
    return folder


def energy(world: GraspingWorld, name: str) -> float:
    """J: kinetic energy of an object's main body."""
    import mujoco

    model, data = world.simulation.engine.to_mujoco(world.simulation.physics, 0)
    body, speed = model.body(name).id, np.zeros(6)
    mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_BODY, body, speed, 1)
    return float(0.5 * (model.body_inertia[body] @ speed[:3] ** 2 + model.body_mass[body] * speed[3:] @ speed[3:]))


@pytest.mark.slow
def test_a_hand_takes_hold_when_it_is_more_than_half_closed_and_nothing_jumps(tiny_home_folder):
    world = over_the_can(tiny_home_folder)
    world.act(times=2, right_hand_trigger=0.25)
    assert world.held == [None, None], "half is not enough"
    for _ in range(8):
        before, moving = can(world), energy(world, "can")
        world.act(right_hand_trigger=0.125 if world.held[1] is None else 0)
        if world.held[1]:
            break
    assert world.held == [None, "can"]
    pos, anchors = can(world), []
    for _ in range(15):
        world.step()
        anchors.append(float(world.grasping._distance(world.view, world.grasps)[0, 1]))
        assert energy(world, "can") <= max(moving, 2e-3)
    assert max(anchors) < 1e-3, "the constraint begins at the present pose"
    assert np.linalg.norm(can(world) - pos) < 2e-3
    assert np.linalg.norm(pos - before) < 2e-2
    held = world.view.held[0, :, world.scene.object_index("can")]
    assert held.tolist() == [False, True]
    assert world.proprioception()["right_hand_is_grasping"] == 1
    world.act(right_hand_trigger=-0.5 - 1e-3)
    world.act(times=2)
    assert world.held == [None, None], "half is let go"
    assert not world.view.held.any()


@pytest.mark.slow
def test_what_a_closed_hand_lets_go_is_not_thrown(tiny_home_folder):
    """Fingers that go on to close while contacts are dropped would be inside of it when these come back."""
    world = over_the_can(tiny_home_folder)
    for _ in range(4):
        world.act(right_hand_trigger=1)
    assert world.held == [None, "can"]
    before = can(world)
    world.act(right_hand_trigger=-1)
    world.act(times=5)
    assert world.held == [None, None]
    assert np.linalg.norm(can(world) - before) < 5e-3


@pytest.mark.parametrize("kilograms", [1, pytest.param(7, marks=pytest.mark.slow)])
def test_what_is_not_too_heavy_is_carried(tmp_path, kilograms):
    world = over_the_can(home_with_can(tmp_path, kilograms))
    world.act(right_hand_trigger=1)
    world.act(times=4)
    assert world.held[1] == "can"
    before = can(world)
    reach(world, world.body("humanoid_right_hand"), (0, 0.1, 0.2), 8)
    assert world.held[1] == "can"
    assert can(world) - before == pytest.approx([0, 0.1, 0.2], abs=0.025)
    world.act(times=20)
    assert world.held[1] == "can" and can(world)[2] > before[2] + 0.17


@pytest.mark.slow
def test_forty_kilograms_leave_the_hand_within_a_second(tmp_path):
    """The hand's 300 N are less than the weight, so it stays behind; at 10 cm it lets go."""
    world = over_the_can(home_with_can(tmp_path, 40))
    world.act(right_hand_trigger=1)
    world.act(times=4)
    assert world.held[1] == "can"
    world.act(times=2, right_hand_z=0.08)
    world.act(times=8)
    assert world.held[1] is None
    assert can(world)[2] < 0.6, "it stands on the table"


def test_a_jerk_beyond_what_the_hand_can_follow_breaks_the_grasp(tmp_path):
    world = over_the_can(home_with_can(tmp_path, 7))
    world.act(right_hand_trigger=1)
    world.act(times=4)
    assert world.held[1] == "can"
    world.act(times=3, right_hand_z=0.3, right_hand_x=0.3)
    assert world.held[1] is None


def test_modes_are_of_the_names_that_there_are(tiny_home_folder):
    scene = ig2mj.load_scene(tiny_home_folder, agents=[Humanoid(**FACING_TABLE)])
    with pytest.raises(UnknownNameError, match="assisted"):
        Grasping(scene, "asisted")
    with pytest.raises(UnknownNameError, match="can"):
        Grasping(scene, "mitten", ["cann"])
    plain = ig2mj.load_scene(tiny_home_folder, agents=[FloatingHand()])
    with pytest.raises(EngineError, match="hand_rays"):
        Grasping(plain)
    assert Grasping(plain, "physical").initial(2).body.shape == (2, 1)


def test_a_physical_hand_holds_by_friction_alone(tiny_home_folder):
    world = over_the_can(tiny_home_folder, mode="physical")
    world.act(right_hand_trigger=1)
    world.act(times=3)
    assert world.held == [None, None]
    assert not world.view.held.any()


def test_a_mitten_sticks_to_its_target_at_the_first_touch_for_good(tiny_home_folder):
    world = GraspingWorld(tiny_home_folder, Humanoid(**FACING_TABLE), mode="mitten", targets=["can"])
    world.act(times=2)
    reach(world, can(world), (0, 0.045, 0.2), 5)
    assert world.held == [None, None]
    reach(world, can(world), (0, 0.045, 0.06), 4)
    assert world.held == [None, "can"], "an open hand"
    reach(world, world.body("humanoid_right_hand"), (0, 0, 0.2), 5)
    world.act(times=2, right_hand_trigger=-1)
    assert world.held == [None, "can"]
    assert can(world)[2] > 0.7


@pytest.mark.slow
def test_grasps_are_a_pure_function_of_a_batch(tiny_home_folder):
    world = over_the_can(tiny_home_folder)
    world.act(right_hand_trigger=0.7)
    for _ in range(3):
        world.act()
    view = jax.tree.map(lambda x: np.repeat(np.asarray(x), 3, 0), world.view)
    empty = world.grasping.initial(3)
    grip = np.array([[0, 1], [0, 0.5], [0, 1]], np.float32)
    touched = view.agent.finger_force.copy()
    touched[:] = 0
    can_row = world.scene.tables.graspable_object.tolist().index(world.scene.object_index("can"))
    index_finger = world.scene.tables.finger_hand.tolist().index(1) + 3
    touched[:2, index_finger, can_row] = 5.0
    view = view.replace(agent=view.agent.replace(finger_force=touched))
    after = jax.jit(world.grasping.update)(view, empty, grip, np.zeros((3, 2), np.float32))
    assert np.asarray(after.held)[:, 1].tolist() == [True, False, False], "trigger, then contact"
    assert np.asarray(world.grasping.changed(empty, after)).tolist() == [True, False, False]
    write = world.grasping.write(after)
    assert np.asarray(write.eq_active).sum(1).tolist() == [1, 0, 0]
    assert np.asarray(write.ignored_contacts).sum((1, 2)).tolist() == [1, 0, 0]


@pytest.mark.slow
def test_idle_hands_are_those_that_an_update_would_not_change(tiny_home_folder):
    world = over_the_can(tiny_home_folder)
    grasping, empty = world.grasping, world.grasping.initial(1)
    closed, still = np.array([[1.0, 1.0]], np.float32), np.zeros((1, 2), np.float32)
    assert grasping.idle(world.view, empty)
    assert not np.asarray(grasping.update(world.view, empty, closed, still).held).any()
    touched = np.zeros_like(world.view.agent.finger_force)
    touched[0, 7, 0] = 1.0
    assert not grasping.idle(world.view.replace(agent=world.view.agent.replace(finger_force=touched)), empty)
    world.act(right_hand_trigger=1)
    world.act(times=3)
    assert world.held[1] and not grasping.idle(world.view, world.grasps), "it may be let go of"
