"""A write that moves a hand or what it holds ends the grasp: in that world, on every engine, before anything moves."""

from __future__ import annotations

import bench_scene
import engine_bench
import jax.numpy as jnp
import numpy as np
import pytest

from ig2mj.engine.base import Write
from ig2mj.engine.grasp_release import moved_grasps, without_moved
from ig2mj.engine.layout import make_layout


@pytest.fixture(params=["native", *(pytest.param(n, marks=pytest.mark.slow) for n in ("warp", "jax"))])
def full(request, bench_folder) -> engine_bench.Bench:
    """The whole bench with its hand in two worlds, on each engine in turn."""
    return engine_bench.bench(bench_folder, request.param, 2, False)


@pytest.fixture
def holding(full):
    """The hand holds the box in the air in both worlds, and ignores its contacts."""
    ignored = np.zeros((2, 1, len(full.scene.object_names)), bool)
    ignored[:, 0, full.index("box")] = True
    physics = full.write(full.fresh(), full.switch({"hand/box": [0, 1]}).replace(ignored_contacts=ignored))
    physics, view = full.run(physics, 60)
    assert held(full, view) == [True, True] and (full.z(view, "box") > 0.6).all()
    return physics


def held(full, view, name: str = "box") -> list[bool]:
    return np.asarray(view.held)[:, 0, full.index(name)].tolist()


def ignored(full, physics, name: str = "box") -> list[bool]:
    return np.asarray(full.engine.snapshot(physics).agents.ignored_contacts)[:, 0, full.index(name)].tolist()


def coordinate(full, name: str, value: float) -> Write:
    """A joint's position, in world 1."""
    model = full.scene.model
    mask, qpos = np.zeros((2, model.nq), bool), np.zeros((2, model.nq), np.float32)
    at = model.joint(name).qposadr[0]
    mask[1, at], qpos[1, at] = True, value
    return Write(qpos_mask=mask, qpos=qpos)


def fastest(full, view) -> np.ndarray:
    return np.linalg.norm(np.asarray(view.object_linvel), axis=-1).max(1)


def test_a_teleported_object_is_let_go_in_its_world_alone(full, holding):
    physics = full.write(holding, full.teleport("box", [-1.0, 1.0, 1.0], worlds=[1]))
    view = full.view(physics)
    assert held(full, view) == [True, False] and ignored(full, physics) == [True, False]
    for k in range(6):
        physics, view = full.step(physics, None)
        assert held(full, view) == [True, False]
        speeds = fastest(full, view)
        assert speeds[0] < 0.1 and speeds[1] == pytest.approx(9.8 * (k + 1) / 30, abs=0.05)
        assert np.linalg.norm(np.asarray(view.agent.hand_linvel)[1, 0]) < 0.5, "nothing pulls the hand"
    assert full.z(view, "box")[0] > 0.6


def test_a_hand_that_is_moved_leaves_what_it_held(full, holding):
    before = np.array(full.z(full.view(holding), "box"))
    physics = full.write(holding, coordinate(full, "hand_x", 0.8))
    view = full.view(physics)
    assert held(full, view) == [True, False] and ignored(full, physics) == [True, False]
    _, view = full.step(physics, None)
    assert fastest(full, view)[1] < 0.5
    assert full.z(view, "box")[1] == pytest.approx(before[1], abs=0.01)


def test_one_coordinate_of_a_free_joint_is_enough(full, holding):
    physics = full.write(holding, coordinate(full, "box/free", 1.0))
    assert held(full, full.view(physics)) == [True, False]


def test_a_write_of_something_else_keeps_the_grasp(full, holding):
    for write in (full.teleport("knife", [0.3, 0.2, bench_scene.TOP + 0.02]), coordinate(full, "hatch_hinge", 1.0)):
        holding = full.write(holding, write)
        assert held(full, full.view(holding)) == [True, True] and ignored(full, holding) == [True, True]


def test_who_writes_constraints_decides_what_stays_held(full, holding):
    write = full.teleport("box", [0.0, 0.0, 0.7], worlds=[1]).replace(
        eq_active=full.switch({"hand/box": [0, 1]}).eq_active
    )
    physics = full.write(holding, write)
    assert held(full, full.view(physics)) == [True, True] and ignored(full, physics) == [True, True]


def test_numpy_and_jax_end_the_same_grasps(bench_folder):
    """The rule is one function; random grasps and writes of many worlds."""
    scene, rng, worlds = engine_bench.bench_home(bench_folder, False), np.random.default_rng(0), 64
    model, objects, layout = scene.model, len(scene.object_names), make_layout(scene.model, scene.tables)
    masks = rng.random((worlds, objects)) < 0.2, rng.random((worlds, model.nq)) < 0.05
    active, before = rng.random((worlds, model.neq)) < 0.5, rng.random((worlds, 1, objects)) < 0.5
    found = []
    for xp in (np, jnp):
        moved = moved_grasps(xp, layout, *masks)
        found.append([np.asarray(a) for a in (moved, *without_moved(xp, layout, moved, active, before))])
    for own, other in zip(*found, strict=True):
        assert np.array_equal(own, other)
    moved, kept, still = found[0]
    assert 0 < moved.sum() < moved.size and (still <= before).all()
    assert not kept[:, layout.grasp_equality][moved].any()
    others = np.setdiff1d(np.arange(model.neq), layout.grasp_equality)
    assert np.array_equal(kept[:, others], active[:, others]), "constraints between objects are nobody's grasp"
    assert moved_grasps(np, layout, None, None) is None
