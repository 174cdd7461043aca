"""The kernels put in place of MuJoCo Warp's own give the same results."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from kernel_loading import load_kernels_of
from mujoco.mjx.third_party import mujoco_warp

from ig2mj.engine.warp import patches
from ig2mj.engine.warp.patches import awake_kernels, engine_kernels, pins, table, upstream_kernels
from ig2mj.engine.warp.patches.flags import REPLACED
from ig2mj.engine.warp.patches.replacements import KERNELS

pytestmark = pytest.mark.skipif(bool(pins.obstacles()), reason=f"our kernels do not fit: {pins.obstacles()}")

STEPS = 100
AWAKE = 40  # buffer: over 32, where the blocked factorisation begins, and below the model's 51

ROW = "".join(
    f'<body name="box_{k}" pos="{0.15 * k} 0 0.04"><freejoint/><geom type="box" size="0.04 0.04 0.04"/></body>'
    for k in range(8)
)
SCENE = f"""<mujoco>
<option timestep="0.00833333" integrator="implicitfast"><flag sleep="enable"/></option>
<worldbody><geom type="plane" size="5 5 1"/>{ROW}
<body name="arm" pos="-0.3 0 0.04" gravcomp="1"><joint name="x" type="slide" axis="1 0 0"/><joint name="z" type="slide"
 axis="0 0 1"/><geom type="sphere" size="0.03"/><body pos="0 0 0.1" gravcomp="0.5"><joint name="tip" axis="0 1 0"
 damping="0.01" frictionloss="0.001"/><geom type="capsule" size="0.01 0.03"/></body></body></worldbody>
<actuator><position joint="x" kp="300" kv="30"/><position joint="z" kp="300" kv="30"/></actuator></mujoco>"""


def _roll(model: mujoco.MjModel, start: mujoco.MjData, steps: int = STEPS) -> tuple[np.ndarray, np.ndarray]:
    """An arm pushes towards a row of sleeping boxes in two worlds, in one of them far enough to reach it.

    Positions and velocities after each step [steps, 2, nq + nv], and how much is awake [steps, 2].
    """
    put = mujoco_warp.put_model(model)
    assert put.is_sparse
    put.opt.warn_overflow = 0
    data = mujoco_warp.put_data(model, start, nworld=2, naconmax=128, naccdmax=128, njmax=200, nvmax=AWAKE)
    asleep = data.tree_awake.numpy() == 0
    data.tree_awake.assign(np.where(asleep, REPLACED, 1).astype(np.int32))  # as an engine begins
    load_kernels_of(lambda: mujoco_warp.step(put, data))
    ctrl = np.zeros((2, model.nu), np.float32)
    seen, awake = [], []
    for step in range(steps):
        ctrl[:, 0] = np.array([0.15, 0.6]) * min(1.0, 2 * step / steps)
        data.ctrl.assign(ctrl)
        mujoco_warp.step(put, data)
        seen.append(np.concatenate([data.qpos.numpy(), data.qvel.numpy()], axis=1))
        awake.append(data.nv_awake.numpy().copy())
    assert not data.overflow.numpy().any()
    return np.array(seen), np.array(awake)


@pytest.mark.slow
def test_an_arm_among_sleeping_boxes_moves_as_upstream(kernel_device):
    model = mujoco.MjModel.from_xml_string(SCENE)
    assert model.nv > AWAKE
    start = mujoco.MjData(model)
    mujoco.mj_step(model, start, nstep=240)
    assert start.nv_awake == 3
    with awake_kernels():
        own, awake = _roll(model, start)
    upstream, _ = _roll(model, start)
    assert awake[0].tolist() == [3, 3]
    assert awake[:, 0].max() == 3 and awake[:, 1].max() >= 15, "one arm stops short, the other pushes boxes"
    before, boxes_x = 35, slice(0, 8 * 7, 7)
    assert np.abs(own - upstream)[:before].max() < 1e-4, "until something is hit, rounding only"
    pushed, as_upstream = ((run[-1] - run[0])[1, boxes_x].sum() for run in (own, upstream))
    assert pushed > 0.2 and abs(pushed - as_upstream) < 0.1 * pushed, "the row is pushed as far"
    lift = model.jnt_qposadr[model.joint("z").id]
    assert np.abs(own[:before, :, lift]).max() < 1e-3, "gravity is compensated"


ON_A_GPU = ("branches", "pair_lists", "phases", "resting", "compact_solver")
"""Groups of patches that touch each other most; on a GPU each compiles for a minute."""


@pytest.mark.slow
@pytest.mark.parametrize("group", table.GROUPS)
def test_with_any_group_of_patches_left_out_a_step_is_upstreams(kernel_device, monkeypatch, group):
    from ig2mj.engine.warp.patches import branches, launching, phases, places  # not before: names may not exist

    if kernel_device.is_cuda and group not in ON_A_GPU:
        pytest.skip("compared on a processor")
    assert patches.fit()
    monkeypatch.setenv(table.VARIABLE, f"-{group}")
    table.chosen.cache_clear()
    monkeypatch.setattr(branches, "ON_PROCESSORS", True)
    monkeypatch.setattr(KERNELS, "_own", places.own())
    monkeypatch.setattr(launching, "_substitutes", places.substitutes())
    phases._builder.cache_clear()
    phases.built.cache_clear()
    model = mujoco.MjModel.from_xml_string(SCENE)
    start = mujoco.MjData(model)
    mujoco.mj_step(model, start, nstep=240)
    try:
        with engine_kernels():
            own, _ = _roll(model, start, 50)
    finally:
        monkeypatch.undo()
        table.chosen.cache_clear()
        phases._builder.cache_clear()
        phases.built.cache_clear()
    upstream, _ = _roll(model, start, 50)
    assert np.abs(own - upstream)[:17].max() < 1e-4, "until something is hit, rounding only"
    pushed, as_upstream = ((run[-1] - run[0])[1, 0 : 8 * 7 : 7].sum() for run in (own, upstream))
    assert pushed > 0.1 and abs(pushed - as_upstream) < 0.1 * pushed, "the row is pushed as far"


@pytest.mark.slow
def test_a_world_without_constraints_reads_nothing_that_was_never_written(kernel_device):
    model = mujoco.MjModel.from_xml_string(SCENE.replace('frictionloss="0.001"', ""))
    start = mujoco.MjData(model)
    mujoco.mj_step(model, start, nstep=240)
    put = mujoco_warp.put_model(model)
    for kernels, finite in ((awake_kernels, True), (upstream_kernels, False)):
        data = mujoco_warp.put_data(model, start, nworld=2, naconmax=128, naccdmax=128, njmax=200, nvmax=AWAKE)
        data.cqfrc_constraint.fill_(float("nan"))
        with kernels():
            mujoco_warp.step(put, data)
        assert data.nefc.numpy().tolist() == [0, 0]
        found = np.isfinite(data.qvel.numpy()).all() and np.isfinite(data.qfrc_constraint.numpy()).all()
        assert found == finite, "upstream is sound by now: `constraint_forces` may go" if found else "the world is lost"
