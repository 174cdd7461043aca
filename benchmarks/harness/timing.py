"""Timing of several things side by side: short blocks in turn (A B C A B C ...), medians over the rounds.

Other work on the machine then slows all of them alike. Every block is timed on the wall and by the processor time of
the process that does the work. With all on one core (`one_core`) the two agree on an idle machine, and on a busy one
the processor's time tells what the idle one would show: it is what the tables give.
"""

from __future__ import annotations

import dataclasses
import os
import time
from collections.abc import Callable, Mapping

import numpy as np

Block = Callable[[int], tuple[float, float]]
"""Does so many steps; returns (wall seconds, processor seconds)."""


@dataclasses.dataclass
class Rate:
    """Steps per second of one thing: medians over the rounds, and each round's, on the wall and by processor time."""

    steps_per_s: float
    steps_per_cpu_s: float
    spread: float  # interquartile range of the rounds' wall rates, relative to the median
    block: int  # steps in a block
    rounds: list[float]
    cpu_rounds: list[float]


def timed(step: Callable[[], object]) -> Block:
    """A block of a step that this process takes."""

    def block(count: int) -> tuple[float, float]:
        wall, cpu = time.perf_counter(), time.process_time()
        for _ in range(count):
            step()
        return time.perf_counter() - wall, time.process_time() - cpu

    return block


def interleave(
    blocks: Mapping[str, Block], seconds: float, rounds: int, steps: int | None = None, most: int = 10_000
) -> dict[str, Rate]:
    """Times all blocks in turn, `rounds` times. The first call of each finds out how many steps take `seconds`.

    Args:
      seconds: of one block. steps: in a block, whatever its time. most: steps in a block.
    """
    counts = {}
    for name, block in blocks.items():
        block(2)  # whatever the first steps still have to set up
        wall, _ = block(3)
        counts[name] = steps or int(np.clip(seconds / max(wall / 3, 1e-9), 2, most))
    walls: dict[str, list[float]] = {name: [] for name in blocks}
    cpus: dict[str, list[float]] = {name: [] for name in blocks}
    for _ in range(rounds):
        for name, block in blocks.items():
            wall, cpu = block(counts[name])
            walls[name].append(counts[name] / wall)
            cpus[name].append(counts[name] / max(cpu, 1e-9))
    return {name: _rate(counts[name], walls[name], cpus[name]) for name in blocks}


def _rate(block: int, walls: list[float], cpus: list[float]) -> Rate:
    low, middle, high = np.percentile(walls, [25, 50, 75])
    return Rate(
        steps_per_s=float(middle),
        steps_per_cpu_s=float(np.median(cpus)),
        spread=float((high - low) / middle),
        block=block,
        rounds=[round(v, 1) for v in walls],
        cpu_rounds=[round(v, 1) for v in cpus],
    )


def one_core() -> int:
    """Keeps this process, and those it starts, on one processor core; returns its number.

    Must be called before JAX and OpenGL start their threads. -1 where the system cannot do it.
    """
    os.environ.setdefault("JAX_PLATFORMS", "cpu")
    os.environ.setdefault("XLA_FLAGS", "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1")
    os.environ.setdefault("LP_NUM_THREADS", "0")  # Mesa's software renderer draws in the calling thread
    if not hasattr(os, "sched_setaffinity"):
        return -1
    core = max(os.sched_getaffinity(0))
    os.sched_setaffinity(0, {core})
    return core
