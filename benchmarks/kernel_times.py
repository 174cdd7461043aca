"""Where a GPU's time goes: device time by kernel, and the time in which nothing runs.

CUPTI sees kernels inside CUDA graphs too, so XLA's and Warp's are listed side by side. `--kernels N` of
`throughput.py`, `environments.py` and `learner.py` prints the N longest after their rows.
"""

from __future__ import annotations

import collections
import pathlib
import re
import tempfile
import time
from collections.abc import Callable
from typing import Any

import jax

WARP_NAME = re.compile(r"_[0-9a-f]{8}_cuda_kernel_forward|_cuda_kernel_forward")


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


def _events(folder: str) -> list[tuple[float, float, str, str]]:
    """Start and duration in ns, name and stream of what ran on the first GPU."""
    file = next(pathlib.Path(folder).rglob("*.xplane.pb"))
    found = []
    for plane in jax.profiler.ProfileData.from_file(str(file)).planes:
        if "GPU:0" not in plane.name:
            continue
        for line in plane.lines:
            if line.name.startswith("Stream"):
                found += [
                    (e.start_ns, e.duration_ns, WARP_NAME.sub("", e.name) + _copied(e), line.name) for e in line.events
                ]
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
    until, last = (events[0][0], "") if events else (0.0, "")
    for start, duration, name in events:
        if start > until:
            total, count = found.get((last, name), (0.0, 0))
            found[last, name] = total + start - until, count + 1
        if start + duration > until:
            until, last = start + duration, name
    return sorted(found.items(), key=lambda item: -item[1][0])


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
