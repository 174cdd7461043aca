"""The broad phase of what is awake finds the pairs that MuJoCo Warp's own finds."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
import warp as wp
from mujoco.mjx.third_party import mujoco_warp
from mujoco.mjx.third_party.mujoco_warp._src import collision_driver, types

from ig2mj.engine.warp.patches import awake_kernels, pins

pytestmark = pytest.mark.skipif(bool(pins.obstacles()), reason=f"our kernels do not fit: {pins.obstacles()}")
if not pins.obstacles():
    from ig2mj.engine.warp.patches.broadphase import serves

WORLDS = 8
THINGS = 24


def _model(sleep: str = "enable", extra: str = "") -> mujoco.MjModel:
    """Objects strewn over a floor, a pillar and a cabinet with a door; some geoms only visible, one pair excluded."""
    rng = np.random.default_rng(0)
    shapes = ['type="box" size=".05 .04 .03"', 'type="sphere" size=".05"', 'type="cylinder" size=".04 .05"']
    things = "".join(
        f'<body name="thing_{k}" pos="{x} {y} {z}"><freejoint/><geom name="t{k}" {shapes[k % 3]}/>'
        f'<geom type="sphere" size=".08" contype="0" conaffinity="0" mass="0"/></body>'
        for k, (x, y, z) in enumerate(rng.uniform([-0.4, -0.4, 0.03], [0.4, 0.4, 0.2], (THINGS, 3)))
    )
    return mujoco.MjModel.from_xml_string(
        f"""<mujoco><option><flag sleep="{sleep}"/></option><default><geom gap="0.003" margin="0.001"/></default>
        <worldbody><geom name="floor" type="plane" size="3 3 1"/><geom type="box" size=".1 .1 .5" pos=".2 .2 .5"/>
        <body name="cabinet" pos="-.5 0 .2"><geom type="box" size=".02 .3 .2"/><body name="door"><joint axis="0 0 1"/>
        <geom type="box" size=".2 .02 .2" pos=".2 .3 0"/></body></body>{things}</worldbody>
        <contact><exclude body1="thing_0" body2="thing_1"/>{extra}</contact></mujoco>"""
    )


def _pairs(put, data, before: np.ndarray | None) -> set[tuple[int, int, int]]:
    context = collision_driver.create_collision_context(data.naconmax)
    data.ncollision.zero_()
    previous = None
    if before is not None:
        previous = wp.array(before, dtype=int)
    collision_driver.nxn_broadphase(put, data, context, previous)
    count = int(data.ncollision.numpy()[0])
    world, pair = context.collision_worldid.numpy()[:count], context.collision_pair.numpy()[:count]
    found = [(int(w), int(a), int(b)) for w, (a, b) in zip(world, pair, strict=True)]
    assert len(found) == len(set(found)), "no pair twice"
    return set(found)


@pytest.mark.parametrize("second_pass", [False, True])
@pytest.mark.slow
def test_it_finds_the_pairs_that_upstream_finds(kernel_device, second_pass: bool):
    model = _model()
    put = mujoco_warp.put_model(model)
    room = 400 * WORLDS
    data = mujoco_warp.put_data(model, mujoco.MjData(model), nworld=WORLDS, naconmax=room, naccdmax=room, njmax=99)
    rng = np.random.default_rng(1)
    state = np.array(data.body_awake.numpy())
    movable = state != int(types.SleepState.STATIC)
    kinds = [int(types.SleepState.ASLEEP), int(types.SleepState.AWAKE)]
    trees = np.maximum(model.body_treeid, 0)  # all bodies of a tree sleep or none
    awake, wakes = (rng.random((WORLDS, model.ntree))[:, trees] < share for share in (0.3, 0.2))
    before = np.where(movable, np.where(awake, kinds[1], kinds[0]), state).astype(np.int32)
    woken = np.where(movable & wakes, kinds[1], before).astype(np.int32)
    qpos = np.array(data.qpos.numpy()) + rng.normal(0, 0.02, (WORLDS, model.nq)).astype(np.float32)
    data.qpos.assign(qpos)
    mujoco_warp.kinematics(put, data)
    data.body_awake.assign(woken)
    assert serves(put)
    with awake_kernels():
        own = _pairs(put, data, before if second_pass else None)
    upstream = _pairs(put, data, before if second_pass else None)
    assert own == upstream
    assert len(own) > 10


def test_models_that_reach_further_than_spheres_say_keep_upstreams():
    assert serves(mujoco_warp.put_model(_model()))
    assert not serves(mujoco_warp.put_model(_model(sleep="disable")))
    assert not serves(mujoco_warp.put_model(_model(extra='<pair geom1="t0" geom2="t5" margin="1"/>')))


@pytest.mark.slow
def test_too_many_pairs_are_flagged_though_the_second_pass_finds_none(kernel_device):
    """Everything is awake and lies close: the first pass has all pairs, the second none."""
    model, flag = _model(), int(types.OverflowType.BROADPHASE)
    put = mujoco_warp.put_model(model)
    put.opt.warn_overflow = 0
    flags, counted = {}, {}
    for room in (8, 400):
        data = mujoco_warp.put_data(model, mujoco.MjData(model), nworld=1, naconmax=room, naccdmax=room, njmax=600)
        with awake_kernels():
            mujoco_warp.step(put, data)
        flags[room], counted[room] = int(data.overflow.numpy()[0]) & flag, int(data.ncollision.numpy()[0])
    assert counted[400] > 8
    assert flags == {8: flag, 400: 0}
    data = mujoco_warp.put_data(model, mujoco.MjData(model), nworld=1, naconmax=8, naccdmax=8, njmax=600)
    mujoco_warp.step(put, data)
    assert not int(data.overflow.numpy()[0]) & flag, "upstream flags it by now: `_keep_larger` may go"
