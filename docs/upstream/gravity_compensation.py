"""MuJoCo Warp: gravity compensation is launched for every (world, body, degree of freedom).

Needs mujoco and mujoco_warp (or the copy in mujoco-mjx). Not a wrong result, but work that grows with the square of the
scene: one arm compensates its gravity, and every loose object of the scene makes its launch larger twice over.
"""

import time

import mujoco
import numpy as np
import warp as wp

try:
    import mujoco_warp
except ImportError:
    from mujoco.mjx.third_party import mujoco_warp

ARM = '<body gravcomp="1"><joint axis="0 1 0"/><geom type="capsule" size="0.02 0.2"/></body>'
WORLDS, TIMES = 64, 20


def main() -> None:
    wp.config.log_level = wp.LOG_WARNING
    for objects in (10, 40, 160):
        things = "".join(f'<body pos="{k} 0 1"><freejoint/><geom size="0.05"/></body>' for k in range(objects))
        model = mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{ARM}{things}</worldbody></mujoco>")
        put = mujoco_warp.put_model(model)
        data = mujoco_warp.put_data(model, mujoco.MjData(model), nworld=WORLDS, naconmax=WORLDS, njmax=4)
        mujoco_warp.kinematics(put, data)
        mujoco_warp.com_pos(put, data)
        launch, sizes = wp.launch, {}

        def noted(kernel, dim, *args, launch=launch, sizes=sizes, **kwargs):
            sizes[kernel.key] = int(np.prod(dim))
            return launch(kernel, dim, *args, **kwargs)

        wp.launch = noted
        try:
            mujoco_warp.passive(put, data)
        finally:
            wp.launch = launch
        wp.synchronize()
        start = time.perf_counter()
        for _ in range(TIMES):
            mujoco_warp.passive(put, data)
        wp.synchronize()
        took = 1e3 * (time.perf_counter() - start) / TIMES
        threads = sum(size for key, size in sizes.items() if "gravity_force" in key)
        enough = WORLDS * (model.nbody - 1)
        print(f"{objects:4} objects: {threads:9,} threads, {enough:7,} would do; passive forces take {took:7.2f} ms")


if __name__ == "__main__":
    main()
