"""Where a GPU's time goes: device time by kernel, and the time in which nothing runs.

CUPTI sees kernels inside CUDA graphs too, so XLA's and Warp's are listed side by side. `--kernels N` of
`speed.batch`, `speed.environments` and `learning.learner` prints the N longest after their rows;
`speed.scaling --kernels FOLDER` keeps all of a learner's (`profiled_to`).
"""

from __future__ import annotations

import collections
import json
import pathlib
import re
import tempfile
import time
from collections.abc import Callable, Iterator
from typing import Any

import jax
import numpy as np

WARP_NAME = re.compile(r"_[0-9a-f]{8}_cuda_kernel_forward|_cuda_kernel_forward")

WARP_MARK = "warp: "

GAPS, GAP_NAMES = (5e-6, 50e-6, 1e-3), ("under 5 us", "5 to 50 us", "50 us to 1 ms", "over 1 ms")
"""Seconds in which nothing runs: between launches of one graph, of several, waiting for the host."""


def profiled(
    call: Callable[[], Any], steps: int, most: int, unit: str = "step", timeline: pathlib.Path | None = None
) -> tuple[Any, dict[str, Any]]:
    """Runs `call` under the profiler, prints the longest kernels, the longest gaps in which none runs and the
    longest copies, and returns its result and a summary.

    Args:
      call: what to run; its result is waited for. steps: how many steps it makes. most: kernels to print.
      unit: what a step is.
      timeline: file for what ran in the last two steps, as CSV: start and duration in microseconds, stream, name.

    Returns:
      The result, and milliseconds a step: `wall` (with the profiler's own cost), `kernels` (their sum), `busy` (at
      least one runs), `idle` (between the first and the last kernel, none runs); `launches`: kernels and copies.
    """
    with tempfile.TemporaryDirectory() as folder:
        with jax.profiler.trace(folder):
            began = time.perf_counter()
            result = jax.block_until_ready(call())
            wall = time.perf_counter() - began
        streams = _events(folder)
    events = [(start, duration, name) for start, duration, name, _ in streams]
    if timeline is not None and streams:
        with timeline.open("w") as file:
            for start, duration, name, stream in streams[-2 * len(streams) // steps :]:
                file.write(f"{(start - events[0][0]) / 1e3:.1f},{duration / 1e3:.1f},{stream},{name}\n")
    total: dict[str, float] = collections.defaultdict(float)
    calls: dict[str, int] = collections.defaultdict(int)
    for _, duration, name in events:
        total[name] += duration
        calls[name] += 1
    busy, span = _busy(events)
    per = 1e6 * steps
    summary = {
        "wall": round(1e3 * wall / steps, 3),
        "kernels": round(sum(total.values()) / per, 3),
        "busy": round(busy / per, 3),
        "idle": round((span - busy) / per, 3),
        "launches": round(len(events) / steps, 1),
        "unit": f"ms per {unit}",
    }
    print(summary, flush=True)
    whole = max(sum(total.values()), 1)
    for name, nanoseconds in sorted(total.items(), key=lambda item: -item[1])[:most]:
        share = f"{nanoseconds / whole:6.1%} {nanoseconds / steps / 1e3:9.2f} us {calls[name] / steps:7.1f} x"
        print(f"{share}  {name[:100]}", flush=True)
    for (before, after), (nanoseconds, count) in _gaps(events)[: max(1, most // 3)]:
        print(
            f"  idle {nanoseconds / steps / 1e3:9.2f} us {count / steps:7.1f} x  {before[:60]} -> {after[:60]}",
            flush=True,
        )
    for (before, name, after), (nanoseconds, count) in _copies(events)[: max(1, most // 3)]:
        share = f"{nanoseconds / steps / 1e3:9.2f} us {count / steps:7.1f} x"
        print(f"  copy {share}  {before[:50]} -> {name} -> {after[:50]}", flush=True)
    return result, summary


def profiled_to(file: pathlib.Path, call: Callable[[], Any], steps: int) -> None:
    """Runs `call` under the profiler, and writes what ran on this process's first GPU, as JSON.

    `steps`, `busy` and `idle` as of `profiled`, but seconds of the whole call; `kernels`: by name how often
    it ran, and its seconds together, shortest and median; `gaps`: by length (`GAPS`) how often nothing ran, and its
    seconds.

    Args:
      steps: how many of its units `call` makes.
    """
    with tempfile.TemporaryDirectory() as folder:
        with jax.profiler.trace(folder):
            jax.block_until_ready(call())
        events = [(start, duration, name) for start, duration, name, _ in _events(folder, marked=True)]
    durations: dict[str, list[float]] = collections.defaultdict(list)
    for _, duration, name in events:
        durations[name].append(duration / 1e9)
    kernels = {
        name: {"times": len(each), "total": sum(each), "least": min(each), "median": float(np.median(each))}
        for name, each in sorted(durations.items(), key=lambda item: -sum(item[1]))
    }
    idle = np.array([gap for _, gap in _pauses(events)]) / 1e9
    which = np.digitize(idle, GAPS)
    gaps = {
        name: {"times": int((which == k).sum()), "total": float(idle[which == k].sum())}
        for k, name in enumerate(GAP_NAMES)
    }
    busy, span = _busy(events)
    row = {"steps": steps, "busy": busy / 1e9, "idle": (span - busy) / 1e9}
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(json.dumps({**row, "gaps": gaps, "kernels": kernels}, indent=1) + "\n")


def _events(folder: str, marked: bool = False) -> list[tuple[float, float, str, str]]:
    """Start and duration in ns, name and stream of what ran on the first GPU. `marked`: Warp's kernels begin with
    `WARP_MARK`."""
    file = next(pathlib.Path(folder).rglob("*.xplane.pb"))
    found: list[tuple[float, float, str, str]] = []
    planes = {plane.name: plane for plane in jax.profiler.ProfileData.from_file(str(file)).planes}
    for name in sorted(name for name in planes if "GPU:" in name):
        for line in planes[name].lines:
            if line.name.startswith("Stream"):
                for e in line.events:
                    short, of_warp = WARP_NAME.subn("", e.name)
                    mark = WARP_MARK if marked and of_warp else ""
                    found.append((e.start_ns, e.duration_ns, mark + short + _copied(e), line.name))
        if found:
            break
    return sorted(found)


def _copied(event: Any) -> str:
    """Of a copy how many MB it copied, so that its array can be found."""
    if not event.name.startswith("Memcpy"):
        return ""
    size = re.search(r"size:(\d+)", " ".join(str(value) for _, value in event.stats))
    return f" {int(size[1]) / 1e6:.2f} MB" if size else ""


def _copies(events: list[tuple[float, float, str]]) -> list[tuple[tuple[str, str, str], tuple[float, int]]]:
    """Copies with what began before and after them: nanoseconds and how often, the longest together first."""
    found: dict[tuple[str, str, str], tuple[float, int]] = {}
    for (_, _, before), (_, duration, name), (_, _, after) in zip(events, events[1:], events[2:], strict=False):
        if name.startswith("MemcpyD2D"):
            total, count = found.get((before, name, after), (0.0, 0))
            found[before, name, after] = total + duration, count + 1
    return sorted(found.items(), key=lambda item: -item[1][0])


def _gaps(events: list[tuple[float, float, str]]) -> list[tuple[tuple[str, str], tuple[float, int]]]:
    """Between which two nothing runs: nanoseconds and how often, the longest together first."""
    found: dict[tuple[str, str], tuple[float, int]] = {}
    for pair, gap in _pauses(events):
        total, count = found.get(pair, (0.0, 0))
        found[pair] = total + gap, count + 1
    return sorted(found.items(), key=lambda item: -item[1][0])


def _pauses(events: list[tuple[float, float, str]]) -> Iterator[tuple[tuple[str, str], float]]:
    """Every pause in which nothing runs: what ran before and what after it, and nanoseconds."""
    until, last = (events[0][0], "") if events else (0.0, "")
    for start, duration, name in events:
        if start > until:
            yield (last, name), start - until
        if start + duration > until:
            until, last = start + duration, name


def _busy(events: list[tuple[float, float, str]]) -> tuple[float, float]:
    """Nanoseconds in which something runs, and from the first start to the last end."""
    if not events:
        return 0.0, 0.0
    busy, until = 0.0, events[0][0]
    for start, duration, _ in events:
        end = start + duration
        busy += max(0.0, end - max(start, until))
        until = max(until, end)
    return busy, until - events[0][0]
