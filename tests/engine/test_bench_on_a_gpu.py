"""A few worlds with two loose objects on a CUDA device (`make test-gpu`): C MuJoCo's step, welds, sleep."""

from __future__ import annotations

import bench_scene
import engine_bench
import numpy as np
import pytest

pytestmark = [pytest.mark.gpu, pytest.mark.timeout(900), pytest.mark.usefixtures("gpu")]


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
