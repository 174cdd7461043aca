"""The solver's loop as one kernel does what MuJoCo Warp's loop does: the same iterations, accelerations and flags."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
import warp as wp
from constraint_rows import Rows, assert_same_rows
from kernel_loading import load_kernels_of
from mujoco.mjx.third_party import mujoco_warp
from mujoco.mjx.third_party.mujoco_warp._src.types import OverflowType

from ig2mj.engine.warp.patches import awake_kernels, pins

pytestmark = [
    pytest.mark.skipif(bool(pins.obstacles()), reason=f"our kernels do not fit: {pins.obstacles()}"),
    pytest.mark.slow,
]

ROW = "".join(
    f'<body name="box_{k}" pos="{0.15 * k} 0 0.04"><freejoint/><geom type="box" size="0.04 0.04 0.04"/></body>'
    for k in range(8)
)
SCENE = f"""<mujoco>
<option timestep="0.00833333" integrator="implicitfast"><flag sleep="enable"/></option>
<worldbody><geom type="plane" size="5 5 1"/>{ROW}
<body name="arm" pos="-0.3 0 0.04" gravcomp="1"><joint name="x" type="slide" axis="1 0 0"/><joint name="z" type="slide"
 axis="0 0 1"/><geom type="sphere" size="0.03"/><body pos="0 0 0.1" gravcomp="1"><joint name="tip" axis="0 1 0"
 damping="0.01" TIP/><geom type="capsule" size="0.01 0.03"/></body></body></worldbody>
<actuator><position joint="x" kp="300" kv="30"/><position joint="z" kp="300" kv="30"/></actuator></mujoco>"""
STATE = ("qpos", "qvel", "qacc_warmstart", "tree_asleep", "tree_awake", "time")
PUSHES = np.array([0.15, 0.6, 0.9])
"""How far the arm is told to go in each world: short of the row, and into it."""


def _start(friction: bool = True, iterations: int = 100) -> tuple[mujoco.MjModel, mujoco.MjData]:
    xml = SCENE.replace("TIP", 'frictionloss="0.001"' if friction else "")
    model = mujoco.MjModel.from_xml_string(xml)
    start = mujoco.MjData(model)
    mujoco.mj_step(model, start, nstep=240)
    model.opt.iterations = iterations
    return model, start


class _Pair:
    """Two batches that begin each step with the same state: one is stepped with MuJoCo Warp's loop, one with ours."""

    def __init__(self, monkeypatch, model: mujoco.MjModel, start: mujoco.MjData, wide: int = 2):
        # not before: its module needs names that may not exist
        from ig2mj.engine.warp.patches import solver_loop

        self.loop, self.patch = solver_loop, monkeypatch
        self.serves = solver_loop._serves
        monkeypatch.setattr(solver_loop, "WIDE", wide)
        self.put = mujoco_warp.put_model(model)
        self.put.opt.warn_overflow = 0
        sizes = {"nworld": len(PUSHES), "naconmax": 256, "naccdmax": 256, "njmax": 200, "nvmax": 40}
        self.new = True
        self.upstream, self.own = (mujoco_warp.put_data(model, start, **sizes) for _ in range(2))

    def step(self, ctrl: np.ndarray) -> None:
        for name in STATE:
            wp.copy(getattr(self.own, name), getattr(self.upstream, name))
        for data, serves in ((self.upstream, lambda m, ctx: False), (self.own, self._serves)):
            self.patch.setattr(self.loop, "_serves", serves)
            data.ctrl.assign(ctrl.astype(np.float32))
            with awake_kernels():
                if self.new:
                    load_kernels_of(lambda: mujoco_warp.step(self.put, data))  # noqa: B023
                mujoco_warp.step(self.put, data)
        self.new = False

    def _serves(self, m, ctx) -> bool:
        assert self.serves(m, ctx), "the kernel is for such models"
        return True

    def of(self, name: str) -> tuple[np.ndarray, np.ndarray]:
        return getattr(self.own, name).numpy(), getattr(self.upstream, name).numpy()


@pytest.mark.parametrize("wide", [0, 2])
def test_iterations_accelerations_and_forces_are_upstreams(kernel_device, monkeypatch, wide):
    """In one world nothing touches anything, in two an arm pushes boxes that slept."""
    pair = _Pair(monkeypatch, *_start(), wide)
    most = np.zeros(len(PUSHES), int)
    for step in range(80):
        pair.step(np.stack([PUSHES * min(1.0, step / 50), np.zeros(3)], 1))
        for name, tolerance in (("qacc", 1e-4), ("qfrc_constraint", 1e-4)):
            mine, theirs = pair.of(name)
            assert np.abs(mine - theirs).max() < tolerance * (1 + np.abs(theirs).max()), (step, name)
        mine, theirs = pair.of("solver_niter")
        assert np.array_equal(mine, theirs), step
        assert np.array_equal(*pair.of("overflow"))
        for world in range(len(PUSHES)):
            assert_same_rows(Rows.of(pair.own, world), Rows.of(pair.upstream, world), forces=1e-4)
        most = np.maximum(most, mine)
    assert most[0] == 1 and (most[1:] >= 4).all(), "of worlds that need one and several iterations"


@pytest.mark.parametrize("iterations", [1, 3])
def test_who_does_not_converge_stops_at_the_limit_and_says_so(kernel_device, monkeypatch, iterations):
    pair = _Pair(monkeypatch, *_start(iterations=iterations))
    for step in range(60):
        pair.step(np.stack([PUSHES * min(1.0, step / 50), np.zeros(3)], 1))
    mine, theirs = pair.of("overflow")
    assert np.array_equal(mine, theirs)
    assert (mine & int(OverflowType.ITERATIONS) != 0).tolist() == [False, True, True]
    assert pair.of("solver_niter")[0].max() == iterations


def test_a_world_without_constraints_and_one_without_numbers_end_as_upstream(kernel_device, monkeypatch):
    pair = _Pair(monkeypatch, *_start(friction=False, iterations=7))
    pair.step(np.zeros((3, 2)))
    assert pair.own.nefc.numpy().tolist() == [0, 0, 0]
    velocity = pair.upstream.qvel.numpy()
    velocity[1, 0] = np.nan
    pair.upstream.qvel.assign(velocity)
    pair.step(np.zeros((3, 2)))
    assert np.array_equal(*pair.of("solver_niter")) and np.array_equal(*pair.of("overflow"))
    mine, theirs = pair.of("qacc")
    assert np.array_equal(np.isfinite(mine), np.isfinite(theirs)) and np.isfinite(mine[[0, 2]]).all()
    assert not np.isfinite(mine[1]).all()
