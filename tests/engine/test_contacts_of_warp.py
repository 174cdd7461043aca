"""Contacts outside their geoms are dropped, slanted normals on faces set upright, and sound contacts left alone."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from mujoco.mjx.third_party import mujoco_warp
from mujoco.mjx.third_party.mujoco_warp._src import collision_driver

from ig2mj.engine.contact_filter import DROPPED_DISTANCE
from ig2mj.engine.warp.patches import awake_kernels, pins
from ig2mj.engine.warp.patches.contacts import mend_contacts

pytestmark = pytest.mark.skipif(bool(pins.obstacles()), reason=f"our kernels do not fit: {pins.obstacles()}")

FLOOR = 6.0
HALF = np.array([0.05, 0.04, 0.03])
WORLDS = 512
SCENE = f"""<mujoco><default><geom gap="0.003"/></default><worldbody>
<geom name="floor" type="box" size="{FLOOR} {FLOOR} 0.05" pos="0 0 -0.05"/>
<body name="thing"><freejoint/><geom name="thing" type="box" size="0.05 0.04 0.03"/></body></worldbody></mujoco>"""


def _things_on_a_floor(tilt: float):
    """Worlds with one box each that lies in a wide floor, 1 um to 0.3 mm deep, turned anyhow, tilted up to `tilt`."""
    rng = np.random.default_rng(0)
    model = mujoco.MjModel.from_xml_string(SCENE)
    put = mujoco_warp.put_model(model)
    room = 16 * WORLDS
    worlds = mujoco_warp.put_data(model, mujoco.MjData(model), nworld=WORLDS, naconmax=room, naccdmax=room, njmax=80)
    qpos = np.zeros((WORLDS, 7))
    qpos[:, :2] = rng.uniform(-0.9, 0.9, (WORLDS, 2)) * FLOOR
    lean, turn, turned, matrix = np.zeros(4), np.zeros(4), np.zeros(4), np.zeros(9)
    for row in qpos:
        axis = rng.normal(size=3) * [1, 1, 0]
        mujoco.mju_axisAngle2Quat(lean, axis / np.linalg.norm(axis), tilt * rng.uniform(0.3, 1))
        mujoco.mju_axisAngle2Quat(turn, np.array([0.0, 0, 1]), rng.uniform(0, 6))
        mujoco.mju_mulQuat(turned, lean, turn)
        mujoco.mju_quat2Mat(matrix, turned)
        row[3:] = turned
        row[2] = np.abs(matrix[6:]) @ HALF - 10.0 ** rng.uniform(-6, -3.5)
    worlds.qpos.assign(qpos.astype(np.float32))
    mujoco_warp.kinematics(put, worlds)
    return put, worlds, qpos


def _slanted(worlds) -> int:
    """Worlds with a contact whose normal is not the floor's."""
    count = int(worlds.nacon.numpy()[0])
    counts = worlds.contact.dist.numpy()[:count] < 0.5 * DROPPED_DISTANCE
    normal = worlds.contact.frame.numpy()[:count].reshape(count, 9)[:, :3]
    return len(np.unique(worlds.contact.worldid.numpy()[:count][counts & (np.abs(normal[:, 2]) < 0.99)]))


@pytest.mark.slow
@pytest.mark.parametrize("tilt", [1e-4, 1.0])
def test_a_floors_contacts_point_up(kernel_device, tilt: float):
    put, worlds, qpos = _things_on_a_floor(tilt)
    collision_driver.collision(put, worlds)
    assert _slanted(worlds) > 0, "upstream is sound by now: `contacts` may go"
    with awake_kernels():
        collision_driver.collision(put, worlds)
    assert _slanted(worlds) == 0
    count = int(worlds.nacon.numpy()[0])
    world, dist = worlds.contact.worldid.numpy()[:count], worlds.contact.dist.numpy()[:count]
    sound = dist < 0.5 * DROPPED_DISTANCE
    assert len(np.unique(world[sound])) == WORLDS, "every thing lies on the floor"
    reach = np.linalg.norm(worlds.contact.pos.numpy()[:count] - qpos[world, :3], axis=1)
    assert reach[sound].max() < np.linalg.norm(HALF) + 0.01
    frame = worlds.contact.frame.numpy()[:count]
    assert np.abs(frame @ frame.transpose(0, 2, 1) - np.eye(3)).max() < 1e-5


@pytest.mark.slow
def test_what_lies_outside_either_geom_is_dropped_and_the_rest_is_kept(kernel_device):
    put, worlds, qpos = _things_on_a_floor(0.0)
    qpos[:, 3:] = [1, 0, 0, 0]
    worlds.qpos.assign(qpos.astype(np.float32))
    mujoco_warp.kinematics(put, worlds)
    offsets = np.array([[0, 0, -0.03], [0.049, 0.0, -0.03], [0.2, 0, 0], [0, 0, 0.5], [np.nan, 0, 0], [0, 0, -0.0321]])
    stray = [False, False, True, True, True, False]
    count = len(offsets)
    rows = np.zeros((worlds.naconmax, 3), np.float32)
    rows[:count] = qpos[:count, :3] + offsets
    worlds.contact.pos.assign(rows)
    worlds.contact.geom.assign(np.tile(np.array([0, 1], np.int32), (worlds.naconmax, 1)))
    worlds.contact.worldid.assign(np.arange(worlds.naconmax, dtype=np.int32) % WORLDS)
    worlds.contact.dist.fill_(-0.0021)
    worlds.nacon.fill_(count)
    mend_contacts(put, worlds)
    dist = worlds.contact.dist.numpy()
    assert (dist[:count] == DROPPED_DISTANCE).tolist() == stray
    assert (dist[count:] == np.float32(-0.0021)).all(), "rows past the count are not looked at"


@pytest.mark.parametrize(
    ("dist", "offset", "upright"),
    [
        (-1e-5, (0, 0, 0), True),
        (-0.002, (0, 0, 0), False),  # deep: another way out may be shorter
        (-1e-5, (0, 0, 0.004), False),  # on no face of either
    ],
)
@pytest.mark.slow
def test_only_shallow_contacts_on_a_face_are_set_upright(kernel_device, dist: float, offset: tuple, upright: bool):
    put, worlds, _ = _things_on_a_floor(0.0)
    worlds.qpos.assign(np.tile(np.array([1, 1, HALF[2], 1, 0, 0, 0], np.float32), (WORLDS, 1)))
    mujoco_warp.kinematics(put, worlds)
    slanted = np.array([[0.6, 0, 0.8], [0.8, 0, -0.6], [0, 1, 0]], np.float32)
    worlds.contact.pos.assign(
        np.tile(np.array([1, 1, 0], np.float32) + offset, (worlds.naconmax, 1)).astype(np.float32)
    )
    worlds.contact.geom.assign(np.tile(np.array([0, 1], np.int32), (worlds.naconmax, 1)))
    worlds.contact.worldid.zero_()
    worlds.contact.dist.fill_(dist)
    worlds.contact.frame.assign(np.tile(slanted, (worlds.naconmax, 1, 1)))
    worlds.nacon.fill_(1)
    mend_contacts(put, worlds)
    normal = worlds.contact.frame.numpy()[0][0]
    assert np.allclose(normal, [0, 0, 1] if upright else slanted[0], atol=1e-6)
