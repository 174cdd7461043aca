"""Activities in all homes: where they fit, what their experts reach there, and what training in several homes costs.

    python -m benchmarks.learning.several_homes fit                   which homes each activity fits into, and why not
    python -m benchmarks.learning.several_homes pools --jobs 64       start states of the homes of both splits
    python -m benchmarks.learning.several_homes experts --jobs 16     success of the experts in each home
    python -m benchmarks.learning.several_homes throughput            agent steps/s of eight homes, stepped in turn, and
                                                                      of each home alone with as many worlds
    python -m benchmarks.learning.several_homes axes                  agent steps/s with each axis of randomization

Every row is printed as JSON when it is known, and appended to `--out`; rows that are there are not measured again.
"""

from __future__ import annotations

import argparse
import concurrent.futures
import json
import multiprocessing
import pathlib
import time
from typing import Any

import numpy as np

import ig2mj
from benchmarks.harness.results import keep_row, machine, provenance
from ig2mj.envs.experts import expert_of
from ig2mj.envs.rollout import play
from ig2mj.errors import Ig2mjError
from ig2mj.process import keep_scratch_in_place
from ig2mj.process.processors import available
from ig2mj.scene.paths import shipped_homes
from ig2mj.tasks.activities import ACTIVITIES
from ig2mj.tasks.homes import in_home
from ig2mj.tasks.pools import pool_of
from ig2mj.tasks.relocation import reason_against
from ig2mj.tasks.splits import HELD_OUT_HOMES, TRAIN_HOMES
from ig2mj.tasks.task import Task
from ig2mj.worlds.randomize import AXES

WORLDS, STEPS, ROWS = 1024, 40, 64
"""Worlds of a measurement of axes, agent steps after as many unmeasured ones, and start states of each home."""


def fit(args: argparse.Namespace) -> list[dict[str, Any]]:
    """One job for each activity and home."""
    return [{"what": "fit", "task": task, "home": home} for task in ACTIVITIES for home in shipped_homes()]


def pools(args: argparse.Namespace) -> list[dict[str, Any]]:
    """One job for each activity, split and home that it may fit into."""
    homes = [("train", home) for home in TRAIN_HOMES] + [("held_out", home) for home in HELD_OUT_HOMES]
    return [
        {"what": "pools", "task": task, "home": home, "split": split, "rows": args.rows}
        for task in args.tasks
        for part, home in homes
        for split in ("train", "held_out")
        if part == "train" or split == "held_out"
    ]


def experts(args: argparse.Namespace) -> list[dict[str, Any]]:
    """One job for each activity, robot and home."""
    homes = args.homes or (*TRAIN_HOMES, *HELD_OUT_HOMES)
    robots = [(task, robot) for task in args.tasks for robot in ACTIVITIES[task].robots]
    return [{"what": "experts", "task": t, "robot": r, "home": h, "rows": args.rows} for t, r in robots for h in homes]


def throughput(args: argparse.Namespace) -> list[dict[str, Any]]:
    """All homes together, then each home alone with as many worlds."""
    sets = [list(TRAIN_HOMES), *([home] for home in TRAIN_HOMES)]
    return [{"what": "throughput", "task": args.tasks[0], "homes": homes, "worlds": args.worlds} for homes in sets]


def axes(args: argparse.Namespace) -> list[dict[str, Any]]:
    """Without randomization, with each axis unless only all together are asked for, with all, and without again."""
    each: list[list[str]] = [] if args.together else [[axis] for axis in AXES]
    sets = [[], *each, list(AXES), []]
    return [{"what": "axes", "task": args.tasks[0], "axes": s, "turn": k} for k, s in enumerate(sets)]


def done(job: dict[str, Any]) -> dict[str, Any]:
    """The row of a job."""
    began = time.time()
    try:
        found = {
            "fit": _fit, "pools": _pools, "experts": _experts, "throughput": _throughput, "axes": _axes
        }[job["what"]](job)  # fmt: skip
    except Ig2mjError as e:
        found = {"error": str(e)}
    return {**job, **found, "seconds": round(time.time() - began, 1)}


def _fit(job: dict[str, Any]) -> dict[str, Any]:
    return {"reason": reason_against(ACTIVITIES[job["task"]], job["home"])}


def _pools(job: dict[str, Any]) -> dict[str, Any]:
    task = ACTIVITIES[job["task"]]
    moved = task if job["home"] == task.home else in_home(task, job["home"])
    assert isinstance(moved, Task)
    return {"size": pool_of(moved, job["split"], job["rows"]).size}


def _experts(job: dict[str, Any]) -> dict[str, Any]:
    home = None if job["home"] == ACTIVITIES[job["task"]].home else job["home"]
    options: dict[str, Any] = {"home": home, "split": "held_out", "pool_size": job["rows"]}
    env = ig2mj.make(job["task"], job["robot"], job["rows"], "native", observations="proprioception", **options)
    return {"success": float(np.mean(play(env, expert_of(env), job["rows"], in_order=True).success))}


def _throughput(job: dict[str, Any]) -> dict[str, Any]:
    keep_scratch_in_place()  # as trainings in several homes do
    return _rate(ig2mj.make(job["task"], worlds=job["worlds"], home=job["homes"], pool_size=ROWS, **IMAGES))


def _axes(job: dict[str, Any]) -> dict[str, Any]:
    return _rate(ig2mj.make(job["task"], worlds=WORLDS, pool_size=ROWS, randomize=job["axes"] or None, **IMAGES))


IMAGES: dict[str, Any] = {"engine": "warp", "observations": ("proprioception", "rgb", "depth")}


def _rate(env: Any) -> dict[str, Any]:
    """Agent steps/s of a random policy, with images, in programs of ten steps; seconds of compilation, and memory."""
    import jax

    parts = getattr(env, "envs", (env,))

    def ten(part: Any) -> Any:
        def step(state: Any, key: Any) -> tuple[Any, None]:
            action = jax.random.uniform(key, (part.num_worlds, *part.action_space.shape), minval=-1.0)
            state = part.step_autoreset_fn(state, action)
            return _plain(state), None

        return jax.jit(lambda state, keys: jax.lax.scan(step, state, keys)[0], donate_argnums=0)

    began, key = time.time(), jax.random.PRNGKey(0)
    states = [_plain(part.reset(k)) for k, part in enumerate(parts)]
    keys = jax.random.split(key, 10)
    lowered = [ten(part).lower(state, keys) for part, state in zip(parts, states, strict=True)]
    with concurrent.futures.ThreadPoolExecutor(len(lowered)) as threads:
        programs = list(threads.map(lambda program: program.compile(), lowered))
    compiled = time.time() - began

    def rounds(states: list[Any], count: int) -> list[Any]:
        for _ in range(count):
            states = [run(state, keys) for run, state in zip(programs, states, strict=True)]
        return jax.block_until_ready(states)

    states = rounds(states, STEPS // 10)
    began = time.time()
    rounds(states, STEPS // 10)
    rate = env.num_worlds * STEPS / (time.time() - began)
    memory = jax.local_devices()[0].memory_stats() or {}
    sizes = [p.memory_analysis() for p in programs]
    return {
        "steps_per_second": round(rate),
        "compile_seconds": round(compiled, 1),
        "peak_bytes": memory.get("peak_bytes_in_use"),
        "temporary_bytes": [int(s.temp_size_in_bytes) for s in sizes if s is not None],
        "device": jax.devices()[0].device_kind,
    }


def _plain(state: Any) -> Any:
    """A state whose `info` has the same keys before and after a step."""
    import dataclasses

    return dataclasses.replace(state, info={k: v for k, v in state.info.items() if k != "final_obs"})


KINDS = {"fit": fit, "pools": pools, "experts": experts, "throughput": throughput, "axes": axes}


def main() -> None:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("kind", choices=KINDS)
    parser.add_argument("--tasks", nargs="+", default=["CookingMeat", "GraspingBook"])
    parser.add_argument("--rows", type=int, default=ROWS)
    parser.add_argument("--homes", nargs="+", help='of experts; "birch:1" is the second place of birch')
    parser.add_argument("--worlds", type=int, default=8192, help="of throughput: all worlds together")
    parser.add_argument("--together", action="store_true", help="of axes: only none and all of them")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--out", type=pathlib.Path)
    args = parser.parse_args()
    jobs, known = KINDS[args.kind](args), []
    if args.out is not None and args.out.exists():
        known = [json.loads(line) for line in args.out.read_text().splitlines()]
    jobs = [job for job in jobs if not any(all(row.get(k) == v for k, v in job.items()) for row in known)]
    context = multiprocessing.get_context("spawn")
    with concurrent.futures.ProcessPoolExecutor(args.jobs or available(), context) as workers:
        rows = workers.map(done, jobs) if args.jobs != 1 else map(done, jobs)
        for row in rows:
            keep_row({**row, **provenance(), **machine(-1)}, args.out)


if __name__ == "__main__":
    main()
