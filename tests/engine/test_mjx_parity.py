"""The three engines agree: one step from the same state stage by stage, one second beside a perturbed shadow, and what
the view says of a settled scene."""

from __future__ import annotations

import bench_scene
import engine_bench
import jax
import mujoco
import numpy as np
import pytest

from ig2mj.engine.health import Overflow
from ig2mj.engine.native.engine import NativeEngine
from ig2mj.engine.registry import make_engine
from ig2mj.engine.snapshot import Snapshot
from ig2mj.predicates.compile import compile_expression
from ig2mj.states.initial import initial_states
from ig2mj.states.model import StateModel

TIPPED = np.array([0.924, 0.0, 0.3827, 0.0])

PURE = [pytest.param("warp", marks=pytest.mark.slow), pytest.param("jax", marks=pytest.mark.slow)]


@pytest.fixture(scope="module")
def native(bench_folder) -> engine_bench.Bench:
    return engine_bench.bench(bench_folder, "native")


@pytest.fixture(scope="module")
def falling(native) -> Snapshot:
    """The knife tips over the edge of the box and turns; the box slides. Everything is awake and in contact."""
    physics = native.write(native.fresh(), native.teleport("knife", [0.02, 0.0, 0.53], TIPPED))
    physics, _ = native.run(physics, 6)
    row = native.engine.export(physics, 0)
    qvel = np.array(row.qvel)
    qvel[:3] += [0.3, 0.1, 0.0]
    return row.with_whole(qvel=qvel, qacc_warmstart=np.zeros_like(qvel))


def one_step(bench, row: Snapshot):
    """Snapshot, view and forces [nv] by name after a single physics step of 1/120 s, of world 0.

    The forces are those of the step: of the state it began with.
    """
    physics, view = bench.physics_step(bench.fresh(row))
    data = physics.data if bench.engine.pure else bench.engine.to_mujoco(physics, 0)[1]
    forces = {name: np.array(getattr(data, name)) for name in FORCES}
    return bench.engine.export(physics, 0), view, {n: f[0] if bench.engine.pure else f for n, f in forces.items()}


FORCES = ("qfrc_bias", "qfrc_passive", "qfrc_actuator", "qfrc_constraint")
"""Generalised forces of a step: gravity and gyroscopy, damping, motors, contacts and welds."""


@pytest.fixture(scope="module")
def native_single(native) -> engine_bench.Bench:
    """Native, with control steps of one physics step."""
    single = engine_bench.Bench(native.scene, "native", 2, substeps=1)
    single.physics_step = single.step
    return single


@pytest.mark.parametrize("name", PURE)
def test_one_step_from_the_same_state(name, bench_folder, falling, native_single):
    """Velocities are accelerations times 1/120 s: an error of 0.001 m/s is 0.1 m/s^2, of contacts of 100 and more.
    MJX-JAX finds other points where an edge lies on a face, so it is given more."""
    slack = {"warp": 1e-3, "jax": 2e-2}[name]
    expected, wanted_view, _ = one_step(native_single, falling)
    got, view, _ = one_step(engine_bench.bench(bench_folder, name), falling)
    for field in ("body_pos", "body_quat", "object_com", "aabb_low", "aabb_high", "link_pos"):
        np.testing.assert_allclose(
            getattr(view, field), getattr(wanted_view, field), atol=max(1e-5, slack / 120), err_msg=field
        )
    np.testing.assert_array_equal(view.touching, wanted_view.touching)
    np.testing.assert_array_equal(view.awake, wanted_view.awake)
    np.testing.assert_allclose(got.qvel, expected.qvel, atol=slack)
    assert float(got.time) == pytest.approx(float(expected.time), abs=1e-6)


@pytest.mark.parametrize("name", PURE)
def test_forces_of_one_step_agree_to_a_thousandth(name, bench_folder, native, native_single):
    """Box let go 5 mm over the table, as it is caught: four contacts that every engine finds, and a knife in the air.
    Where objects slide, solvers stop at their tolerance, and forces agree to a few percent (the velocities above)."""
    lifted = native.write(native.fresh(), native.teleport("box", [0, 0, bench_scene.TOP + bench_scene.HALF + 0.005]))
    lifted = native.write(lifted, native.teleport("knife", [0.3, 0.1, 0.9], TIPPED))
    physics, _ = native.run(lifted, 2)
    pressing = native.engine.export(physics, 0)
    _, _, expected = one_step(native_single, pressing)
    _, _, got = one_step(engine_bench.bench(bench_folder, name), pressing)
    assert np.abs(expected["qfrc_constraint"]).max() > 1.0, "the table catches it"
    for field in FORCES:
        largest = max(1.0, np.abs(expected[field]).max())
        np.testing.assert_allclose(got[field], expected[field], atol=1e-3 * largest, err_msg=field)


@pytest.mark.parametrize("name", PURE)
def test_kinematics_agree_to_a_hundredth_of_a_millimetre(name, bench_folder, falling):
    """No step at all: a loaded state has the same poses and boxes on every engine."""
    bench = engine_bench.bench(bench_folder, name)
    other = engine_bench.bench(bench_folder, "native")
    view, expected = bench.view(bench.fresh(falling)), other.view(other.fresh(falling))
    for field in ("object_pos", "object_quat", "object_com", "aabb_low", "aabb_high", "body_pos", "link_pos"):
        np.testing.assert_allclose(getattr(view, field), getattr(expected, field), atol=1e-5, err_msg=field)


@pytest.mark.parametrize("name", PURE)
def test_a_blade_that_falls_presses_alike(name, bench_folder):
    """Largest force of a single contact in a control step, newtons: solvers agree to a few percent at the impact."""
    forces = {}
    for engine in ("native", name):
        bench = engine_bench.bench(bench_folder, engine)
        physics = bench.write(bench.fresh(), bench.teleport("knife", [0.3, 0.0, bench_scene.TOP + 0.06]))
        seen = []
        for _ in range(10):
            physics, view = bench.step(physics)
            seen.append(np.asarray(view.link_force)[:, 0, bench.index("table")])
        forces[engine] = np.array(seen)
        assert (np.asarray(view.link_force)[:, 0, bench.index("box")] == 0).all()
    assert forces["native"].max() > 5.0
    np.testing.assert_allclose(forces[name].max(0), forces["native"].max(0), rtol=0.25)
    assert (np.argmax(forces[name] > 1, 0) == np.argmax(forces["native"] > 1, 0)).all(), "the same control step"


@pytest.fixture(scope="module")
def sliding(native) -> Snapshot:
    """The box is shoved along the table, turning; the knife falls flat and slides on."""
    physics = native.write(native.fresh(), native.teleport("knife", [0.3, 0.1, 0.45]))
    row = native.engine.export(physics, 0)
    qvel = np.array(row.qvel)
    qvel[:6], qvel[6:9] = [-0.8, 0.2, 0.0, 0.0, 0.0, 2.0], [0.3, 0.0, 0.0]
    return row.with_whole(qvel=qvel)


def rollout(bench, row: Snapshot, steps: int) -> np.ndarray:
    """Poses [T, O, 3] of world 0."""
    physics, seen = bench.fresh(row), []
    for _ in range(steps):
        physics, view = bench.step(physics)
        seen.append(np.asarray(view.object_pos)[0])
    return np.array(seen)


@pytest.mark.parametrize("name", PURE)
def test_a_second_stays_beside_a_perturbed_native_shadow(name, bench_folder, sliding):
    """Single precision is a perturbation of 1e-7, contact amplifies it: the engine strays no farther from the native
    one than twice what the native one strays from itself, plus a millimetre for the solvers' own tolerance."""
    native = engine_bench.bench(bench_folder, "native")
    bench = engine_bench.bench(bench_folder, name)
    truth = rollout(native, sliding, 30)
    strays = []
    for seed in range(4):
        noise = np.random.default_rng(seed).normal(size=sliding.qpos.shape) * 1e-6
        shadow = rollout(native, sliding.with_whole(qpos=sliding.qpos + noise), 30)
        strays.append(np.abs(shadow - truth).max())
    off = np.abs(rollout(bench, sliding, 30) - truth).max()
    assert off < 2 * max(strays) + 1e-3


@pytest.fixture(scope="module")
def settled(native) -> Snapshot:
    physics = native.write(native.fresh(), native.teleport("knife", [0.0, 0.0, 0.53]))
    physics, view = native.run(physics, 60)
    assert not view.awake.any()
    return native.engine.export(physics, 0)


PAIRS = ("on_top", "inside", "under", "next_to", "touching")


def everything(scene) -> str:
    """An expression that asks every predicate of two objects of every pair, and `open` of every object that opens."""
    names = scene.object_names
    asked = [f"({p} {a} {b})" for p in PAIRS for a in names for b in names if a != b]
    asked += [f"(open {e.name})" for e in scene.manifest.objects if "openable" in e.abilities]
    return f"(or {' '.join(asked)})"


def truths(bench, row: Snapshot) -> np.ndarray:
    """Truth of every literal after half a second [W, L]."""
    model = StateModel.of_manifest(bench.scene.tables, bench.scene.manifest)
    goal = compile_expression(model, everything(bench.scene))
    _, view = bench.run(bench.fresh(row), 15)
    view = jax.tree.map(np.asarray, view)
    return np.asarray(jax.jit(goal.status)(initial_states(model, bench.num_worlds), view).literals)


@pytest.fixture(scope="module")
def native_truths(native, settled) -> np.ndarray:
    found = truths(native, settled)
    assert 3 <= found[0].sum() < found.shape[1]
    return found


@pytest.mark.parametrize("name", PURE)
def test_predicates_of_a_settled_scene_are_equal(name, bench_folder, settled, native_truths):
    """Knife on box on table."""
    np.testing.assert_array_equal(truths(engine_bench.bench(bench_folder, name), settled), native_truths)


@pytest.mark.slow
def test_predicates_of_the_whole_bench_are_equal(bench_folder):
    """With a lid, a hatch that stands open, and a hand; on the engines that sleep."""
    native = engine_bench.bench(bench_folder, "native", 2, False)
    qpos = np.array(native.first.qpos)
    qpos[native.scene.model.joint("hatch_hinge").qposadr[0]] = 0.9
    physics, _ = native.run(native.fresh(native.first.with_whole(qpos=qpos)), 60)
    row = native.engine.export(physics, 0)
    expected = truths(native, row)
    assert expected[0, -1], "the hatch is open"
    np.testing.assert_array_equal(truths(engine_bench.bench(bench_folder, "warp", 2, False), row), expected)


FLAGS = [(c, i, s) for c in ("pyramidal", "elliptic") for i in ("implicitfast", "Euler") for s in ("enable", "disable")]

MJX_FLAGS = [f[:2] for f in FLAGS if f[2] == "enable"]
"""The MJX engines decide themselves whether objects sleep: always on Warp, never on JAX."""


@pytest.mark.parametrize(("cone", "integrator", "sleep"), FLAGS)
def test_a_box_rests_on_a_table_natively(bench_folder, cone, integrator, sleep):
    rests("native", engine_bench.bench_home(bench_folder, True, cone=cone, integrator=integrator, sleep=sleep))


@pytest.mark.slow
@pytest.mark.parametrize(("cone", "integrator"), MJX_FLAGS)
def test_a_box_rests_on_a_table_on_warp(bench_folder, cone, integrator):
    rests("warp", engine_bench.bench_home(bench_folder, True, cone=cone, integrator=integrator, sleep="enable"))


@pytest.mark.slow
@pytest.mark.parametrize(("cone", "integrator"), MJX_FLAGS)
def test_a_box_rests_on_a_table_on_jax(bench_folder, cone, integrator):
    rests("jax", engine_bench.bench_home(bench_folder, True, cone=cone, integrator=integrator, sleep="disable"))


def rests(name: str, scene) -> None:
    """Let go 2 cm over the table, the box lands and stays. Control steps of one physics step: less to compile."""
    start = NativeEngine(scene)
    physics = start.reset()
    row = start.export(physics, 0)
    height = scene.model.joint("box/free").qposadr[0] + 2
    row.qpos[height] = bench_scene.TOP + 0.07
    row.scene.touching[:] = False
    bench = engine_bench.Bench(scene, name, 1, substeps=1)
    physics, landed = bench.run(bench.fresh(row), 80)
    physics, later = bench.run(physics, 40)
    assert bench.z(later, "box") == pytest.approx(bench_scene.TOP + bench_scene.HALF, abs=2e-3)
    np.testing.assert_allclose(later.object_pos, landed.object_pos, atol=1e-3)
    assert bench.touches(later, "box", "table").all()
    health = bench.engine.health(physics)
    assert np.asarray(health.finite).all() and not np.asarray(health.overflow & ~int(Overflow.ITERATIONS)).any()


def test_a_model_that_mjx_cannot_run_is_an_engine_error(bench_folder):
    """MJX-JAX has no noslip solver; MuJoCo's own has."""
    from ig2mj.errors import EngineError

    scene = engine_bench.bench_home(bench_folder, True, cone="elliptic", integrator="RK4", sleep="disable")
    model = scene.model
    assert model.opt.integrator == mujoco.mjtIntegrator.mjINT_RK4
    model.opt.solver = mujoco.mjtSolver.mjSOL_PGS
    with pytest.raises(EngineError, match="MJX \\(jax\\) cannot run scene 'bench'"):
        make_engine("jax", scene)
