"""What rests is passed over, and everything comes out as if it had been computed."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest
import warp as wp
from kernel_loading import load_kernels_of
from mujoco.mjx.third_party import mujoco_warp
from mujoco.mjx.third_party.mujoco_warp._src import sleep

from ig2mj.engine.native.engine import NativeEngine
from ig2mj.engine.warp.engine import WarpEngine
from ig2mj.engine.warp.patches import awake_kernels, engine_kernels, pins, upstream_kernels
from ig2mj.engine.warp.patches.flags import FELL_ASLEEP, REPLACED
from ig2mj.scene.scene import load_scene

pytestmark = [
    pytest.mark.skipif(bool(pins.obstacles()), reason=f"our kernels do not fit: {pins.obstacles()}"),
    pytest.mark.slow,
]

ROW = "".join(
    f'<body name="box_{k}" pos="{0.15 * k} 0 0.04"><freejoint/><geom type="box" size="0.04 0.04 0.04"/>'
    f'<site pos="0 0 0.04"/></body>'
    for k in range(6)
)
SCENE = f"""<mujoco>
<option timestep="0.00833333" integrator="implicitfast"><flag sleep="enable"/></option>
<worldbody><geom type="plane" size="5 5 1"/>{ROW}
<body name="cabinet" pos="1.2 0 0.3"><geom type="box" size="0.1 0.3 0.3"/><body name="door" pos="-0.12 0.25 0"><joint
 name="hinge" axis="0 0 1" pos="0 0.05 0" damping="1" range="0 90" limited="true"/>
<geom type="box" size="0.01 0.2 0.2"/>
<body name="knob" pos="-0.03 -0.15 0"><geom type="sphere" size="0.02"/></body></body></body>
<body name="arm" pos="-0.3 0 0.04" gravcomp="1"><joint name="x" type="slide" axis="1 0 0"/><joint name="z" type="slide"
 axis="0 0 1"/><geom type="sphere" size="0.03"/><body pos="0 0 0.1" gravcomp="0.5"><joint name="tip" axis="0 1 0"
 damping="0.01" frictionloss="0.001"/><geom type="capsule" size="0.01 0.03"/></body></body></worldbody>
<actuator><position joint="x" kp="300" kv="30"/><position joint="z" kp="300" kv="30"/></actuator></mujoco>"""

FIELDS = [
    "qpos",
    "qvel",
    "qacc",
    "xpos",
    "xquat",
    "xmat",
    "xipos",
    "ximat",
    "xanchor",
    "xaxis",
    "geom_xpos",
    "geom_xmat",
    "site_xpos",
    "site_xmat",
    "cinert",
    "crb",
    "cdof",
    "M",
    "cdof_dot",
    "cvel",
    "cacc",
    "qfrc_bias",
    "tree_asleep",
    "body_awake",
    "ntree_awake",
    "nbody_awake",
    "nv_awake",
]


STATE = ("qpos", "qvel", "qacc_warmstart")


def _same(device: wp.Device, mine: np.ndarray, theirs: np.ndarray) -> bool:
    """To the bit on a processor. A GPU adds constraint forces in any order, which changes last digits."""
    if not device.is_cuda or not np.issubdtype(mine.dtype, np.floating):
        return np.array_equal(mine, theirs)
    return bool(np.abs(mine - theirs).max(initial=0) < 1e-4 * (1 + np.abs(theirs).max(initial=0)))


def test_a_step_that_passes_over_what_rests_is_the_same_to_the_bit(kernel_device):
    """An arm pushes boxes that sleep, in one world; both come to rest again. On a GPU both begin each step alike."""
    model = mujoco.MjModel.from_xml_string(SCENE)
    start = mujoco.MjData(model)
    mujoco.mj_step(model, start, nstep=240)
    put = mujoco_warp.put_model(model)
    put.opt.warn_overflow = 0
    own, plain = (
        mujoco_warp.put_data(model, start, nworld=2, naconmax=128, naccdmax=128, njmax=200, nvmax=model.nv)
        for _ in range(2)
    )
    flags = own.tree_awake.numpy()
    assert (flags == 0).any(1).all()
    own.tree_awake.assign(np.where(flags == 0, REPLACED, flags).astype(np.int32))
    for kernels in (engine_kernels, awake_kernels):
        with kernels():
            load_kernels_of(lambda: mujoco_warp.step(put, own))
    ctrl, awake, fell = np.zeros((2, model.nu), np.float32), [], 0
    for step in range(160):
        ctrl[:, 0] = np.array([0.1, 0.4]) * (min(1.0, step / 50) if step < 60 else 0.0)
        if kernel_device.is_cuda:
            for name in STATE:
                wp.copy(getattr(plain, name), getattr(own, name))
        for data, kernels in ((own, engine_kernels), (plain, awake_kernels)):
            data.ctrl.assign(ctrl)
            with kernels():
                mujoco_warp.step(put, data)
        for name in FIELDS:
            mine, theirs = getattr(own, name).numpy(), getattr(plain, name).numpy()
            assert _same(kernel_device, mine, theirs), (step, name)
        awake.append(own.nv_awake.numpy().copy())
        fell += int((own.tree_awake.numpy() == FELL_ASLEEP).sum())
    assert awake[0].tolist() == [3, 3]
    assert max(a[0] for a in awake) == 3 and max(a[1] for a in awake) >= 9, "one arm stops short, the other pushes"
    assert fell >= 1, "something falls asleep again"


def test_forces_and_velocities_wake_the_trees_that_upstream_wakes(kernel_device):
    model = mujoco.MjModel.from_xml_string(SCENE)
    start = mujoco.MjData(model)
    mujoco.mj_step(model, start, nstep=240)
    put = mujoco_warp.put_model(model)
    worlds = model.nbody + 2 * model.nv
    own, upstream = (mujoco_warp.put_data(model, start, nworld=worlds, naconmax=640, njmax=60) for _ in range(2))
    force, push, speed = np.zeros((worlds, model.nbody, 6)), np.zeros((worlds, model.nv)), np.zeros((worlds, model.nv))
    force[np.arange(model.nbody), np.arange(model.nbody), 1] = 1e-3
    push[model.nbody + np.arange(model.nv), np.arange(model.nv)] = -1e-3
    speed[model.nbody + model.nv + np.arange(model.nv), np.arange(model.nv)] = 1e-3
    for data, kernels in ((own, engine_kernels), (upstream, upstream_kernels)):
        for name, value in (("xfrc_applied", force), ("qfrc_applied", push), ("qvel", speed)):
            getattr(data, name).assign(value.astype(np.float32))
        with kernels():
            sleep.wake(put, data)
    woken = own.tree_asleep.numpy()
    assert np.array_equal(woken, upstream.tree_asleep.numpy())
    assert (woken[0] >= 0).sum() == model.ntree - 1 and (woken < 0).sum() > worlds, "the arm alone; then others"


def test_positions_that_a_load_puts_in_place_reach_the_geoms_of_what_sleeps():
    scene = load_scene("small_home")
    native = NativeEngine(scene)
    here = native.reset()
    for _ in range(60):
        here, _ = native.step(here)
    asleep = native.export(here, 0)
    engine = WarpEngine(scene, 2, initial=asleep)
    free = np.flatnonzero(scene.model.jnt_type == mujoco.mjtJoint.mjJNT_FREE)
    sleeping = [j for j in free if asleep.tree_asleep[scene.model.body_treeid[scene.model.jnt_bodyid[j]]] >= 0]
    height = int(scene.model.jnt_qposadr[sleeping[0]]) + 1
    physics, _ = engine.step(engine.reset())
    moved = jax.tree.map(np.array, engine.export(physics, 0))
    whole = moved.qpos.copy()
    whole[height] += 0.25  # aside, still asleep
    aside = engine.load(physics, moved.with_whole(qpos=whole), jnp.array([True, False]))
    after, _ = engine.step(aside)
    for world in range(2):
        _, data = engine.to_mujoco(after, world)
        geoms = np.asarray(after.data.geom_xpos)[world]
        assert np.abs(geoms - data.geom_xpos).max() < 1e-4, world
