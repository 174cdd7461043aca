"""Batches on a CUDA device (`make test-gpu`): parity, reproducibility, measured buffers, one world of many natively.

Programs are kept by JAX and Warp; with warm caches the file takes a few minutes.
"""

from __future__ import annotations

import dataclasses

import bench_scene
import engine_bench
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import ig2mj
from ig2mj.agents.floating_hand import FloatingHand
from ig2mj.calibration.measuring import calibrate
from ig2mj.calibration.pushing import push, start_pushing
from ig2mj.calibration.reach import find_reach
from ig2mj.engine.health import CAPACITY
from ig2mj.engine.native.sleep import FULLY_AWAKE
from ig2mj.engine.warp.engine import WarpEngine
from ig2mj.sampling.settled import make_pool
from ig2mj.simulation import Simulation
from ig2mj.states.model import StateModel
from ig2mj.worlds import Core, Rules

pytestmark = [pytest.mark.gpu, pytest.mark.timeout(900), pytest.mark.usefixtures("gpu")]

HOME, WORLDS, STEPS = "aspen", 256, 240


@pytest.fixture(scope="module")
def on_gpu(bench_folder, gpu) -> engine_bench.Bench:
    """Table, box and knife in two worlds. Not the session's own bench, which may have been made on the CPU."""
    return engine_bench.Bench(engine_bench.bench_home(bench_folder, True), "warp", 2)


def test_one_step_on_the_gpu_is_one_step_of_c_mujoco(bench_folder, on_gpu):
    """Kinematics to 1e-5 m; velocities to 1e-3 m/s. The knife tips over, the box slides."""
    native = engine_bench.Bench(on_gpu.scene, "native", 2, substeps=1)
    physics = native.write(native.fresh(), native.teleport("knife", [0.02, 0, 0.53], [0.924, 0, 0.3827, 0]))
    physics, _ = native.run(physics, 24)
    row = native.engine.export(physics, 0)
    row.qvel[:2] += [0.3, 0.1]
    physics, expected = native.step(native.fresh(row))
    after, view = on_gpu.physics_step(on_gpu.fresh(row))
    for field in ("body_pos", "body_quat", "object_com", "aabb_low", "aabb_high"):
        np.testing.assert_allclose(getattr(view, field), getattr(expected, field), atol=1e-5, err_msg=field)
    np.testing.assert_array_equal(view.touching, expected.touching)
    got = on_gpu.engine.export(after, 0)
    np.testing.assert_allclose(got.qvel, native.engine.export(physics, 0).qvel, atol=1e-3)


def test_a_weld_toggled_in_one_world_moves_nothing_in_the_others_on_the_gpu(on_gpu):
    start, _ = on_gpu.run(on_gpu.fresh(), 40)
    row = on_gpu.engine.export(start, 0)
    physics = on_gpu.write(on_gpu.fresh(row), on_gpu.switch({"knife/box": [1]}))
    _, welded = on_gpu.run(physics, 10)
    place = np.asarray(welded.object_pos)
    address = on_gpu.scene.model.joint("box/free").qposadr[0]
    assert np.abs(place[0, on_gpu.index("box")] - row.qpos[address : address + 3]).max() < 1e-4
    assert np.abs(place[1] - place[0]).max() > 0.01


def test_a_sleeper_on_the_gpu_wakes_when_something_falls_on_it(on_gpu):
    start, view = on_gpu.run(on_gpu.fresh(), 60)
    assert not np.asarray(view.awake).any()
    row = on_gpu.engine.export(start, 0)
    physics = on_gpu.write(on_gpu.fresh(row), on_gpu.teleport("knife", [0, 0, 0.56], worlds=[0]))
    woke = np.zeros(2, bool)
    for _ in range(10):
        physics, view = on_gpu.step(physics)
        woke |= on_gpu.awake(view, "box")
    assert woke.tolist() == [True, False]
    physics, view = on_gpu.run(physics, 60)
    assert on_gpu.z(view, "box") == pytest.approx(bench_scene.TOP + bench_scene.HALF, abs=2e-3)


# A home with a hand.


@pytest.fixture(scope="module")
def reach():
    return find_reach(ig2mj.load_scene(HOME))


@pytest.fixture(scope="module")
def scene(reach):
    return ig2mj.load_scene(HOME, [FloatingHand(pos=tuple(reach.start))])


@pytest.fixture(scope="module")
def model(scene) -> StateModel:
    return StateModel.of_manifest(scene.tables, scene.manifest)


@pytest.fixture(scope="module")
def pool(scene, model):
    return make_pool(scene, model, 4, share=0.2)


@pytest.fixture(scope="module")
def profile(scene, reach, gpu):
    """Measured natively: what a user without the time for more has."""
    return calibrate(scene, reach, engine="native", rounds=2)


def make(scene, model, pool, profile, count: int) -> Core:
    start = jax.tree.map(lambda a: np.asarray(a[0]), pool.physics)
    engine = WarpEngine(scene, count, profile=profile.for_worlds(count), initial=start)
    return Core(engine, Rules(model), pool)


@pytest.fixture(scope="module")
def batch_of_many(scene, model, pool, profile) -> Core:
    return make(scene, model, pool, profile, WORLDS)


def rollout(worlds: Core, reach, batch, length: int):
    """Control steps with a hand that pushes, in one program; the batch after them, and what was ever flagged."""
    engine = worlds.engine
    seconds = engine.substeps * engine.timestep

    def body(carry, _):
        batch, pusher, com, palm, ever = carry
        pusher = push(reach, pusher, com, palm, batch.world.key, batch.world.step, seconds)
        batch, _ = worlds.step_fn(batch, pusher.ctrl)
        view = batch.world.view
        ever |= batch.world.physics.overflow
        return (batch, pusher, view.object_com, view.agent.base_pos[:, 0], ever), None

    view = batch.world.view
    pusher = start_pushing(reach, engine.num_worlds, engine.host_model.nu)
    carry = (batch, pusher, view.object_com, view.agent.base_pos[:, 0], jnp.zeros(engine.num_worlds, jnp.int32))
    carry = jax.jit(lambda c: jax.lax.scan(body, c, None, length)[0])(carry)
    return carry[0], np.asarray(carry[4])


@pytest.fixture(scope="module")
def pushed(batch_of_many, reach):
    """Eight seconds of pushing in every world."""
    before = batch_of_many.start(seed=7)
    after, overflow = rollout(batch_of_many, reach, before, STEPS)
    return before, after, overflow


def test_measured_buffers_hold_while_hands_push_things_about(pushed, batch_of_many):
    """No overflow, nothing lost its numbers, nothing fell out of the house."""
    before, after, overflow = pushed
    moved = np.abs(np.asarray(after.world.view.object_com) - np.asarray(before.world.view.object_com)).max((1, 2))
    assert (moved > 0.02).mean() > 0.25, "the hands do push"
    assert not (overflow & int(CAPACITY)).any()
    metrics = batch_of_many.metrics(after)
    assert metrics == {
        "episodes": WORLDS,
        "overflow": 0,
        "not_finite": 0,
        "fell": 0,
        "too_fast": 0,
        "wrong_controls": 0,
    }


def test_world_0_is_the_same_among_few_and_among_many(scene, model, pool, profile, reach, batch_of_many, pushed):
    """Streams and starts to the bit; the first second within what a GPU's order of sums does to it.

    Two runs on one device differ too, most after contacts: by 33 mm in the median after two seconds of pushing in
    another home (benchmarks/results/multi_gpu). On an H200 this test, then with a bound of 1e-3, found by world, in
    metres: 1.1e-3 1.2e-3 1.2e-5 6.6e-3 5.4e-5 7.9e-6 1.1e-3 1.1e-3, a median of 1.14e-3. The bound is over four times
    that.
    """
    few = make(scene, model, pool, profile, 8)
    start = few.start(seed=7)
    np.testing.assert_array_equal(start.world.key, np.asarray(pushed[0].world.key)[:8])
    np.testing.assert_array_equal(start.world.view.object_pos, np.asarray(pushed[0].world.view.object_pos)[:8])
    some, _ = rollout(few, reach, start, 30)
    many, _ = rollout(batch_of_many, reach, batch_of_many.start(seed=7), 30)
    apart = np.abs(np.asarray(some.world.view.object_com) - np.asarray(many.world.view.object_com)[:8]).max((1, 2))
    np.testing.assert_array_equal(some.world.key, np.asarray(many.world.key)[:8])
    assert np.median(apart) < 5e-3, f"metres apart, by world: {apart}"


def test_a_world_of_many_goes_on_natively(batch_of_many, pushed, scene):
    """The same world, pulled to C MuJoCo: alike at once, after a step, and in what holds when still."""
    _, after, _ = pushed
    world = WORLDS - 3
    simulation = Simulation.from_snapshot(
        scene,
        batch_of_many.engine.export(after.world.physics, world),
        jax.tree.map(lambda a: np.asarray(a)[world : world + 1], after.world.states),
    )
    there = np.asarray(after.world.view.object_pos)[world]
    np.testing.assert_allclose(simulation.view.object_pos[0], there, atol=1e-5)
    np.testing.assert_array_equal(simulation.view.touching[0], np.asarray(after.world.view.touching)[world])
    clock = np.asarray(batch_of_many.engine.time(after.world.physics))[world]
    assert simulation.time == pytest.approx(float(clock), abs=1e-5) and clock > STEPS / 30 - 1e-3
    ctrl = jnp.asarray(after.world.physics.data.ctrl)
    stepped, _ = jax.jit(batch_of_many.step_fn)(after, ctrl)  # `after` is used by other tests
    view = simulation.step()
    np.testing.assert_allclose(view.object_pos[0], np.asarray(stepped.world.view.object_pos)[world], atol=1e-3)


def test_resets_inside_a_program_put_flagged_worlds_right(batch_of_many, scene):
    """One world in eight has lost an object, half of them one that sleeps; each is flagged, counted, replaced."""
    batch = batch_of_many.start(seed=9)
    engine = batch_of_many.engine
    rows = jax.tree.map(np.array, engine.snapshot(batch.world.physics))
    movable = np.flatnonzero(engine.layout.object_qposadr >= 0)[0]
    drop = np.asarray(batch.world.view.object_com)[::8, movable, 2] - (batch_of_many.starts.floor[movable] - 0.5)
    qpos, asleep = np.array(rows.qpos), np.array(rows.tree_asleep)
    qpos[::8, engine.layout.object_qposadr[movable] + 2] -= drop  # its centre of mass, not its frame
    asleep[::16] = FULLY_AWAKE
    rows = rows.with_whole(qpos=qpos, tree_asleep=asleep)
    physics = jax.jit(engine.load)(batch.world.physics, rows)
    batch = dataclasses.replace(batch, world=dataclasses.replace(batch.world, physics=physics))

    def body(batch, _):
        batch, _ = batch_of_many.step_fn(batch)
        flagged = batch.flags != 0
        return batch_of_many.reset_fn(batch, flagged), flagged

    batch, flagged = jax.jit(lambda b: jax.lax.scan(body, b, None, 3))(batch)
    expected = np.zeros((3, WORLDS), bool)
    expected[0, ::8] = True
    np.testing.assert_array_equal(flagged, expected)
    assert batch_of_many.metrics(batch)["fell"] == WORLDS // 8
    assert np.isfinite(np.asarray(batch.world.view.object_pos)).all()
