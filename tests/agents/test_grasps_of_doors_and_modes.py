"""Grasping's other modes and constraints: sticky hands, drawers and doors by a connect, two agents, saved and loaded
grasps, batches on both engines."""

from __future__ import annotations

import dataclasses

import jax
import numpy as np
import pytest
from robot_world import FACING_TABLE, GraspingWorld, over_the_can

import ig2mj
from ig2mj.agents import Fetch, Humanoid
from ig2mj.agents.grasping import Grasping
from ig2mj.errors import ActionError, EngineError

AT_CABINET = {"pos": (0.75, 0.12, 0.6)}
"""It faces the cabinet; the right hand is in front of the drawer."""


@pytest.fixture(scope="module")
def at_cabinet(tiny_home_folder) -> GraspingWorld:
    return GraspingWorld(tiny_home_folder, Humanoid(**AT_CABINET), mode="sticky")


def press_forward(world: GraspingWorld, times: int = 10) -> None:
    """The right hand comes forward, and closes when a finger presses on something."""
    for _ in range(times):
        pressed = float(np.asarray(world.view.agent.finger_force).sum()) > 0
        world.act(right_hand_x=0.0 if pressed else 0.05, right_hand_trigger=0.6 if pressed else 0.0)
        if world.held[1]:
            return


@pytest.mark.parametrize(
    ("joint", "height"),
    [pytest.param("cabinet_drawer_slide", 0.6, marks=pytest.mark.slow), ("cabinet_door_hinge", 0.25)],
)
def test_a_sticky_hand_pulls_open_what_it_closes_on(at_cabinet, joint, height):
    """By a connect (iGibson's point-to-point constraint): the link turns freely about the point where it is held."""
    world = at_cabinet
    world.simulation.reset()
    world.act(body_z=height - 0.6, times=1)
    world.act(right_hand_y=-0.15 if "door" in joint else 0.0, times=2)
    press_forward(world)
    assert world.held[1] == "cabinet"
    row = world.scene.tables.graspable_body[int(np.asarray(world.grasps.body)[0, 1])]
    assert world.scene.model.body(int(row)).name == joint.rsplit("_", 1)[0]
    active = np.flatnonzero(world.simulation.data.eq_active)
    assert [int(world.scene.model.eq_type[e]) for e in active] == [0], "a connect"
    start = world.simulation.joint(joint)
    world.act(times=6, right_hand_x=-0.025)
    assert world.held[1] == "cabinet"
    assert world.simulation.joint(joint) > start + 0.1
    assert world.simulation.predicate("in_hand_of_agent", "cabinet")
    assert world.simulation.predicate("open", "cabinet")
    world.act(right_hand_trigger=-1)
    world.act(times=2)
    assert world.held == [None, None]


@pytest.mark.slow
def test_a_sticky_hand_needs_no_rays_and_an_assisted_one_does(tiny_home_folder, at_cabinet):
    """The front of a drawer is before the fingers, not between them and the palm."""
    assisted = Grasping(at_cabinet.scene, "assisted")
    world = at_cabinet
    world.simulation.reset()
    press_forward(world)
    assert world.held[1] == "cabinet"
    view, empty = world.view, assisted.initial(1)
    closed, still = np.array([[0.0, 1.0]], np.float32), np.zeros((1, 2), np.float32)
    force = np.zeros_like(view.agent.finger_force)
    row = world.scene.tables.graspable_joint.tolist().index(0)
    force[0, np.flatnonzero(world.scene.tables.finger_hand == 1)[2], row] = 5.0
    touched = view.replace(agent=view.agent.replace(finger_force=force))
    assert np.asarray(world.grasping.update(touched, empty, closed, still).held).tolist() == [[False, True]]
    assert not np.asarray(assisted.update(touched, empty, closed, still).held).any()


def test_grasps_are_saved_restored_and_reset(at_cabinet, tmp_path):
    world = at_cabinet
    world.simulation.reset()
    press_forward(world)
    assert world.held[1] == "cabinet"
    world.simulation.save(tmp_path / "held.npz")
    world.act(times=3, right_hand_x=-0.03)
    place = world.simulation.joint("cabinet_drawer_slide")
    world.simulation.reset()
    assert world.held == [None, None]
    world.act(times=2)
    assert not world.view.held.any()
    world.simulation.load(tmp_path / "held.npz")
    assert world.held[1] == "cabinet"
    world.act(times=3, right_hand_x=-0.03)
    assert world.simulation.joint("cabinet_drawer_slide") == pytest.approx(place, abs=1e-6)
    row = world.simulation.engine.export(world.simulation.physics, 0)
    other = ig2mj.Simulation.from_snapshot(world.scene, row, grasping="sticky")
    held = other.robots.held
    assert held is not None
    for name in ("body", "held"):
        assert np.asarray(getattr(held, name)).tolist() == np.asarray(getattr(world.grasps, name)).tolist()
    np.testing.assert_allclose(held.local, world.grasps.local, atol=1e-6)


@pytest.mark.slow
def test_two_agents_in_one_home_hold_and_touch_for_themselves(tiny_home_folder):
    fetch = Fetch(pos=(0.75, -0.6, 0.0), quat=(0.0, 0.0, 0.0, 1.0))
    world = GraspingWorld(tiny_home_folder, Humanoid(**FACING_TABLE), mode="sticky", others=(fetch,))
    simulation = world.simulation
    assert list(simulation.robots.holding) == ["humanoid_left_hand", "humanoid_right_hand", "fetch_gripper_link"]
    assert len(simulation.robots.action_names) == 28 + 11
    simulation.set_object_pose("box", world.body("fetch_gripper_link") - [0, 0, 0.02])
    simulation.robots.act(gripper=-1.0)
    simulation.robots.act(count=4, gripper=-1.0)
    assert simulation.robots.holding["fetch_gripper_link"] == "box"
    assert simulation.predicate("in_hand_of_agent", "box")
    assert not simulation.predicate("in_contact_with", "box", "humanoid")
    assert np.asarray(world.view.held)[0, :, world.scene.object_index("box")].tolist() == [False, False, True]
    before = np.array(simulation.object_pose("box")[0])
    simulation.robots.act(count=5, gripper=-1.0, eef_z=1.0, right_hand_z=0.05)
    assert simulation.object_pose("box")[0][2] > before[2] + 0.03
    assert simulation.predicate("in_contact_with", "floor", "fetch")
    assert not simulation.predicate("in_contact_with", "floor", "humanoid")


def test_actions_are_checked(at_cabinet, tiny_home):
    robots = at_cabinet.simulation.robots
    with pytest.raises(ActionError, match="shape"):
        robots.act(np.zeros(3))
    with pytest.raises(ActionError, match="finite"):
        robots.act(right_hand_x=np.nan)
    with pytest.raises(ActionError, match="right_hand_q"):
        robots.act(right_hand_q=1.0)
    with pytest.raises(ActionError, match="real numbers"):
        robots.act(["far"] * 28)
    with pytest.raises(EngineError, match="without robots"):
        ig2mj.Simulation(tiny_home).robots.act()
    with pytest.raises(EngineError, match="targets"):
        ig2mj.Worlds(at_cabinet.scene, grasping="mitten", engine="native")


def test_actions_beyond_their_limits_are_clipped(at_cabinet):
    """As in `Environment.step`, however large they are."""
    simulation, ends = at_cabinet.simulation, []
    high, low = simulation.robots.action_high, simulation.robots.action_low
    assert high.shape == (28,) and (low < 0).all() and (high > 0).all()
    assert high[simulation.robots.action_names.index("right_hand_x")] == pytest.approx(0.3)
    for action in (high, 1000 * high, np.full(28, 1e300)):
        simulation.reset()
        ends.append(np.asarray(simulation.robots.act(action).body_pos))
    for named in (low[20], -5.0, -1e300):
        simulation.reset()
        ends.append(np.asarray(simulation.robots.act(right_hand_x=float(named)).body_pos))
    for k in (1, 2):
        assert np.array_equal(ends[k], ends[0]) and np.array_equal(ends[3 + k], ends[3])
    assert not np.array_equal(ends[0], ends[3])


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["native", pytest.param("warp", marks=pytest.mark.slow)])
def test_a_batch_takes_hold_world_by_world(tiny_home_folder, engine):
    """Two worlds go on from one state in which a hand is over the can; only in one it is told to close."""
    start = over_the_can(tiny_home_folder)
    row = start.simulation.engine.export(start.simulation.physics, 0)
    worlds = ig2mj.Worlds(start.scene, 2, engine, grasping="assisted")
    batch = worlds.core.load(worlds.start(0), row)
    ours = jax.tree.map(lambda a: np.repeat(np.asarray(a), 2, 0), start.state)
    batch = dataclasses.replace(batch, controllers=(ours,))
    names = start.controller.action_names
    action = np.zeros((2, len(names)), np.float32)
    action[1, names.index("right_hand_trigger")] = 0.2
    held = []
    for _ in range(15):
        batch, _ = worlds.step(batch, action)
        held.append(np.asarray(batch.world.view.held)[:, 1, start.scene.object_index("can")].tolist())
        assert np.asarray(batch.grasps.held)[:, 1].tolist() == held[-1]
    assert held[-1] == [False, True]
    action[:, names.index("right_hand_trigger")] = 0.0
    action[:, names.index("right_hand_z")] = 0.02
    for _ in range(8):
        batch, _ = worlds.step(batch, action)
    height = np.asarray(batch.world.view.object_pos)[:, start.scene.object_index("can"), 2]
    assert height[1] > height[0] + 0.05
    again = worlds.core.load(batch, jax.tree.map(np.asarray, worlds.engine.snapshot(batch.world.physics)))
    assert np.asarray(again.grasps.held)[:, 1].tolist() == [False, True]
    reset = worlds.reset(again, np.array([False, True]))
    assert not np.asarray(reset.grasps.held).any() and not np.asarray(reset.world.view.held).any()
