"""Counts CUDA graphs that Warp captures and programs that XLA compiles: each costs a processor up to a second."""

from __future__ import annotations

import time
from typing import Any

import jax
import warp as wp


class Counts:
    """Of this process: graphs that Warp captured, seconds of that, and programs that XLA compiled or found cached."""

    def __init__(self) -> None:
        self.graphs, self.seconds, self.programs, self._began = 0, 0.0, 0, 0.0
        enter, leave = wp.ScopedCapture.__enter__, wp.ScopedCapture.__exit__

        def begin(capture: Any) -> Any:
            self._began = time.perf_counter()
            return enter(capture)

        def end(capture: Any, *failure: Any) -> None:
            leave(capture, *failure)
            self.graphs, self.seconds = self.graphs + 1, self.seconds + time.perf_counter() - self._began

        def compiled(event: str, duration_secs: float, **kwargs: str | int) -> None:
            self.programs += event == "/jax/core/compile/backend_compile_duration"

        capture: Any = wp.ScopedCapture
        capture.__enter__, capture.__exit__ = begin, end
        jax.monitoring.register_event_duration_secs_listener(compiled)

    def now(self) -> tuple[int, float, int]:
        return self.graphs, self.seconds, self.programs
