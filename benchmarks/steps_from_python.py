"""What an agent step costs that is called from Python, beside steps that are one program (`ig2mj.envs.actor`).

    python benchmarks/steps_from_python.py CookingMeat --worlds 1000 --obs proprioception rgbd

A line of JSON for each way: seconds until its first step was taken, milliseconds of a step (median, and of each), CUDA
graphs that were captured during these steps and how long that took, and programs that were compiled. After the second
step nothing should be compiled, and once buffers have been where they are before nothing captured.

- python: a step is called and its reward and flags fetched, as `ig2mj.envs.rollout.play` did with every policy.
- ahead: steps are called and nothing is fetched before the last.
- actor: up to twenty steps are one program, as `play` does with an `Actor`.
"""

from __future__ import annotations

import argparse
import dataclasses
import pathlib
import time
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import results
from captures import Counts

import ig2mj
from ig2mj.envs.actor import STEPS, Actor, Tally, ending
from ig2mj.envs.environment import Environment
from ig2mj.envs.state import EnvState

WAYS = ("python", "ahead", "actor")


def steps(env: Environment, actor: Actor, state: EnvState, way: str, count: int) -> EnvState:
    """So many steps in a way."""
    action = np.zeros((env.num_worlds, *env.action_space.shape), np.float32)
    tally = Tally.begun(state)
    if way == "actor":
        while int(tally.steps) < count:
            state, tally = actor.several(state, tally, count - int(tally.steps))
            tally = dataclasses.replace(tally, going=jnp.ones(env.num_worlds, bool))
        return state
    for _ in range(count):
        state = env.step(state, actor(state) if way == "python" else action)
        if way == "python":
            tally = tally.after(jax.device_get(ending(state)))
    return jax.block_until_ready(state)


def measure(env: Environment, way: str, counts: Counts, calls: int) -> dict[str, Any]:
    """A way's row: `calls` times `STEPS` steps after the first ones."""
    size, few = env.action_space.shape[0], slice(0, 1)

    def choose(obs: Any, kept: Any, begins: Any, key: Any) -> Any:
        first = jnp.asarray(next(iter(obs.values())), jnp.float32).reshape(env.num_worlds, -1)[:, few]
        return 1e-3 * jnp.tanh(first) * jnp.ones(size), kept

    actor, began = Actor(env, choose), time.perf_counter()
    state = jax.block_until_ready(env.start_from(np.arange(env.num_worlds) % env.core.starts.pool.size))
    started = time.perf_counter()
    state = steps(env, actor, state, way, 1)
    first, seen, times = time.perf_counter(), [counts.now()], []
    for _ in range(calls):
        begin = time.perf_counter()
        state = steps(env, actor, state, way, STEPS)
        times.append(time.perf_counter() - begin)
        seen.append(counts.now())
    graphs, seconds, programs = zip(*seen, strict=True)
    return {
        "way": way,
        "start_s": round(started - began, 2),
        "first_step_s": round(first - started, 2),
        "ms_per_step": round(1e3 * float(np.median(times)) / STEPS, 2),
        "ms_of_calls": [round(1e3 * t / STEPS, 2) for t in times],
        "graphs_before": graphs[0],
        "graphs_of_calls": np.diff(graphs).tolist(),
        "capture_ms_per_graph": round(1e3 * seconds[-1] / max(graphs[-1], 1), 1),
        "programs_of_calls": np.diff(programs).tolist(),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("env", help="an environment's name")
    parser.add_argument("--robot", default=None)
    parser.add_argument("--worlds", type=int, default=1000)
    parser.add_argument("--obs", nargs="+", default=["privileged_state"], help="observations")
    parser.add_argument("--pool", type=int, default=16, help="start states")
    parser.add_argument("--ways", nargs="+", default=list(WAYS), choices=WAYS)
    parser.add_argument("--graph-mode", default=None, help="WARP_STAGED: graphs that copy what lies elsewhere")
    parser.add_argument("--calls", type=int, default=6, help=f"of {STEPS} steps each")
    parser.add_argument("--label", default="", help="a remark for the rows")
    parser.add_argument("--rows", type=pathlib.Path, help="rows are added to this file, as JSON lines")
    args = parser.parse_args()
    began = time.perf_counter()
    env = ig2mj.make(
        args.env, args.robot, args.worlds, "warp", observations=tuple(args.obs), pool_size=args.pool,
        graph_mode=args.graph_mode,
    )  # fmt: skip
    counts, making = Counts(), round(time.perf_counter() - began, 2)
    for way in args.ways:
        row = {
            "env": args.env,
            "obs": args.obs,
            "worlds": args.worlds,
            "graph_mode": args.graph_mode,
            "making_s": making,
        }
        row |= measure(env, way, counts, args.calls)
        results.keep_row(row | {"device": str(jax.devices()[0].device_kind), "label": args.label}, args.rows)


if __name__ == "__main__":
    main()
