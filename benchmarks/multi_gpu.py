"""Worlds shared out over several GPUs: does a world's result depend on how many there are, and how does speed grow?

    python benchmarks/multi_gpu.py HOME [--worlds-per-device 8192] [--compare 1024] [--out DIR]

One process, JAX's own sharding (`ig2mj.worlds.sharding`). The same worlds are stepped on one device and on all, and the
positions compared after two seconds; then the disturbed throughput is measured on one device and on all.
"""

from __future__ import annotations

import argparse
import json
import pathlib
import time

import jax
import jax.numpy as jnp
import numpy as np
from throughput import HAND_START, Case

from ig2mj.agents.pushing import push_controls
from ig2mj.engine.warp import WarpEngine
from ig2mj.worlds.batch import Worlds
from ig2mj.worlds.sharding import ShardedWorlds

STEPS = 30


def make(case: Case, num_worlds: int) -> Worlds:
    start = jax.tree.map(lambda a: a[0], case.pool.physics)
    return Worlds(
        WarpEngine(case.scene, num_worlds, profile=case.profile, initial=start), case.model, case.pool, case.goal
    )


def shared(case: Case, num_worlds: int, devices: list) -> ShardedWorlds:
    return ShardedWorlds(lambda part: make(case, part), num_worlds, devices)


def controls(case: Case):
    return jax.jit(
        lambda b, c: push_controls(
            b.world.view.object_com, c, np.array(HAND_START), case.loose, b.world.key, b.world.step, 1 / 30
        )
    )


def roll(case: Case, worlds: ShardedWorlds, steps: int):
    act = controls(case)
    batch = worlds.start(0)
    ctrl = worlds.place(jnp.zeros((worlds.num_worlds, case.scene.model.nu), jnp.float32))
    for _ in range(steps):
        ctrl = act(batch, ctrl)
        batch, _ = worlds.step(batch, ctrl)
    return batch, ctrl


def speed(case: Case, worlds: ShardedWorlds, calls: int = 3) -> float:
    """Median control steps a second of calls of `STEPS` steps; controls are computed on the devices."""
    act = controls(case)
    batch, ctrl = roll(case, worlds, 3)
    jax.block_until_ready(batch)
    times = []
    for _ in range(calls):
        start = time.time()
        for _ in range(STEPS):
            ctrl = act(batch, ctrl)
            batch, _ = worlds.step(batch, ctrl)
        jax.block_until_ready(batch)
        times.append(time.time() - start)
    return worlds.num_worlds * STEPS / float(np.median(times))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("home")
    parser.add_argument("--worlds-per-device", type=int, default=8192)
    parser.add_argument("--compare", type=int, default=1024, help="worlds of the comparison, in all")
    parser.add_argument("--out", type=pathlib.Path)
    args = parser.parse_args()
    devices = jax.devices()
    case = Case(args.home, True, 16, None)
    result: dict = {"devices": len(devices), "device": devices[0].device_kind, "scene": case.scene.name}
    positions, keys = [], []
    for chosen in (devices[:1], devices[:1], devices):
        batch, _ = roll(case, shared(case, args.compare, chosen), 60)
        positions.append(np.asarray(batch.world.view.object_com))
        keys.append(np.asarray(batch.world.key))
    assert (keys[0] == keys[2]).all()
    for name, a, b in (("same_device_twice", 0, 1), ("one_against_all", 0, 2)):
        gap = np.abs(positions[a] - positions[b]).max((1, 2))
        result[name] = {
            "worlds_bitwise_equal": int((gap == 0).sum()),
            "worlds": len(gap),
            "median_gap_m": float(np.median(gap)),
            "worlds_over_1_mm": int((gap > 1e-3).sum()),
        }
    for chosen in (devices[:1], devices):
        rate = speed(case, shared(case, args.worlds_per_device * len(chosen), chosen))
        result[f"control_steps_per_s_{len(chosen)}"] = round(rate)
        print(json.dumps(result), flush=True)
    result["speedup"] = round(result[f"control_steps_per_s_{len(devices)}"] / result["control_steps_per_s_1"], 3)
    print(json.dumps(result), flush=True)
    if args.out:
        args.out.mkdir(parents=True, exist_ok=True)
        (args.out / "multi_gpu.json").write_text(json.dumps(result, indent=1))


if __name__ == "__main__":
    main()
