"""Where an iteration of a training goes: the worlds' steps and the updates, and the longest kernels of these.

    python benchmarks/iteration_kernels.py [--iterations 40] [--kernels 40] [--rows FILE] -- SlicingFruit ...

Behind `--` are the words of `ig2mj train`. Everything is made as that command makes it; then iterations run as one
program and as two, of which the second half is timed. Each row also tells how many CUDA graphs Warp captured in each
iteration (after the first few it should be none), and `moves` which arrays of which call lay elsewhere. The worlds'
program is not profiled: under the profiler it has ended processes (a failed launch of a graph).
"""

from __future__ import annotations

import dataclasses
import os
import pathlib
import sys
import time
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import results
import tyro
from captures import Counts, Moves
from kernel_times import profiled

import ig2mj.learn.train
from ig2mj.cli import main as command
from ig2mj.learn.iteration import OneDevice


@dataclasses.dataclass
class Args:
    """What to measure."""

    iterations: int = 40
    """That learn; the worlds are then where that many bring them."""
    programs: tuple[int, ...] = (1, 2)
    """Of an iteration."""
    kernels: int = 40
    """Of the learning to list; 0: no profile."""
    rows: pathlib.Path | None = None
    """A row is added to this file, as JSON."""


def measured(args: Args, programs: int, env: Any, algorithm: Any, learner: Any, seed: int) -> dict[str, Any]:
    """Seconds of an iteration's parts, and what runs in them."""
    step, counts = OneDevice(env, algorithm, programs), Counts()
    learner = algorithm.init(jax.random.PRNGKey(seed)) if learner is None else jax.tree.map(jnp.copy, learner)
    learner, memory = step.place(learner, step.memory())
    play, key = step.begin(seed), jax.random.PRNGKey(seed)
    took, worlds, captured = list[float](), list[float](), list[int]()
    warm_up = algorithm.warm_up(False)
    for done in range(warm_up + args.iterations):
        key, now = jax.random.split(key)
        progress, before = done / (warm_up + args.iterations), counts.now()[0]
        began = time.perf_counter()
        learner, memory, play, _, _, spent = step(learner, memory, play, now, progress, done >= warm_up)
        took.append(1e3 * (time.perf_counter() - began))
        worlds.append(1e3 * (spent or 0.0))
        captured.append(counts.now()[0] - before)
    half = args.iterations // 2
    row: dict[str, Any] = {
        "programs": programs,
        "xla_flags": os.environ.get("XLA_FLAGS", ""),
        "worlds": env.num_worlds,
        "steps": algorithm.length,
        "updates": algorithm.samples,
        "iteration_ms": round(float(np.median(took[-half:])), 1),
        "of_that_worlds_ms": round(float(np.median(worlds[-half:])), 1),
        "iterations_ms": np.round(took).tolist(),
        "of_these_worlds_ms": np.round(worlds).tolist(),
        "graphs_captured": captured,
        "device": jax.devices()[0].device_kind,
        "troubles": env.metrics(play.state),
    }
    print(row, flush=True)
    if args.kernels and programs == 2:
        play, rollout, *_ = step.play(learner, play, key)
        given = (learner, memory, rollout, key, np.float32(1.0), np.bool_(True))
        _, row["kernels_of_learning"] = profiled(lambda: step.learn(*given), algorithm.samples, args.kernels, "update")
    return row


def main() -> None:
    at = sys.argv.index("--") if "--" in sys.argv else len(sys.argv)
    args, words = tyro.cli(Args, description=__doc__, args=sys.argv[1:at]), sys.argv[at + 1 :]

    moves = Moves()

    def instead(env: Any, algorithm: Any, run: Any, depends: Any = None, learner: Any = None, *_: Any) -> Any:
        for programs in args.programs:
            row = measured(args, programs, env, algorithm, learner, run.seed)
            results.keep_row({**row, "moves": moves.rows.copy(), "command": words}, args.rows)
            moves.rows.clear()
        raise SystemExit(0)

    ig2mj.learn.train.train = instead  # the command takes it from there when it runs
    sys.argv[1:] = ["train", *words]
    command()


if __name__ == "__main__":
    main()
