"""Fields of the model that differ per world: every world moves as a world alone whose scene has them."""

from __future__ import annotations

import copy
import dataclasses

import bench_scene
import engine_bench
import jax
import mujoco
import numpy as np
import pytest

from ig2mj.engine.base import Write
from ig2mj.engine.model_fields import MASSES, ModelFields, given, with_masses
from ig2mj.engine.native.engine import NativeEngine
from ig2mj.engine.registry import make_engine
from ig2mj.errors import EngineError, UnknownNameError

FIELDS = (*MASSES, "geom_friction", "cam_pos")

STEPS = 15


@pytest.fixture(scope="module", params=["native", *(pytest.param(n, marks=pytest.mark.slow) for n in ("warp", "jax"))])
def bench(request, bench_folder) -> engine_bench.Bench:
    """Two worlds of table, box and knife whose masses, friction and cameras are their own."""
    return engine_bench.Bench(engine_bench.bench_home(bench_folder, True), request.param, 2, model_fields=FIELDS)


def differing(model: mujoco.MjModel) -> ModelFields:
    """In world 1 the box is ten times as heavy and slips, and the camera stands higher."""
    mass = np.tile(model.body_mass, (2, 1))
    friction = np.tile(model.geom_friction, (2, 1, 1)).astype(np.float32)
    camera = np.tile(model.cam_pos, (2, 1, 1)).astype(np.float32)
    mass[1, model.body("box").id] *= 10
    friction[1, :, 0] = 0.05
    camera[1, :, 2] += 0.5
    return dataclasses.replace(with_masses(model, mass), geom_friction=friction, cam_pos=camera)


def shoved(bench) -> engine_bench.Snapshot:
    """The box slides into the knife at 1.5 m/s."""
    row = bench.first
    qvel = np.array(row.qvel)
    qvel[0] = 1.5
    return row.with_whole(qvel=qvel)


def alone(scene, fields: ModelFields, world: int, row) -> np.ndarray:
    """Positions [T, O, 3] on a native engine of one world whose scene has the fields of a world."""
    model = copy.copy(scene.model)
    for name in ("body_mass", "body_inertia", "geom_friction"):
        getattr(model, name)[:] = getattr(fields, name)[world]
    mujoco.mj_setConst(model, mujoco.MjData(model))
    engine = NativeEngine(dataclasses.replace(scene, model=model))
    physics, seen = engine.load(engine.reset(), dataclasses.replace(row, model_fields=ModelFields())), []
    for _ in range(STEPS):
        physics, view = engine.step(physics)
        seen.append(np.asarray(view.object_pos)[0])
    return np.array(seen)


def positions(bench, physics) -> np.ndarray:
    """[T, W, O, 3]"""
    seen = []
    for _ in range(STEPS):
        physics, view = bench.step(physics)
        seen.append(np.asarray(view.object_pos))
    return np.array(seen)


def test_masses_and_friction_of_each_world_act_as_in_a_world_alone(bench):
    """Engines differ by centimetres after the impact (12 and 36 mm were seen on two processors), the two worlds by more
    than ten."""
    fields, row = differing(bench.scene.model), shoved(bench)
    physics = bench.load(bench.fresh(), bench.every(row))
    found = positions(bench, bench.write(physics, Write(model_fields=fields)))
    box, knife = bench.index("box"), bench.index("knife")
    for world in (0, 1):
        expected = alone(bench.scene, fields, world, row)
        np.testing.assert_allclose(found[:, world], expected, atol=1e-6 if bench.engine.name == "native" else 0.05)
    away = found[-1, :, :, 0] - found[0, :, :, 0]
    assert away[1, box] > away[0, box] + 0.1 and away[1, knife] > away[0, knife] + 0.1


def test_they_are_kept_by_snapshots_and_replaced_by_those_without(bench):
    fields = differing(bench.scene.model)
    physics = bench.write(bench.fresh(), Write(model_fields=fields))
    row = bench.engine.export(physics, 1)
    np.testing.assert_allclose(row.model_fields.body_mass, given(fields)["body_mass"][1], rtol=1e-6)
    back = bench.load(bench.fresh(), bench.every(row))
    for world in (0, 1):
        kept = bench.engine.export(back, world).model_fields
        jax.tree.map(np.testing.assert_array_equal, kept, row.model_fields)
    plain = bench.every(dataclasses.replace(row, model_fields=ModelFields()))
    own = bench.engine.export(bench.engine.load(back, plain), 1).model_fields
    np.testing.assert_allclose(own.body_mass, bench.scene.model.body_mass, rtol=1e-6)


def test_a_world_in_mujocos_structures_has_its_own_fields(bench):
    fields = differing(bench.scene.model)
    physics = bench.write(bench.fresh(), Write(model_fields=fields))
    for world in (1, 0):
        model, _ = bench.engine.to_mujoco(physics, world)
        np.testing.assert_allclose(model.cam_pos, given(fields)["cam_pos"][world], rtol=1e-6)
        np.testing.assert_allclose(model.body_mass, given(fields)["body_mass"][world], rtol=1e-6)


def test_what_was_not_named_is_refused(bench_folder):
    scene = engine_bench.bench_home(bench_folder, True)
    fields = differing(scene.model)
    engine = make_engine("native", scene, 2)
    with pytest.raises(EngineError, match=r"one body_mass for all worlds .*model_fields="):
        engine.write(engine.reset(), Write(model_fields=fields))
    own = make_engine("native", scene, 2, model_fields=FIELDS)
    physics = own.write(own.reset(), Write(model_fields=fields))
    with pytest.raises(EngineError, match="make the engine with model_fields"):
        engine.load(engine.reset(), own.snapshot(physics))
    with pytest.raises(EngineError, match=r"geom_friction has shape \(1,"):
        own.write(physics, Write(model_fields=ModelFields(geom_friction=given(fields)["geom_friction"][:1])))
    with pytest.raises(EngineError, match="with_masses"):
        own.write(physics, Write(model_fields=ModelFields(body_mass=fields.body_mass)))
    with pytest.raises(UnknownNameError, match="geom_margin"):
        make_engine("native", scene, 1, model_fields=["geom_margin"])
    with pytest.raises(EngineError, match="masses are changed together"):
        make_engine("native", scene, 1, model_fields=["body_mass"])
    with pytest.raises(EngineError, match="must be positive"):
        with_masses(scene.model, np.zeros((1, scene.model.nbody)))


def test_a_sleeping_box_wakes_where_its_friction_changes(bench_folder):
    scene = engine_bench.bench_home(bench_folder, True)
    bench = engine_bench.Bench(scene, "native", 2, model_fields=["geom_friction"])
    physics, view = bench.run(bench.fresh(), 60)
    assert not bench.awake(view, "box").any()
    friction = np.tile(scene.model.geom_friction, (2, 1, 1))
    friction[1, :, 0] = 1.0
    physics = bench.write(physics, Write(model_fields=ModelFields(geom_friction=friction)))
    assert bench.awake(bench.view(physics), "box").tolist() == [False, True]
    assert bench.z(bench.view(physics), "box") == pytest.approx(bench_scene.TOP + bench_scene.HALF, abs=1e-3)
