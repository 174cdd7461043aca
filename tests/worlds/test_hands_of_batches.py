"""What hands of a batch hold, where worlds are written to, cut and loaded from outside: world by world."""

from __future__ import annotations

import dataclasses
import functools

import jax
import numpy as np
import pytest
from robot_world import FACING_TABLE, GraspingWorld

from ig2mj.agents import Humanoid
from ig2mj.agents.base import ACTION_PERIOD
from ig2mj.agents.grasping import Grasping
from ig2mj.engine.base import Write
from ig2mj.engine.registry import make_engine
from ig2mj.engine.warp.patches import upstream_kernels
from ig2mj.states.initial import states_of_manifest
from ig2mj.states.model import StateModel
from ig2mj.worlds.core import Core
from ig2mj.worlds.rules import Rules
from ig2mj.worlds.worlds import controllers_of

ENGINES = ["native", pytest.param("warp", marks=pytest.mark.slow)]
RIGHT = "humanoid_right_hand"


@pytest.fixture(scope="module")
def apple_in_hand(tiny_home_folder):
    """A scene, a snapshot of one world in which a sticky right hand holds the apple, and its controllers' memory."""
    world = GraspingWorld(tiny_home_folder, Humanoid(**FACING_TABLE), "sticky")
    world.act(times=2)
    palm, turn = world.body(RIGHT), world.simulation.data.body(RIGHT).xmat.reshape(3, 3)
    tip = turn.T @ (world.body(f"{RIGHT}_middle_middle") - palm)
    world.simulation.set_object_pose("apple", palm + turn @ (tip + np.array([0, 0, -0.045])), (1, 0, 0, 0))
    world.act(times=4, right_hand_trigger=0.25)
    world.act(times=3)
    assert world.held == [None, "apple"]
    return world.scene, world.simulation.engine.export(world.simulation.physics, 0), world.simulation.robots.controllers


@functools.cache
def core_of(scene, engine: str, mode: str = "sticky") -> Core:
    """Two worlds in which any force cuts; made once."""
    model = StateModel.of_manifest(scene.tables, scene.manifest)
    p = model.parameters
    easy = dataclasses.replace(p, slice_force=np.where(np.isfinite(p.slice_force), 0.0, np.inf).astype(np.float32))
    model = dataclasses.replace(model, parameters=easy)
    bodies = {scene.model.body(b).name: b for b in range(scene.model.nbody)}
    rules = Rules(model, initial=states_of_manifest(model, scene.manifest, bodies))
    grasping = Grasping(scene, mode, ["apple"] if mode == "mitten" else ())
    return Core(make_engine(engine, scene, 2), rules, None, controllers_of(scene, ACTION_PERIOD), grasping)


def both_hold(core: Core, row, controllers):
    batch = started(core, row, controllers)
    assert holds(batch) == [True, True]
    return batch


def started(core: Core, row, controllers):
    """Both worlds at a snapshot, with controllers that remember the same."""
    ours = jax.tree.map(lambda a: np.repeat(np.asarray(a), 2, 0), controllers)
    return dataclasses.replace(core.load(core.start(0), row), controllers=ours)


def holds(batch) -> list[bool]:
    return np.asarray(batch.grasps.held)[:, 1].tolist()


def teleport(scene, name: str, pos, world: int, quat=(1, 0, 0, 0)) -> Write:
    mask = np.zeros((2, len(scene.object_names)), bool)
    at, turn = np.zeros((*mask.shape, 3), np.float32), np.zeros((*mask.shape, 4), np.float32)
    k = scene.object_index(name)
    mask[world, k], at[:, k], turn[..., 0], turn[:, k] = True, pos, 1, quat
    return Write(object_mask=mask, object_pos=at, object_quat=turn)


def speeds(batch, scene, *names: str) -> np.ndarray:
    """m/s of the fastest of some objects in each world."""
    rows = [scene.object_index(name) for name in names]
    return np.linalg.norm(np.asarray(batch.world.view.object_linvel)[:, rows], axis=-1).max(1)


@pytest.mark.parametrize("engine", ENGINES)
def test_a_write_ends_the_grasp_of_its_world(apple_in_hand, engine):
    scene, row, controllers = apple_in_hand
    core = core_of(scene, engine)
    batch = both_hold(core, row, controllers)
    batch = core.write(batch, teleport(scene, "apple", (-1.0, 0.5, 1.0), 1))
    assert holds(batch) == [True, False]
    for _ in range(3):
        batch, _ = core.step(batch, np.zeros((2, 28), np.float32))
    assert holds(batch) == [True, False]
    found = speeds(batch, scene, "apple")
    assert found[0] < 0.1 and found[1] == pytest.approx(9.8 / 10, abs=0.1)
    assert not np.asarray(batch.flags).any()


@pytest.mark.slow
@pytest.mark.parametrize("mode", ["sticky", "mitten"])
def test_on_unpatched_mujoco_warp_a_hand_holds_what_it_surrounds(apple_in_hand, mode):
    """Its contacts with the hand are ignored there, too: they would push the apple off."""
    scene, row, controllers = apple_in_hand
    with upstream_kernels():
        core = core_of.__wrapped__(scene, "warp", mode)
    assert not core.engine.own_kernels
    batch = both_hold(core, row, controllers)
    for _ in range(4):
        batch, _ = core.step(batch, np.zeros((2, 28), np.float32))
    assert holds(batch) == [True, True]
    assert speeds(batch, scene, "apple").max() < 0.1
    assert not np.asarray(batch.flags).any()


@pytest.mark.parametrize("engine", ENGINES)
def test_a_cut_within_a_step_ends_the_grasp_of_its_world(apple_in_hand, engine):
    scene, row, controllers = apple_in_hand
    core = core_of(scene, engine)
    batch = both_hold(core, row, controllers)
    place = np.asarray(batch.world.view.object_pos)[1, scene.object_index("apple")]
    batch = core.write(batch, teleport(scene, "knife", place + np.array([-0.06, 0.0, 0.05]), 1))
    whole, halves = scene.object_index("apple"), ("apple_half_0", "apple_half_1")
    for _ in range(12):
        batch, _ = core.step(batch, np.zeros((2, 28), np.float32))
        if np.asarray(batch.world.states.sliced)[1, whole]:
            break
    assert np.asarray(batch.world.states.sliced)[:, whole].tolist() == [False, True]
    assert holds(batch) == [True, False], "in the very step of the cut"
    assert np.asarray(batch.world.view.held)[:, 1, whole].tolist() == [True, False]
    for _ in range(5):
        batch, _ = core.step(batch, np.zeros((2, 28), np.float32))
        assert speeds(batch, scene, *halves, "knife")[1] < 4.0
        assert np.linalg.norm(np.asarray(batch.world.view.agent.hand_linvel), axis=-1).max() < 0.5
    assert not np.asarray(batch.flags).any() and holds(batch)[0]


def test_loading_some_worlds_leaves_the_hands_of_the_others_alone(apple_in_hand):
    scene, row, controllers = apple_in_hand
    core = core_of(scene, "native")
    empty = core.engine.export(core.start(0).world.physics, 0)
    batch = both_hold(core, row, controllers)
    batch = dataclasses.replace(batch, grasps=batch.grasps.replace(strain=batch.grasps.strain + 2))
    batch = core.load(batch, empty, mask=np.array([False, True]))
    assert holds(batch) == [True, False]
    assert np.asarray(batch.grasps.strain)[0].tolist() == [2, 2], "what it remembers stays"
    batch = core.load(batch, row, mask=np.array([False, True]))
    assert holds(batch) == [True, True] and np.asarray(batch.grasps.strain)[1].tolist() == [0, 0]


def test_a_snapshot_of_a_hand_that_lets_go_does_not_ignore_contacts_for_good(apple_in_hand):
    """Contacts are dropped for one more step after a hand lets go; a world that is loaded from then ends that, too."""
    scene, row, controllers = apple_in_hand
    core = core_of(scene, "native")
    batch = both_hold(core, row, controllers)
    action = np.zeros((2, 28), np.float32)
    action[:, core.controllers[0].action_names.index("right_hand_trigger")] = -1
    batch, _ = core.step(batch, action)
    assert holds(batch) == [False, False]
    snapshot = core.engine.export(batch.world.physics, 0)
    assert snapshot.agents.ignored_contacts.any()
    batch = core.load(core.start(0), snapshot)
    batch, _ = core.step(batch)
    assert not core.engine.export(batch.world.physics, 0).agents.ignored_contacts.any()


def test_a_mitten_whose_grasp_a_loaded_world_lacks_waits_for_the_end_of_the_contact(apple_in_hand):
    scene, row, controllers = apple_in_hand
    core = core_of(scene, "native", "mitten")
    batch = both_hold(core, row, controllers)
    qpos = np.array(row.qpos)
    qpos[scene.model.joint("apple/free").qposadr[0] + 2] -= 0.023  # it lies on the fingers
    without = row.with_whole(eq_active=np.zeros_like(row.eq_active), qpos=qpos)
    without = dataclasses.replace(
        without,
        agents=dataclasses.replace(without.agents, ignored_contacts=np.zeros_like(without.agents.ignored_contacts)),
    )
    fresh = started(core, without, controllers)
    fresh, _ = core.step(fresh)
    assert holds(fresh) == [True, True], "that touches it for the first time"
    batch = core.load(both_hold(core, row, controllers), without, mask=np.array([False, True]))
    assert holds(batch) == [True, False]
    batch, _ = core.step(batch)
    touching = np.asarray(batch.world.view.agent.touching)[:, 0, scene.object_index("apple")]
    assert touching[1] and holds(batch) == [True, False]
