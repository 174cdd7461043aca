"""The solver's later iterations for those worlds only that need them: the same motion."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
import warp as wp
from mujoco.mjx.third_party import mujoco_warp

from ig2mj.engine.warp.patches import awake_kernels, pins
from ig2mj.engine.warp.patches.guarded import listed

if pins.mismatches():
    pytest.skip(f"our kernels do not fit: {pins.mismatches()}", allow_module_level=True)

from ig2mj.engine.warp.patches import lanes, stragglers

WORLDS, STEPS = 5, 40
AWAKE = 40  # buffer: over 32, where the blocked factorisation begins, and below the model's 51

BOXES = "".join(
    f'<body pos="{0.1 * k} 0 0.04"><freejoint/><geom type="box" size="0.04 0.04 0.04"/></body>' for k in range(8)
)
SCENE = f"""<mujoco><option timestep="0.00833333" integrator="implicitfast"><flag sleep="enable"/></option>
<worldbody><geom type="plane" size="5 5 1"/>{BOXES}
<body pos="-0.1 0 0.04"><joint name="x" type="slide" axis="1 0 0"/><joint type="slide" axis="0 1 0"/>
<joint axis="0 0 1" frictionloss="0.1"/><geom type="box" size="0.03 0.03 0.03"/></body></worldbody>
<actuator><position joint="x" kp="300" kv="30"/></actuator></mujoco>"""


@wp.kernel
def _double(value: wp.array2d(dtype=float), least: float):
    world, place = wp.tid()
    if value[world, place] < least:
        return
    value[world, place] = 2.0 * value[world, place]


@pytest.mark.parametrize(("slots", "dim"), [(2, (2, 2)), (0, (6, 2))])
def test_a_listed_kernel_goes_through_the_worlds_of_its_list(slots, dim):
    value = wp.array(np.arange(12, dtype=np.float32).reshape(6, 2), dtype=float)
    count, worlds = wp.array([3], dtype=int), wp.array([5, 0, 2, 1, 1, 1], dtype=int)
    wp.launch(listed(_double, slots, f"ig2mj_test_listed_{slots}"), dim=dim, inputs=[count, worlds, value, 1.0])
    assert value.numpy().tolist() == [[0, 2], [2, 3], [8, 10], [6, 7], [8, 9], [20, 22]]


def _pushed(model: mujoco.MjModel, start: mujoco.MjData) -> tuple[np.ndarray, np.ndarray]:
    """Positions and velocities of each step, of worlds in which a box pushes a row of others, each further; and the
    iterations of each step."""
    put = mujoco_warp.put_model(model)
    put.opt.warn_overflow = 0
    data = mujoco_warp.put_data(model, start, nworld=WORLDS, naconmax=400, naccdmax=400, njmax=200, nvmax=AWAKE)
    seen, iterations = [], []
    for step in range(STEPS):
        data.ctrl.assign(np.linspace(0.0, 0.5, WORLDS, dtype=np.float32)[:, None] * min(1.0, 2 * step / STEPS))
        mujoco_warp.step(put, data)
        seen.append(np.concatenate([data.qpos.numpy(), data.qvel.numpy()], axis=1))
        iterations.append(data.solver_niter.numpy().copy())
    return np.array(seen), np.array(iterations)


@pytest.mark.slow
@pytest.mark.parametrize("threads", [lanes.LANES, lanes.WIDE])
def test_worlds_that_take_longer_move_as_they_did_together_with_all_others(monkeypatch, threads):
    model = mujoco.MjModel.from_xml_string(SCENE)
    model.opt.iterations = 12  # on a processor all of them are gone through
    assert model.nv > AWAKE
    start = mujoco.MjData(model)
    mujoco.mj_step(model, start, nstep=240)
    monkeypatch.setattr(stragglers, "SLOTS", 2)
    monkeypatch.setattr(lanes, "WIDE", threads)
    runs = []
    for on in (False, True):
        monkeypatch.setattr(stragglers, "ON", on)
        with awake_kernels():
            runs.append(_pushed(model, start))
    (expected, iterations), (found, same_iterations) = runs
    assert iterations.max() > 3 and (iterations.min(axis=1) < iterations.max(axis=1)).any(), "some take longer"
    if threads == lanes.LANES:
        assert np.array_equal(iterations, same_iterations)
        assert np.array_equal(expected, found)
    else:  # more threads add forces up in another order; what is pushed about later is chaotic
        first = slice(0, 1 + int(np.argmax(iterations.max(axis=1) > 1)))
        assert np.allclose(expected[first, :, : model.nq], found[first, :, : model.nq], atol=1e-5)
        assert abs(int(iterations.sum()) - int(same_iterations.sum())) < 0.1 * iterations.sum()
    assert np.abs(expected[-1] - expected[0]).max() > 0.05
