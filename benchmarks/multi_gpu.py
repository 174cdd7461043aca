"""Worlds shared out over several GPUs: does a world's result depend on how many there are, and how does speed grow?

    python benchmarks/multi_gpu.py HOME [--worlds-per-device 8192] [--compare 1024] [--out DIR]

One process, one program per device (`ig2mj.worlds.sharding`). The same worlds are stepped on one device and on all, and
the positions compared after two seconds; then the disturbed throughput is measured on one device and on all.
"""

from __future__ import annotations

import argparse
import json
import pathlib
import time

import jax
import numpy as np
from batch_case import Case

from ig2mj.calibration.pushing import push, start_pushing
from ig2mj.engine.warp.engine import WarpEngine
from ig2mj.worlds import Core, Rules, ShardedWorlds

STEPS = 30


def make(case: Case, num_worlds: int) -> Core:
    start = jax.tree.map(lambda a: a[0], case.pool.physics)
    engine = WarpEngine(case.scene, num_worlds, profile=case.profile.for_worlds(num_worlds), initial=start)
    return Core(engine, Rules(case.model, case.goal), case.pool)


def shared(case: Case, num_worlds: int, devices: list) -> ShardedWorlds:
    return ShardedWorlds(lambda part: make(case, part), num_worlds, devices)


def pusher(case: Case):
    """Controls of the pushing hand, for `ShardedWorlds.rollout`; the carry is the `Pusher`."""

    def control(batch, pusher):
        world = batch.world
        view = world.view
        pusher = push(case.reach, pusher, view.object_com, view.agent.base_pos[:, 0], world.key, world.step, 1 / 30)
        return pusher.ctrl, pusher

    return control


def ready(case: Case, worlds: ShardedWorlds) -> list:
    """Hands at their start, one `Pusher` per device."""
    pusher = start_pushing(case.reach, worlds.part, case.scene.model.nu)
    return [jax.device_put(pusher, device) for device in worlds.devices]


def roll(case: Case, worlds: ShardedWorlds, steps: int):
    shards, _ = worlds.rollout(worlds.start(0), ready(case, worlds), pusher(case), steps)
    return shards


def speed(case: Case, worlds: ShardedWorlds, calls: int = 4) -> float:
    """Median control steps a second of calls of `STEPS` steps; the first call compiles."""
    control, shards, carries = pusher(case), worlds.start(0), ready(case, worlds)
    shards, carries = jax.block_until_ready(worlds.rollout(shards, carries, control, STEPS))
    times = []
    for _ in range(calls):
        start = time.time()
        shards, carries = jax.block_until_ready(worlds.rollout(shards, carries, control, STEPS))
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
    case = Case(args.home, True)
    result: dict = {"devices": len(devices), "device": devices[0].device_kind, "scene": case.scene.name}
    positions, keys = [], []
    for chosen in (devices[:1], devices[:1], devices):
        worlds = shared(case, args.compare, chosen)
        shards = roll(case, worlds, 60)
        positions.append(np.asarray(worlds.gather(shards, lambda b: b.world.view.object_com)))
        keys.append(np.asarray(worlds.gather(shards, lambda b: b.world.key)))
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
