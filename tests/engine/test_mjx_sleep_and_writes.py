"""Writes, sleep, welds and loading: the same on every engine (`ig2mj.engine.base`)."""

from __future__ import annotations

from typing import Any

import bench_scene
import engine_bench
import jax
import numpy as np
import pytest

from ig2mj.engine.base import Engine, Write
from ig2mj.engine.model_fields import ModelFields
from ig2mj.engine.native.engine import NativeEngine
from ig2mj.engine.snapshot import Snapshot
from ig2mj.errors import EngineError, UnknownNameError


@pytest.fixture(scope="module")
def asleep(bench_folder) -> Snapshot:
    """The whole bench after two seconds: everything but the hand sleeps."""
    bench = engine_bench.bench(bench_folder, "native", 2, False)
    physics, view = bench.run(bench.fresh(), 60)
    assert not view.awake.any()
    return bench.engine.export(physics, 0)


def still(bench, before, after, world: int, names: tuple[str, ...]) -> None:
    """Nothing of these objects changed in a world, to the last bit."""
    for name in names:
        for field in ("object_pos", "object_quat"):
            a, b = (np.asarray(getattr(v, field))[world, bench.index(name)] for v in (before, after))
            np.testing.assert_array_equal(a, b)


# Every engine, on table, box and knife.


def test_every_engine_is_an_engine(small):
    assert isinstance(small.engine, Engine)
    assert small.engine.name in ("native", "warp", "jax")


def test_a_teleport_moves_at_once_in_its_world_only(small):
    physics, before = small.run(small.fresh(), 2)
    before = jax.tree.map(np.array, before)
    quat = np.array([0.8, 0.0, 0.6, 0.0])
    physics = small.write(physics, small.teleport("box", [0.1, 0.2, 0.9], quat, worlds=[1]))
    view = small.view(physics)
    assert np.asarray(view.object_pos)[1, small.index("box")] == pytest.approx([0.1, 0.2, 0.9], abs=1e-6)
    assert np.asarray(view.object_quat)[1, small.index("box")] == pytest.approx(quat, abs=1e-6)
    assert small.touches(view, "box", "table").tolist() == [True, False]
    still(small, before, view, 0, small.scene.object_names)
    speed = np.asarray(small.engine.snapshot(physics).qvel)[1, :6]
    assert (speed == 0).all()


def test_a_teleport_normalizes_and_ignores_fixed_objects(small):
    write = small.teleport("knife", [0.3, 0.1, 0.6], [0.0, 3.0, 0.0, 0.0])
    write.object_mask[:, small.index("table")] = True
    view = small.view(small.write(small.fresh(), write))
    assert np.asarray(view.object_quat)[0, small.index("knife")] == pytest.approx([0, 1, 0, 0])
    assert small.z(view, "table") == pytest.approx(bench_scene.TOP - 0.05)


def test_coordinates_are_written_after_teleports(small):
    model = small.scene.model
    address = model.joint("box/free").qposadr[0] + 2
    mask, values = np.zeros((2, model.nq), bool), np.zeros((2, model.nq), np.float32)
    mask[0, address], values[0, address] = True, 1.25
    both = small.teleport("box", [0.1, 0.2, 0.9])
    view = small.view(small.write(small.fresh(), both.replace(qpos_mask=mask, qpos=values)))
    assert small.z(view, "box") == pytest.approx([1.25, 0.9])


def test_a_weld_toggled_in_one_world_moves_nothing_in_the_others(small):
    """Knife and box are 0.3 m apart, and the weld wants the box 0.1 m over the table."""
    start, _ = small.run(small.fresh(), 40)
    row = small.engine.export(start, 0)
    physics = small.write(small.fresh(row), small.switch({"knife/box": [1]}))
    physics, welded = small.run(physics, 10)
    welded = jax.tree.map(np.array, welded)
    _, alone = small.run(small.fresh(row), 10)
    still(small, alone, welded, 0, small.scene.object_names)
    moved = np.abs(np.asarray(welded.object_pos - np.asarray(alone.object_pos))).max((1, 2))
    assert moved[1] > 0.01


def test_the_pose_of_a_weld_is_per_world(small):
    """`eq_data` of each world: the box is held at another distance from the knife."""
    model = small.scene.model
    data = np.tile(model.eq_data.astype(np.float32), (2, 1, 1))
    data[0, 0, 3:6], data[1, 0, 3:6] = [-0.3, 0, 0.03], [-0.35, 0, 0.03]
    physics = small.fresh(small.first)
    physics = small.write(physics, small.switch({"knife/box": [0, 1]}).replace(model_fields=ModelFields(eq_data=data)))
    physics, view = small.run(physics, 30)
    place = np.asarray(view.object_pos)
    apart = place[:, small.index("knife"), 0] - place[:, small.index("box"), 0]
    assert apart == pytest.approx([0.3, 0.35], abs=5e-3)


def test_load_replaces_the_masked_worlds(small):
    high, _ = small.run(small.write(small.fresh(), small.teleport("box", [0, 0, 0.8])), 2)
    rows = small.engine.snapshot(high)
    physics = small.load(small.fresh(), rows, np.array([False, True]))
    view = small.view(physics)
    assert small.z(view, "box")[1] == pytest.approx(0.7755, abs=1e-3)
    assert small.z(view, "box")[0] == pytest.approx(bench_scene.TOP + bench_scene.HALF, abs=1e-4)
    assert np.asarray(small.engine.time(physics)) == pytest.approx([0.0, 2 / 30], abs=1e-5)


@pytest.mark.parametrize("name", ["native", pytest.param("warp", marks=pytest.mark.slow)])
def test_a_world_does_not_depend_on_how_many_there_are(name, bench_folder):
    """Changing the number of worlds does not change world 0. Bitwise on the native engine."""
    native = engine_bench.bench(bench_folder, "native")
    row = native.engine.export(native.write(native.fresh(), native.teleport("knife", [0.02, 0, 0.53])), 0)
    places = []
    for count in (2, 3):
        bench = engine_bench.bench(bench_folder, name, count)
        _, view = bench.run(bench.fresh(row), 20)
        places.append(np.asarray(view.object_pos)[0])
    np.testing.assert_allclose(places[0], places[1], atol=0 if name == "native" else 1e-4, rtol=0)


def test_a_world_is_exported_and_goes_on_natively(small, bench_folder):
    """`engine.export(world)` is how one looks at one of many worlds."""
    physics, _ = small.run(small.write(small.fresh(), small.teleport("box", [0, 0, 0.6])), 3)
    row = small.engine.export(physics, 1)
    assert row.qpos.shape == (small.scene.model.nq,) and isinstance(row.qpos, np.ndarray)
    native = NativeEngine(small.scene, 1)
    there = native.load(native.reset(), row)
    np.testing.assert_allclose(
        native.view(there).object_pos[0], np.asarray(small.view(physics).object_pos)[1], atol=1e-6
    )
    there, _ = native.step(there)
    _, view = small.step(physics)
    np.testing.assert_allclose(native.view(there).object_pos[0], np.asarray(view.object_pos)[1], atol=1e-4)
    assert float(native.time(there)[0]) == pytest.approx(4 / 30, abs=1e-5)


def test_mujoco_gets_a_world_for_pictures(small):
    physics, view = small.run(small.write(small.fresh(), small.teleport("box", [0.1, 0, 0.7], worlds=[1])), 2)
    model, data = small.engine.to_mujoco(physics, 1)
    assert data.body("box").xpos == pytest.approx(np.asarray(view.object_pos)[1, small.index("box")], abs=1e-5)
    assert data.time == pytest.approx(2 / 30, abs=1e-5)
    assert model.nq == small.scene.model.nq


def test_snapshots_of_other_scenes_are_refused(small, bench_folder):
    other = engine_bench.bench(bench_folder, "native", 2, False)
    with pytest.raises(EngineError, match="does not fit scene 'bench': qpos of its scene has shape"):
        small.engine.load(small.fresh(), other.first)
    many = jax.tree.map(lambda a: np.repeat(np.asarray(a)[None], 5, axis=0), small.first)
    with pytest.raises(EngineError, match="5 snapshots do not fit 2 worlds"):
        small.engine.load(small.fresh(), many)


def test_a_world_that_is_not_there(small):
    with pytest.raises((EngineError, IndexError)):
        small.engine.export(small.fresh(), 7)


# The engines that sleep, on the whole bench.


def test_what_sleeps_still_touches(full, asleep):
    """Sleeping pairs have no contacts, so touching is remembered."""
    _, view = full.run(full.fresh(asleep), 2)
    assert not np.asarray(view.awake).any()
    for one, other, touch in [("box", "table", True), ("knife", "table", True), ("box", "knife", False)]:
        assert full.touches(view, one, other).tolist() == [touch] * 2
    assert (np.asarray(view.link_force) == 0).all()


def test_a_write_wakes_what_it_moves_in_its_world(full, asleep):
    physics = full.write(full.fresh(asleep), full.teleport("box", [0, 0, 0.5], worlds=[1]))
    view = full.view(physics)
    assert full.awake(view, "box").tolist() == [False, True]
    assert not full.awake(view, "knife").any()
    _, view = full.run(physics, 2)
    assert full.z(view, "box")[1] < 0.5 - 1e-3, "it falls"
    assert full.z(view, "box")[0] == pytest.approx(bench_scene.TOP + bench_scene.HALF, abs=1e-3)


def test_what_falls_onto_a_sleeper_wakes_it(full, asleep):
    physics = full.write(full.fresh(asleep), full.teleport("knife", [0, 0, 0.56], worlds=[0]))
    woke = np.zeros(2, bool)
    for _ in range(10):
        physics, view = full.step(physics)
        woke |= full.awake(view, "box")
    assert woke.tolist() == [True, False]
    assert full.touches(view, "knife", "box").tolist() == [True, False]


def test_the_hand_wakes_what_it_touches(full, asleep):
    """It is driven down onto the box, in world 1 only."""
    ctrl = np.zeros((2, 3), np.float32)
    ctrl[1, 2] = -0.30
    physics, woke = full.fresh(asleep), np.zeros(2, bool)
    for _ in range(30):
        physics, view = full.step(physics, ctrl)
        woke |= full.awake(view, "box")
    assert woke.tolist() == [False, True]


def test_a_weld_wakes_what_it_holds_and_lifts_it(full, asleep):
    """An awake hand and a sleeping box: only that box, in that world."""
    physics = full.write(full.fresh(asleep), full.switch({"hand/box": [0]}))
    physics, view = full.run(physics, 1)
    assert full.awake(view, "box").tolist() == [True, False]
    assert not full.awake(view, "knife").any()
    _, view = full.run(physics, 30)
    assert full.z(view, "box")[0] > 0.6 and full.z(view, "box")[1] < 0.46
    assert np.asarray(view.held)[:, 0, full.index("box")].tolist() == [True, False]


def test_a_weld_wakes_all_that_sleeps_in_one_island(full):
    """The knife sleeps on the box: to take hold of it wakes both at once, in that world."""
    physics = full.write(full.fresh(), full.teleport("knife", [0, 0, bench_scene.TOP + 0.1205]))
    physics, view = full.run(physics, 90)
    assert not np.asarray(view.awake).any()
    view = full.view(full.write(physics, full.switch({"hand/knife": [1]})))
    for name in ("knife", "box"):
        assert full.awake(view, name).tolist() == [False, True]


@pytest.mark.parametrize("name", [pytest.param(n, marks=pytest.mark.slow) for n in ("warp", "jax")])
def test_constraints_alone_cost_no_forward_pass(name, bench_folder, monkeypatch):
    """In a batch of thousands some hand takes hold nearly every step."""
    bench = engine_bench.bench(bench_folder, name, 2, False)
    engine: Any = bench.engine
    monkeypatch.setattr(engine, "_refresh", lambda physics: pytest.fail("a forward pass"))
    model, count = bench.scene.model, len(bench.scene.object_names)
    data = np.tile(model.eq_data.astype(np.float32), (2, 1, 1))
    taken = bench.switch({"hand/box": [1]}).replace(
        model_fields=ModelFields(eq_data=data), ignored_contacts=np.ones((2, 1, count), bool)
    )
    view = bench.view(jax.jit(lambda physics, write: engine.write(physics, write))(bench.fresh(), taken))
    assert np.asarray(view.held)[:, 0, bench.index("box")].tolist() == [False, True]
    with pytest.raises(pytest.fail.Exception):
        jax.make_jaxpr(lambda p, w: engine.write(p, w))(bench.fresh(), bench.teleport("box", [0, 0, 1]))


def test_what_is_let_go_falls(full, asleep):
    """A held object that is still may be ready to sleep; the end of the weld wakes it."""
    physics = full.write(full.fresh(asleep), full.switch({"hand/box": [0, 1]}))
    physics, held = full.run(physics, 60)
    assert (full.z(held, "box") > 0.6).all()
    held = np.array(full.z(held, "box"))
    physics = full.write(physics, full.switch({"hand/box": [1]}))
    _, view = full.run(physics, 8)
    assert full.z(view, "box")[0] < held[0] - 0.05
    assert full.z(view, "box")[1] == pytest.approx(held[1], abs=2e-3)


def test_split_off_bodies_go_along_with_a_teleport(full, asleep):
    """`Write.object_mask`: bodies that hang on the object by no joint go along rigidly."""
    before = full.view(full.fresh(asleep))
    lid, box = full.scene.model.body("box_lid").id, full.scene.model.body("box").id
    offset = np.asarray(before.body_pos)[0, lid] - np.asarray(before.body_pos)[0, box]
    half_turn = [0.0, 0.0, 0.0, 1.0]
    physics = full.write(full.fresh(asleep), full.teleport("box", [0.1, 0.1, 1.0], half_turn, worlds=[0]))
    place = np.asarray(full.view(physics).body_pos)[:, lid]
    assert place[0] == pytest.approx(np.array([0.1, 0.1, 1.0]) + offset * [-1, -1, 1], abs=1e-4)
    assert place[1] == pytest.approx(np.asarray(before.body_pos)[1, lid])


def test_a_joint_is_written_by_its_coordinate(full, asleep):
    model = full.scene.model
    mask, values = np.zeros((2, model.nq), bool), np.zeros((2, model.nq), np.float32)
    address = model.joint("hatch_hinge").qposadr[0]
    mask[1, address], values[1, address] = True, 0.7
    view = full.view(full.write(full.fresh(asleep), Write(qpos_mask=mask, qpos=values)))
    assert np.asarray(view.joint_pos)[:, 0] == pytest.approx([0.0, 0.7])
    assert full.awake(view, "hatch").tolist() == [False, True]
    assert not full.awake(view, "box").any()


def test_a_write_of_nothing_changes_nothing(full, asleep):
    physics = full.fresh(asleep)
    before = jax.tree.map(np.array, full.view(physics))
    after = full.view(full.write(physics, full.teleport("box", [0, 0, 2], worlds=[])))
    still(full, before, after, 0, full.scene.object_names)
    assert not np.asarray(after.awake).any()


def test_an_engine_is_asked_for_by_name(bench_folder):
    scene = engine_bench.bench_home(bench_folder, True)
    with pytest.raises(UnknownNameError, match="no engine is named 'wrap'; near matches: warp"):
        engine_bench.make_engine("wrap", scene)
    for name in ("native", "warp", "jax"):
        with pytest.raises(EngineError, match="num_worlds = 0: a whole number"):
            engine_bench.make_engine(name, scene, 0)
        with pytest.raises(EngineError, match="there is no box rule 'round'"):
            engine_bench.make_engine(name, scene, 1, boxes="round")
