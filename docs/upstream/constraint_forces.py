"""MuJoCo Warp: in a world without constraints the compacted solver reads forces that nobody wrote.

Needs mujoco and mujoco_warp (or the copy in mujoco-mjx). Prints the acceleration of a ball in free fall.
"""

import mujoco
import numpy as np
import warp as wp

try:
    import mujoco_warp
except ImportError:
    from mujoco.mjx.third_party import mujoco_warp

BALLS = "".join(f'<body pos="{k} 0 1"><freejoint/><geom size="0.05"/></body>' for k in range(12))
SCENE = f"""<mujoco><option timestep="0.005" solver="Newton" cone="pyramidal"><flag sleep="enable"/></option>
<worldbody><geom type="plane" size="20 20 1"/>{BALLS}</worldbody></mujoco>"""


def main() -> None:
    wp.config.log_level = wp.LOG_WARNING
    model = mujoco.MjModel.from_xml_string(SCENE)
    put = mujoco_warp.put_model(model)
    data = mujoco_warp.put_data(model, mujoco.MjData(model), nworld=1, naconmax=64, njmax=64, nvmax=model.nv)
    print("sparse model:", bool(put.is_sparse), " compacted solver:", data.nvmax_pad > 0)
    for what, value in (("zeros", 0.0), ("finite numbers", 5.0), ("NaN", np.nan)):
        data.cqfrc_constraint.fill_(value)
        mujoco_warp.forward(put, data)
        fall = data.qacc.numpy()[0, 2]
        force = data.qfrc_constraint.numpy()[0, 2]
        right = abs(fall + 9.81) < 1e-3 and force == 0.0
        print(f"{what:15} in memory: acceleration {fall:8.3f} m/s^2, constraint force {force:6.3f} N:", end=" ")
        print("right" if right else "WRONG, -9.81 and 0 are right")


if __name__ == "__main__":
    main()
