"""Do recorded episodes come out the same, byte for byte, in a fresh process, on any number of threads?

    python benchmarks/replays.py --episodes 2000 --jobs 16 --out out/replays

Each case is a task, a robot, and an expert (with noise) or random actions. One process records its episodes, another
replays them by action and compares every byte of every frame; the threaded cases are replayed again on 1, 2 and 8
threads. A case that is finished is not done again. Leaves a line of JSON for each case in `rows.jsonl`, and the sums in
`summary.json`.
"""

from __future__ import annotations

import argparse
import concurrent.futures
import json
import os
import pathlib
import subprocess
import sys
import time
from typing import Any

from results import machine

NOISE = 0.1
"""Deviation of what is added to the experts' actions, so that no two episodes are alike."""

ONE_THREAD = {
    "JAX_PLATFORMS": "cpu",
    "OMP_NUM_THREADS": "1",
    "XLA_FLAGS": "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1",
}
"""Of each process, so that many of them share a machine."""

THREADED = ("CookingMeat", "GraspingBook", "SlicingFruit", "SoakingTowel")
"""Tasks whose experts' episodes are also replayed on 1, 2 and 8 threads."""

THREADS = (1, 2, 8)


def cases() -> list[tuple[str, str, str]]:
    """(task, robot, who acts) of all registered tasks with two robots each; experts where there are some."""
    from ig2mj.envs.names import NAMES
    from ig2mj.envs.registry import find_task
    from ig2mj.tasks.experts.expert import PLANS

    found = []
    for name in NAMES:
        for robot in list(find_task(name).robots)[:2]:
            found += [(name, robot, agent) for agent in ("random", "expert") if agent == "random" or name in PLANS]
    return found


def record(task: str, robot: str, agent: str, episodes: int, worlds: int, file: str, seed: int) -> None:
    """Plays a case's episodes and writes them."""
    import numpy as np

    import ig2mj
    from ig2mj.demos import record as recorded
    from ig2mj.envs.experts import expert_of
    from ig2mj.envs.rollout import play

    env = ig2mj.make(task, robot=robot, worlds=worlds, engine="native", threads=1)
    rng, shape = np.random.default_rng(seed), (worlds, *env.action_space.shape)
    if agent == "random":
        act = lambda state: rng.uniform(-1, 1, shape).astype(np.float32)  # noqa: E731
    else:
        expert = expert_of(env)
        act = lambda state: np.asarray(expert(state)) + NOISE * rng.standard_normal(shape)  # noqa: E731
    with recorded(env, file) as played:
        outcome = play(played, act, episodes, seed)
    print(json.dumps({"success": sum(outcome.success)}))


def replay(file: str, threads: int) -> None:
    """Replays a recording by action and prints what came of it."""
    from ig2mj.demos import Recording, Replayer

    with Recording(file) as recording:
        replayer = Replayer(recording, threads=threads)
        runs = [run for run in recording.runs if run.attributes.get("ended") and run.frames > 1]
        done = replayer(check=True, runs=runs)
    about = {"runs": done.runs, "frames": done.frames, "different": len(done.differences)}
    print(json.dumps(about | {"first": [str(d) for d in done.differences[:3]], "warnings": done.warnings}))


def _process(*arguments: str) -> dict[str, Any]:
    """This program anew, with what it prints last. `error`: it failed."""
    command = [sys.executable, __file__, *arguments]
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=os.environ | ONE_THREAD)
    if done.returncode:
        return {"error": (done.stderr.strip().splitlines() or ["no message"])[-1]}
    return json.loads(done.stdout.strip().splitlines()[-1])


def one_case(case: tuple[str, str, str], episodes: int, worlds: int, out: pathlib.Path, keep: bool) -> dict[str, Any]:
    """Records and replays a case, or reads what came of it before."""
    task, robot, agent = case
    name = f"{task}_{robot}_{agent}"
    kept, file = out / f"{name}.json", out / f"{name}.h5"
    if kept.exists():
        return json.loads(kept.read_text())
    began = time.monotonic()
    row: dict[str, Any] = {"task": task, "robot": robot, "agent": agent}
    played = _process("--record", *case, str(episodes), str(worlds), str(file))
    row |= played
    if "error" not in played:
        row["megabytes"] = round(file.stat().st_size / 1e6, 2)
        row |= _process("--replay", str(file), "0")
        if agent == "expert" and task in THREADED:
            row["threads"] = {str(n): _process("--replay", str(file), str(n)) for n in THREADS}
    row["seconds"] = round(time.monotonic() - began)
    kept.write_text(json.dumps(row))
    if not keep:
        file.unlink(missing_ok=True)
    print(json.dumps(row), flush=True)
    return row


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--episodes", type=int, default=2000, help="of all cases together")
    parser.add_argument("--worlds", type=int, default=8, help="of a case, beside each other")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--only", default="", help="cases whose names have this in them")
    parser.add_argument("--out", type=pathlib.Path, default=pathlib.Path("out/replays"))
    parser.add_argument("--keep", action="store_true", help="the recordings")
    parser.add_argument("--record", nargs=6, help=argparse.SUPPRESS)
    parser.add_argument("--replay", nargs=2, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.record:
        task, robot, agent, episodes, worlds, file = options.record
        return record(task, robot, agent, int(episodes), int(worlds), file, seed=len(file))
    if options.replay:
        return replay(options.replay[0], int(options.replay[1]) or 1)
    options.out.mkdir(parents=True, exist_ok=True)
    chosen = [case for case in cases() if options.only in "_".join(case)]
    each = -(-options.episodes // len(chosen))
    with concurrent.futures.ThreadPoolExecutor(options.jobs) as pool:
        chosen.sort(key=lambda c: c[2] != "expert" or c[0] not in THREADED)  # what takes longest begins first
        rows = list(pool.map(lambda c: one_case(c, each, options.worlds, options.out, options.keep), chosen))
    (options.out / "rows.jsonl").write_text("".join(json.dumps(row) + "\n" for row in rows))
    good = [row for row in rows if "error" not in row]
    summary = {
        "episodes": sum(row["runs"] for row in good),
        "frames": sum(row["frames"] for row in good),
        "identical": sum(row["runs"] - row["different"] for row in good),
        "different": sum(row["different"] for row in good),
        "failed_cases": [row for row in rows if "error" in row],
        "threads": {
            str(n): {
                key: sum(row["threads"][str(n)].get(key, 0) for row in good if "threads" in row)
                for key in ("runs", "frames", "different")
            }
            for n in THREADS
        },
        "machine": machine(-1),
    }
    (options.out / "summary.json").write_text(json.dumps(summary, indent=1))
    print(json.dumps(summary))


if __name__ == "__main__":
    main()
