"""MuJoCo Warp: a small box that rests on a wide box gets stray contacts and slanted normals.

Needs mujoco, numpy and mujoco_warp (or the copy in mujoco-mjx). Counts worlds of 512, each with one box on a floor.
"""

import mujoco
import numpy as np
import warp as wp

try:
    import mujoco_warp
except ImportError:
    from mujoco.mjx.third_party import mujoco_warp

WORLDS, FLOOR = 512, 6.0
HALF = np.array([0.05, 0.04, 0.03])
SCENE = f"""<mujoco><default><geom gap="0.003"/></default><worldbody>
<geom type="box" size="{FLOOR} {FLOOR} 0.05" pos="0 0 -0.05"/>
<body><freejoint/><geom type="box" size="0.05 0.04 0.03"/></body></worldbody></mujoco>"""


def poses(tilt: float) -> np.ndarray:
    """Boxes 1 um to 0.3 mm deep in the floor, at any place, turned anyhow, tilted by up to `tilt` radians."""
    draw = np.random.default_rng(0)
    qpos = np.zeros((WORLDS, 7))
    qpos[:, :2] = draw.uniform(-0.9, 0.9, (WORLDS, 2)) * FLOOR
    lean, turn, matrix = np.zeros(4), np.zeros(4), np.zeros(9)
    for row in qpos:
        axis = draw.normal(size=3) * [1, 1, 0]
        mujoco.mju_axisAngle2Quat(lean, axis / np.linalg.norm(axis), tilt * draw.uniform(0.3, 1))
        mujoco.mju_axisAngle2Quat(turn, np.array([0.0, 0.0, 1.0]), draw.uniform(0, 6))
        mujoco.mju_mulQuat(row[3:], lean, turn)
        mujoco.mju_quat2Mat(matrix, row[3:])
        row[2] = np.abs(matrix[6:]) @ HALF - 10.0 ** draw.uniform(-6, -3.5)
    return qpos


def main() -> None:
    wp.config.log_level = wp.LOG_WARNING
    model = mujoco.MjModel.from_xml_string(SCENE)
    put = mujoco_warp.put_model(model)
    room = 16 * WORLDS
    data = mujoco_warp.put_data(model, mujoco.MjData(model), nworld=WORLDS, naconmax=room, naccdmax=room, njmax=80)
    reference = mujoco.MjData(model)
    for tilt in (1e-4, 1.0):
        qpos = poses(tilt)
        data.qpos.assign(qpos.astype(np.float32))
        mujoco_warp.kinematics(put, data)
        mujoco_warp.collision(put, data)
        count = int(data.nacon.numpy()[0])
        world = data.contact.worldid.numpy()[:count]
        normal = data.contact.frame.numpy()[:count].reshape(count, 9)[:, :3]
        away = np.linalg.norm(data.contact.pos.numpy()[:count] - qpos[world, :3], axis=1)
        slanted = len(np.unique(world[np.abs(normal[:, 2]) < 0.99]))
        stray = len(np.unique(world[away > np.linalg.norm(HALF) + 0.01]))
        wrong = 0
        for row in qpos:
            reference.qpos[:] = row
            mujoco.mj_kinematics(model, reference)
            mujoco.mj_collision(model, reference)
            wrong += bool((np.abs(reference.contact.frame[:, 2]) < 0.99).any())
        print(f"tilt up to {tilt:g}: of {WORLDS} worlds {slanted} with a normal that is not the floor's", end=", ")
        print(f"{stray} with a contact outside the box (up to {away.max():.2f} m away); C MuJoCo: {wrong}, 0")


if __name__ == "__main__":
    main()
