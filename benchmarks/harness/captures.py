"""Counts CUDA graphs that Warp captures and programs that XLA compiles: each costs a processor up to a second.

`Moves` also tells which arrays lay elsewhere, for which Warp captures a graph again."""

from __future__ import annotations

import collections
import sys
import time
from typing import Any

import jax
import warp as wp
from warp._src.jax.ffi import FfiCallable


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


class Moves:
    """Which arrays of Warp's calls lay elsewhere than at the call's last capture; `rows`: one for each capture.

    Made before the first program that calls Warp. Reads local variables of Warp's callback, so it is for Warp 1.18.
    """

    def __init__(self) -> None:
        self.rows, self._last = list[dict[str, Any]](), dict[tuple[str, int], list[int]]()
        moves, made = self, FfiCallable.__init__

        class Kept(collections.OrderedDict):
            def __init__(self, name: str) -> None:
                super().__init__()
                self.name = name

            def __setitem__(self, key: Any, value: Any) -> None:
                if key not in self:
                    moves.note(self.name, sys._getframe(1).f_locals)
                super().__setitem__(key, value)

        def begin(call: Any, *given: Any, **named: Any) -> None:
            made(call, *given, **named)
            call.captures = Kept(call.name)

        hooked: Any = FfiCallable
        hooked.__init__ = begin

    def note(self, name: str, found: dict[str, Any]) -> None:
        """A capture. `found`: the callback's variables."""
        places = [place or 0 for place in (*found["ip"], *found["op"])]  # an array without elements may lie nowhere
        call = found["self"]
        names = [call.input_args[k].name for k in call.array_input_indices]
        names += [f"output {k}" for k in call.array_output_indices]
        before = self._last.get((name, found["call_id"]))
        self._last[name, found["call_id"]] = places
        row: dict[str, Any] = {"call": name, "id": found["call_id"], "arrays": len(places), "inputs": len(found["ip"])}
        if before is not None:
            by: collections.Counter[int] = collections.Counter()
            which = collections.defaultdict[int, list[str]](list)
            for called, old, new in zip(names, before, places, strict=True):
                if new != old:
                    by[new - old] += 1
                    which[new - old].append(called)
            row["moved_by"] = [[bytes_, count, which[bytes_][:8]] for bytes_, count in by.most_common(6)]
            row["moved"] = sum(by.values())
        self.rows.append(row)
