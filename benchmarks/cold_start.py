"""Seconds until the first step of a batch, by phase, and which kernels were compiled after those compiled beforehand.

    python benchmarks/cold_start.py birch --worlds 4096 --cache /tmp/new          # cold: the folder must not exist
    python benchmarks/cold_start.py birch --worlds 4096 --cache /tmp/new --again  # warm

A process of its own measures: imports, JAX's devices, Warp's devices, the scene (of a home), making the worlds, kernels
(`WarpEngine.load_kernels`), start, first and second step. An engine loads its kernels when it is made; here that is a
phase of its own. `processor` has the processor time of the same phases, which is less where something else is waited
for. Kernels and XLA's programs are kept in the folder (IG2MJ_CACHE_DIR), and so is what CUDA's driver compiles.
`--devices-beside` lets JAX look for its devices in a thread while modules are imported.
`missed` names the modules of Warp that no phase but a step compiled: there should be none.
"""

from __future__ import annotations

import argparse
import json
import os
import pathlib
import subprocess
import sys
import threading
import time


def measure(
    what: str, worlds: int, beforehand: bool, cache: pathlib.Path, meanwhile: bool = False, beside: bool = False
) -> dict:
    """Phases of this process, which began just now. `beside`: see the module's text."""
    times, spent, names = [time.perf_counter()], [time.process_time()], []
    modules: list[set[str]] = []

    def tick(name: str) -> None:
        times.append(time.perf_counter())
        spent.append(time.process_time())
        names.append(name)
        modules.append({folder.name for folder in (cache / "warp").rglob("wp_*") if folder.is_dir()})

    import jax
    import numpy as np

    from ig2mj.process import prepare_jax, prepare_warp

    prepare_jax()
    devices = threading.Thread(target=jax.devices)
    if beside:
        devices.start()

    import warp as wp

    import ig2mj
    from ig2mj.engine.warp.engine import WarpEngine
    from ig2mj.envs.names import activity_name, short_name

    tick("imports")
    if not beside:
        devices.start()
    devices.join()
    tick("JAX's devices")
    prepare_warp()
    wp.init()
    _ = wp.get_device().context
    tick("Warp's devices")
    is_home = short_name(what) is None and activity_name(what) is None
    loading = "meanwhile" if meanwhile else False
    if is_home:
        scene = ig2mj.load_scene(what)
        tick("scene")
        batch = ig2mj.Worlds(scene, worlds, "warp", compile_beforehand=loading)
        engine = batch.engine
    else:
        env = ig2mj.make(what, worlds=worlds, engine="warp", compile_beforehand=loading)
        engine = env.core.engine
    tick("making")
    if beforehand and not meanwhile:
        assert isinstance(engine, WarpEngine)
        engine.load_kernels()
        tick("kernels")
    if is_home:
        state = jax.block_until_ready(batch.start(0))
        tick("start")
        for step in ("first step", "second step"):
            state, _ = jax.block_until_ready(batch.step(state))
            tick(step)
    else:
        state = jax.block_until_ready(env.reset(0))
        tick("start")
        action = np.zeros((worlds, *env.action_space.shape), np.float32)
        for step in ("first step", "second step"):
            state = jax.block_until_ready(env.step_autoreset(state, action))
            tick(step)
    seconds = {name: round(end - begin, 2) for name, begin, end in zip(names, times, times[1:], strict=False)}
    processor = {name: round(end - begin, 2) for name, begin, end in zip(names, spent, spent[1:], strict=False)}
    known = modules[names.index("kernels")] if "kernels" in names else None
    return {
        "what": what,
        "worlds": worlds,
        "beforehand": "meanwhile" if meanwhile else beforehand,
        "to_first_step_s": round(sum(v for k, v in seconds.items() if k != "second step"), 1),
        "seconds": seconds,
        "processor": processor,
        "devices_beside": beside,
        "modules": [len(m) for m in modules],
        "missed": None if known is None else sorted(modules[-1] - known),
        "cores": len(os.sched_getaffinity(0)),
        "device": str(jax.devices()[0].device_kind),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("what", help="a home or an environment")
    parser.add_argument("--worlds", type=int, default=4096)
    parser.add_argument("--cache", type=pathlib.Path, required=True, help="folder for everything compiled")
    parser.add_argument("--again", action="store_true", help="with what an earlier run left there")
    parser.add_argument("--one-by-one", action="store_true", help="kernels as steps need them, one after the other")
    parser.add_argument("--meanwhile", action="store_true", help="kernels while XLA compiles, not before")
    parser.add_argument("--devices-beside", action="store_true", help="JAX's devices while modules are imported")
    parser.add_argument("--label", default="", help="a remark for the row")
    parser.add_argument("--rows", type=pathlib.Path, help="the row is added to this file, as a JSON line")
    parser.add_argument("--inside", action="store_true", help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.inside:
        row = measure(args.what, args.worlds, not args.one_by_one, args.cache, args.meanwhile, args.devices_beside)
        print("ROW " + json.dumps(row), flush=True)
        return
    if args.cache.exists() and not args.again:
        raise SystemExit(f"error: {args.cache} exists, so this would be no cold start; name another folder, or --again")
    env = {**os.environ, "IG2MJ_CACHE_DIR": str(args.cache.resolve()), "CUDA_CACHE_PATH": str(args.cache / "cuda")}
    env.pop("JAX_COMPILATION_CACHE_DIR", None)
    env.pop("WARP_CACHE_PATH", None)
    began = time.time()
    done = subprocess.run([sys.executable, *sys.argv, "--inside"], env=env, stdout=subprocess.PIPE, text=True)
    line = next((line for line in done.stdout.splitlines() if line.startswith("ROW ")), None)
    if line is None:
        raise SystemExit(f"error: no row; the process ended with {done.returncode}")
    row = json.loads(line[4:]) | {"case": "again" if args.again else "cold", "label": args.label}
    row["process_s"] = round(time.time() - began, 1)
    import results

    results.keep_row(row, args.rows)


if __name__ == "__main__":
    main()
