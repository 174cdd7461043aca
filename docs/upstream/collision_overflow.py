"""MuJoCo Warp: with sleeping on, too many pairs in the first of a step's two collision passes are not flagged.

Needs mujoco and mujoco_warp (or the copy in mujoco-mjx).
"""

import mujoco
import warp as wp

try:
    import mujoco_warp
    from mujoco_warp._src.types import OverflowType
except ImportError:
    from mujoco.mjx.third_party import mujoco_warp
    from mujoco.mjx.third_party.mujoco_warp._src.types import OverflowType

BALLS = "".join(f'<body pos="{0.08 * k} 0 0.04"><freejoint/><geom size="0.05"/></body>' for k in range(12))
SCENE = """<mujoco><option timestep="0.005"><flag sleep="SLEEP"/></option><worldbody>
<geom type="plane" size="20 20 1"/>BALLS</worldbody></mujoco>"""
ROOM = 8
"""Pairs that fit into the buffer; 23 touch."""


def main() -> None:
    wp.config.log_level = wp.LOG_WARNING
    for sleep in ("disable", "enable"):
        model = mujoco.MjModel.from_xml_string(SCENE.replace("SLEEP", sleep).replace("BALLS", BALLS))
        put = mujoco_warp.put_model(model)
        put.opt.warn_overflow = 0
        data = mujoco_warp.put_data(model, mujoco.MjData(model), nworld=1, naconmax=ROOM, njmax=600)
        mujoco_warp.step(put, data)
        flagged = bool(int(data.overflow.numpy()[0]) & int(OverflowType.BROADPHASE))
        counted = int(data.ncollision.numpy()[0])
        print(f"sleep {sleep:8}: room for {ROOM} pairs, {counted} counted, overflow flagged: {flagged}", end="  ")
        print("right" if flagged else "WRONG: pairs are lost without a flag")


if __name__ == "__main__":
    main()
