"""Seconds until the first step of a batch, by phase, and which kernels were compiled after those compiled beforehand.

    python -m benchmarks.speed.cold_start birch --worlds 4096 --cache /tmp/new --both   # cold, then warm; a new folder
    python -m benchmarks.speed.cold_start birch --worlds 4096 --cache /tmp/new --again  # warm

A process of its own measures, from its start to the first step's result: interpreter, imports, JAX's devices, Warp's
devices, the scene (of a home), making the worlds, start, first and second step. As for a user, kernels are compiled and
loaded in threads from the making on, and the start waits for them; `kernels` has the seconds, since the process began,
at which they were there. `--before` waits for them in the making. `processor` has the processor time of the phases, of
all threads, which is less where something else is waited for, and more where several threads work. `programs` has what
JAX traced, lowered and compiled that took a twentieth of a second. Kernels and XLA's programs are kept in the folder
(IG2MJ_CACHE_DIR), and so is what CUDA's driver compiles. `--bytecode` keeps Python's in the folder, too, for machines
that keep none of what is installed on them. `--profile` writes what Python did in the main thread, which makes
everything slower. `missed` names the modules of Warp that were compiled after the start: there should be none.
"""

from __future__ import annotations

import argparse
import cProfile
import functools
import json
import os
import pathlib
import pstats
import subprocess
import sys
import time
from typing import Literal

from benchmarks.harness.paths import environment, module

BEGAN = "COLD_START_BEGAN"
"""Variable with the time at which the process was started."""


def measure(what: str, worlds: int, beforehand: bool | Literal["meanwhile"], cache: pathlib.Path) -> dict:
    """Phases of this process. `beforehand`: `compile_beforehand` of the engine."""
    process_began = float(os.environ[BEGAN])
    began = time.perf_counter() - (time.time() - process_began)
    times, spent, names = [began], [0.0], []
    modules: list[set[str]] = []
    kernels_there: list[float] = []
    programs: list[tuple[str, str, float, float]] = []

    def tick(name: str) -> None:
        times.append(time.perf_counter())
        spent.append(time.process_time())
        names.append(name)
        modules.append({folder.name for folder in (cache / "warp").rglob("wp_*") if folder.is_dir()})

    def note(event: str, duration_secs: float, **about: str | int) -> None:
        if duration_secs > 0.05 and "/compile/" in event:
            part = event.rsplit("/", 1)[1].removesuffix("_duration")
            end = time.perf_counter() - began
            programs.append((part, str(about.get("fun_name", "")), round(end, 2), round(duration_secs, 2)))

    tick("interpreter")

    from ig2mj.process.gc_pause import GC_PAUSED

    GC_PAUSED.begin()  # as `ig2mj.Worlds` and `make_engine` do, which import the same in this order
    import jax
    import numpy as np

    import ig2mj
    from ig2mj.envs.names import activity_name, short_name
    from ig2mj.process import prepare_jax, prepare_warp
    from ig2mj.process.imports import find_devices, import_mjx

    _ = ig2mj.Worlds, ig2mj.load_scene, ig2mj.make
    prepare_jax()
    jax.monitoring.register_event_duration_secs_listener(note)
    find_devices()
    import_mjx()
    import warp as wp

    from ig2mj.engine.warp.engine import WarpEngine

    GC_PAUSED.end()
    tick("imports")
    jax.devices()
    tick("JAX's devices")
    prepare_warp()
    wp.init()
    _ = wp.get_device().context
    tick("Warp's devices")
    is_home = short_name(what) is None and activity_name(what) is None
    if is_home:
        scene = ig2mj.load_scene(what)
        tick("scene")
        batch = ig2mj.Worlds(scene, worlds, "warp", compile_beforehand=beforehand)
        engine = batch.engine
    else:
        env = ig2mj.make(what, worlds=worlds, engine="warp", compile_beforehand=beforehand)
        engine = env.core.engine
    assert isinstance(engine, WarpEngine)
    if engine.loading is not None:
        engine.loading.add_done_callback(lambda _: kernels_there.append(round(time.perf_counter() - began, 2)))
    tick("making")
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
    known = None if engine.loading is None else modules[names.index("start")]
    return {
        "what": what,
        "worlds": worlds,
        "beforehand": beforehand,
        "to_first_step_s": round(sum(v for k, v in seconds.items() if k != "second step"), 1),
        "seconds": seconds,
        "processor": processor,
        "kernels": kernels_there[0] if kernels_there else None,
        "programs": programs,
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
    parser.add_argument("--both", action="store_true", help="cold, then again")
    parser.add_argument("--before", action="store_true", help="kernels before the worlds, not while XLA compiles")
    parser.add_argument("--one-by-one", action="store_true", help="kernels as steps need them, one after the other")
    parser.add_argument("--bytecode", action="store_true", help="Python's bytecode is kept in the folder, too")
    parser.add_argument("--profile", type=pathlib.Path, help="a table of Python's functions goes to this file")
    parser.add_argument("--patience", type=float, default=300, help="seconds after which the process is ended")
    parser.add_argument("--label", default="", help="a remark for the row")
    parser.add_argument("--rows", type=pathlib.Path, help="the row is added to this file, as a JSON line")
    parser.add_argument("--inside", action="store_true", help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.inside:
        beforehand = False if args.one_by_one else (True if args.before else "meanwhile")
        profile = cProfile.Profile()
        measured = functools.partial(measure, args.what, args.worlds, beforehand, args.cache)
        row = profile.runcall(measured) if args.profile else measured()
        print("ROW " + json.dumps(row), flush=True)
        if args.profile:
            with args.profile.open("w") as file:
                for order in ("cumtime", "tottime"):
                    pstats.Stats(profile, stream=file).sort_stats(order).print_stats(150)
        return
    if args.cache.exists() and not args.again:
        raise SystemExit(f"error: {args.cache} exists, so this would be no cold start; name another folder, or --again")
    cases = ["again"] if args.again else ["cold", "again"] if args.both else ["cold"]
    for case in cases:
        from benchmarks.harness import results

        row = run(args.cache, args.patience, args.bytecode) | {"case": case, "bytecode": args.bytecode}
        results.keep_row(row | {"label": args.label}, args.rows)


def run(cache: pathlib.Path, patience: float, bytecode: bool) -> dict:
    """The row of a process that measures."""
    env = environment(IG2MJ_CACHE_DIR=str(cache.resolve()), CUDA_CACHE_PATH=str(cache / "cuda"))
    env.pop("JAX_COMPILATION_CACHE_DIR", None)
    env.pop("WARP_CACHE_PATH", None)
    if bytecode:
        env.pop("PYTHONDONTWRITEBYTECODE", None)
        env["PYTHONPYCACHEPREFIX"] = str((cache / "bytecode").resolve())
    env[BEGAN] = repr(began := time.time())
    command = [sys.executable, *module("speed.cold_start"), *sys.argv[1:], "--inside"]
    try:
        printed = subprocess.run(command, env=env, stdout=subprocess.PIPE, timeout=patience).stdout
        ended = True
    except subprocess.TimeoutExpired as late:
        printed, ended = late.stdout or b"", False
    line = next((line for line in printed.decode().splitlines() if line.startswith("ROW ")), None)
    if line is None:
        raise SystemExit("error: the process that measures has printed no row")
    return json.loads(line[4:]) | {"process_s": round(time.time() - began, 1) if ended else None}


if __name__ == "__main__":
    main()
