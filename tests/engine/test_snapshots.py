"""Snapshots in two parts: one of the bare scene serves the scene with any robot."""

from __future__ import annotations

import bench_scene
import engine_bench
import jax
import numpy as np
import pytest

import ig2mj
from ig2mj.engine.native.engine import NativeEngine
from ig2mj.engine.snapshot import AXIS, FULLY_AWAKE, closed_circles, woken
from ig2mj.errors import EngineError


def assert_same(one, other) -> None:
    for a, b in zip(jax.tree.leaves(one), jax.tree.leaves(other), strict=True):
        np.testing.assert_allclose(a, b, atol=1e-6)


@pytest.fixture
def bare(full):
    """The bench without its hand, after a second of which the box fell a little: one world."""
    scene = ig2mj.load_scene(full.scene.folder)
    bench = engine_bench.Bench(scene, "native", 1)
    physics = bench.write(bench.fresh(), bench.teleport("box", [0.1, 0.2, bench_scene.TOP + 0.06]))
    physics, _ = bench.run(physics, 30)
    return bench.engine.export(physics, 0)


def test_one_of_the_bare_scene_leaves_the_hand_at_its_start(full, bare):
    physics, _ = full.run(full.fresh(), 10, np.array([[0.2, 0, 0]] * 2, np.float32))
    physics = full.load(physics, full.every(bare))
    row = full.engine.export(physics, 1)
    assert_same(row.scene, bare.scene)
    assert_same(row.agents, full.first.agents)
    _, view = full.run(physics, 3)
    assert np.asarray(view.agent.hand_pos)[:, 0] == pytest.approx(np.array([bench_scene.HAND_START] * 2), abs=1e-3)
    assert full.touches(view, "box", "table").all()


def test_gathered_worlds_are_those_that_are_exported_one_by_one(full):
    physics, _ = full.run(full.fresh(), 10, np.array([[0.2, 0, 0], [0, 0.1, 0]], np.float32))
    tree = {"volume": np.arange(6, dtype=np.float32).reshape(2, 3)}
    rows, volumes = full.engine.gather(physics, tree, [1, 0, 1])()
    for k, world in enumerate([1, 0, 1]):
        assert_same(jax.tree.map(lambda a, k=k: np.asarray(a[k]), rows), full.engine.export(physics, world))
    np.testing.assert_array_equal(volumes["volume"], tree["volume"][[1, 0, 1]])


def test_its_agents_can_be_taken_away(full, bare):
    physics, _ = full.run(full.fresh(), 30)
    row = full.engine.export(physics, 0)
    alone = row.without_agents()
    assert [np.shape(a) for a in jax.tree.leaves(alone)] == [np.shape(a) for a in jax.tree.leaves(bare)]
    engine = NativeEngine(ig2mj.load_scene(full.scene.folder))
    loaded = engine.export(engine.load(engine.reset(), alone), 0)
    np.testing.assert_allclose(loaded.scene.qpos, row.scene.qpos, atol=1e-7)
    assert row.qpos.shape == (full.scene.model.nq,) and alone.qpos.shape == (engine.scene.model.nq,)


def test_other_agents_and_other_scenes_are_told_apart(full, bare):
    engine = NativeEngine(ig2mj.load_scene(full.scene.folder))
    with pytest.raises(EngineError, match=r"of its agents .* `without_agents\(\)`"):
        engine.load(engine.reset(), full.first)
    shorter = bare.replace(scene=bare.scene.replace(qpos=bare.scene.qpos[:-1]))
    with pytest.raises(EngineError, match="qpos of its scene has shape"):
        full.engine.load(full.fresh(), shorter)


def test_mujocos_arrays_are_split_and_joined(full):
    row = full.first
    model = full.scene.model
    sizes = {"qpos": model.nq, "qvel": model.nv, "ctrl": model.nu, "eq_active": model.neq, "tree_asleep": model.ntree}
    assert {name: row.whole(name).shape[0] for name in sizes} == sizes
    again = row.with_whole(**{name: row.whole(name) for name in AXIS})
    assert_same(again, row)
    moved = row.with_whole(qpos=row.qpos + 1)
    np.testing.assert_array_equal(moved.agents.qpos, row.agents.qpos + 1)


def test_what_slept_with_an_agent_wakes_without_it(full):
    row = full.first
    trees = len(row.scene.tree_asleep)
    asleep = np.array(row.scene.tree_asleep)
    asleep[:3] = [1, trees, 2]  # 0 -> 1 -> the agent's tree; 2 sleeps alone
    woken = row.replace(scene=row.scene.replace(tree_asleep=asleep)).without_agents().scene.tree_asleep
    assert (woken[:2] < 0).all() and woken[2] == 2


def test_the_first_world_is_where_reset_puts_one(full):
    row, view = full.engine.first_world()
    assert_same(row, full.first)
    seen = jax.tree.map(lambda a: np.asarray(a[:1]), full.view(full.fresh()))
    for name in ("object_pos", "object_quat", "aabb_low", "aabb_high", "object_com"):
        np.testing.assert_allclose(getattr(view, name), getattr(seen, name), atol=1e-5)


@pytest.mark.parametrize(
    ("given", "closed"),
    [
        ([0, 2, 1, -3], [0, 2, 1, -3]),
        ([1, -5, 2, 3], [FULLY_AWAKE, -5, 2, 3]),
        ([1, 2, 1, 3], [FULLY_AWAKE, FULLY_AWAKE, FULLY_AWAKE, 3]),
        ([2**31 - 1, 1, -(2**31), 0], [FULLY_AWAKE, 1, FULLY_AWAKE, FULLY_AWAKE]),
    ],
)
def test_trees_of_open_circles_of_sleep_are_awake(given, closed):
    both = np.array([given, [0, 1, 2, 3]], np.int32)
    assert closed_circles(both).tolist() == [closed, [0, 1, 2, 3]]
    assert closed_circles(np.zeros((2, 0), np.int32)).shape == (2, 0)


def test_a_tree_that_is_woken_wakes_its_island_alone():
    circles = np.array([[1, 2, 0, 4, 3, -2], [0, 2, 1, 3, 5, 4]], np.int32)
    found = woken(circles, np.array([1, 5]))
    awake = FULLY_AWAKE
    assert found.tolist() == [[awake, awake, awake, 4, 3, awake], [0, awake, awake, 3, awake, awake]]
    assert circles[0, 0] == 1, "what is given stays as it is"
