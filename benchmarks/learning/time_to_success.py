"""How long it takes to solve activities with 1, 2, 4, ... GPUs: seconds of training until 95 % of the episodes succeed.

    python -m benchmarks.learning.time_to_success --gpus 1 2 4 [--tasks NAME ...] [--limit 280] [--rows FILE]

Every GPU has the same share: 1,024 worlds and 1,024 samples of an update. Twice the GPUs see twice as much in a second,
and every update learns from twice as much; there are not more updates. Each run is one process of `ig2mj train --obs
rgbd --devices N --stop-at-success 0.95`; all compile side by side, then each trains alone on its GPUs.

Success is the share of the last episodes, as `ig2mj train` reports it: over one horizon of all worlds at least, so that
a run cannot stop before its first horizon is over.
"""

from __future__ import annotations

import dataclasses
import json
import os
import pathlib
import time
from typing import Annotated, Any

import tyro

from benchmarks.harness import results
from benchmarks.harness.paths import WORK, module
from benchmarks.harness.waiting import Process, end_all

OUT = WORK / "time_to_success"


@dataclasses.dataclass
class Args:
    """What to measure."""

    gpus: tuple[int, ...] = (1, 2, 4)
    """Numbers of GPUs, the least first."""
    tasks: tuple[str, ...] = ("CookingMeat", "GraspingBook")
    """Activities."""
    until: float = 0.95
    """Share of the episodes that are to succeed."""
    seconds: float = 120.0
    """Of a run's training, at most."""
    limit: float = 280.0
    """Seconds for everything; rows are kept as they come."""
    pool_size: int = 0
    """Start states; 0: all of a task's."""
    rows: pathlib.Path | None = None
    """Rows are added to this file, as JSON lines."""
    out: pathlib.Path = OUT
    """Folder for the runs and their logs."""
    cpu: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """Small shares on CPU devices, to try the benchmark itself."""


@dataclasses.dataclass
class Planned:
    """A run and its GPUs."""

    task: str
    gpus: tuple[int, ...]
    process: Process
    worlds: int
    began: float | None = None
    over: bool = False


def plan(args: Args) -> list[Planned]:
    """All runs, those that can train at the same time on GPUs of their own."""
    most, made = max(args.gpus), []
    next_gpu = 0
    for number in args.gpus:
        for task in args.tasks:
            chosen = tuple((next_gpu + k) % most for k in range(number))
            next_gpu = (next_gpu + number) % most
            made.append(start(task, chosen, args))
    return made


def start(task: str, gpus: tuple[int, ...], args: Args) -> Planned:
    """One run's process, which compiles."""
    share, count = (2 if args.cpu else 1024), len(gpus)
    settings: dict[str, Any] = {
        "env": task,
        "obs": "state" if args.cpu else "rgbd",
        "worlds": share * count,
        "minutes": args.seconds / 60,
        "stop_at_success": args.until,
        "devices": str(count),
        "out": str(args.out / f"{task}-{count}"),
        "set": [
            *("engine=warp", f"pool_size={args.pool_size}", f"batch_size={(32 if args.cpu else 1024) * count}"),
            *(("buffer_size=64", "utd_ratio=2") if args.cpu else ()),
        ],
    }
    environment = {
        "XLA_PYTHON_CLIENT_PREALLOCATE": "false",
        "CUDA_VISIBLE_DEVICES": ",".join(map(str, gpus)),
    }
    if args.cpu:
        flags = f"{os.environ.get('XLA_FLAGS', '')} --xla_force_host_platform_device_count={count}"
        environment |= {"JAX_PLATFORMS": "cpu", "XLA_FLAGS": flags.strip()}
    words = [*module("learning.time_to_success_worker"), json.dumps(settings)]
    return Planned(task, gpus, Process(words, args.out / f"{task}-{count}.log", environment), settings["worlds"])


def told(run: Planned, answer: dict[str, Any] | None, args: Args) -> dict[str, Any]:
    """A run's row. `answer`: what it said at its end; None: nothing."""
    row: dict[str, Any] = {"task": run.task, "gpus": len(run.gpus), "until": args.until, "worlds": run.worlds}
    if answer is None:
        error = run.process.trouble() if run.began is not None or run.process.ready is None else "no time was left"
        return {**row, "solved": False, "error": error}
    return {**row, "solved": answer.pop("stopped") == "solved", **answer}


def main(args: Args) -> None:
    """Measures; rows go to standard output and to the file."""
    until = time.monotonic() + args.limit
    made = plan(args)
    try:
        for run in made:  # training is timed while nothing compiles; what is not ready in two thirds is left out
            run.process.wait_until_ready(until - args.limit / 3)
        while (waiting := [r for r in made if not r.over and r.process.ready is not None]) and time.monotonic() < until:
            busy: set[int] = set()
            for run in waiting:  # in order: a run that waits for its GPUs keeps them from those behind it
                if run.began is None and not busy & set(run.gpus):
                    run.began = time.monotonic()
                    run.process.tell({})
                busy |= set(run.gpus)
            for run in waiting:
                if run.began is None:
                    continue
                ended = run.process.ended  # asked before its lines are read: all of them are there then
                answer = run.process.hear("DONE", time.monotonic() + (2.0 if ended else 0.2))
                if answer is not None or ended:
                    run.over = True
                    results.keep_row(told(run, answer, args), args.rows)
        for run in made:
            if not run.over:
                results.keep_row(told(run, None, args), args.rows)
    finally:
        end_all(r.process for r in made)


if __name__ == "__main__":
    main(tyro.cli(Args, description=__doc__))
