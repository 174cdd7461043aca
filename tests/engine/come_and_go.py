"""A process that makes, steps, drops and remakes Warp engines; `test_engines_come_and_go.py` runs it.

    python tests/engine/come_and_go.py SCENE_FOLDER [--engines 10] [--worlds 64] [--without-repair]

The collector runs often, so that it runs in the middle of captures if it may run there. Prints one line an engine:
worlds, largest speed, bytes in use on the device by JAX.
"""

from __future__ import annotations

import argparse
import gc

import jax
import numpy as np

import ig2mj
from ig2mj.engine.warp.engine import WarpEngine
from ig2mj.process import warp_repairs

OFTEN = (200, 2, 2)


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("scene")
    parser.add_argument("--engines", type=int, default=10)
    parser.add_argument("--worlds", type=int, default=64)
    parser.add_argument("--without-repair", action="store_true")
    args = parser.parse_args()
    if args.without_repair:
        warp_repairs.collect_nothing_during_captures = lambda: None
    scene = ig2mj.load_scene(args.scene)
    gc.set_threshold(*OFTEN)
    for number in range(args.engines):
        engine = WarpEngine(scene, args.worlds + 8 * (number % 3))  # some sizes come again, as when one evaluates
        step = jax.jit(engine.step)
        physics = engine.reset()
        for _ in range(3):
            physics, view = step(physics)
        speed = float(np.abs(np.asarray(physics.data.qvel)).max())
        assert speed < 5.0, "everything rests"
        assert np.isfinite(np.asarray(view.object_pos)).all()
        used = (jax.devices()[0].memory_stats() or {}).get("bytes_in_use", 0)
        print(engine.num_worlds, round(speed, 3), used, flush=True)
        del engine, step, physics, view


if __name__ == "__main__":
    main()
