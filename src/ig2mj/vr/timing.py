"""`Timing`: where the time of each frame goes: physics, states, rendering, waiting (`ig2mj vr --timing`)."""

from __future__ import annotations

import collections
import contextlib
import time
from collections.abc import Iterator

import numpy as np

PARTS = ("physics", "states", "rendering", "waiting")
"""Of a frame: MuJoCo's steps; all else that a control step and its recording need; images or poses for viewers;
the rest until the next frame is due."""

WINDOW = 300
"""Frames that `summary` is about."""


class Timing:
    """Seconds of each part of the last frames. One thread writes; any may read."""

    def __init__(self) -> None:
        """No frames yet."""
        self._now: dict[str, float] = dict.fromkeys(PARTS, 0.0)
        self._rows: collections.deque[tuple[float, ...]] = collections.deque(maxlen=WINDOW)
        self.frames = 0

    @contextlib.contextmanager
    def part(self, name: str) -> Iterator[None]:
        """Counts what is done inside for a part, less what parts inside it count for themselves."""
        start, inner = time.perf_counter(), sum(self._now.values())
        try:
            yield
        finally:
            self._now[name] += time.perf_counter() - start - (sum(self._now.values()) - inner)

    def end_frame(self) -> None:
        """The frame is over."""
        self._rows.append(tuple(self._now.values()))
        self._now = dict.fromkeys(PARTS, 0.0)
        self.frames += 1

    def summary(self) -> dict[str, float]:
        """Mean milliseconds of each part, and of the slowest frame in a hundred altogether ("frame p99")."""
        rows = np.array(list(self._rows)) * 1000
        if not len(rows):
            return {}
        found = {name: float(value) for name, value in zip(PARTS, rows.mean(0), strict=True)}
        return found | {"frame p99": float(np.percentile(rows.sum(1), 99))}

    def line(self) -> str:
        """For people: one line."""
        return "   ".join(f"{name} {value:.1f} ms" for name, value in self.summary().items())
