"""How Warp finds the CUDA graph that it captured of a call, and how many it keeps.

A step of MuJoCo, or its cameras, is one call that JAX makes from within a compiled program. Warp captures it as a CUDA
graph, which takes 65 ms for a step of a home, and replays that graph whenever all arrays of the call are at the
addresses of the capture. Arrays without elements count, too, and XLA gives them another address in most calls. A step
has dozens of them (of flexes, tendons and sensors that a scene does not have), so that captures may never end where an
iteration of a training is two programs. Here only arrays with elements count, and those of one element do not move
(`ig2mj.engine.warp.patches.counters`).
"""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Iterator
from typing import Any

import warp as wp

from ig2mj.engine.warp.patches import counters
from ig2mj.engine.warp.patches.scope import ScopedReplacement
from ig2mj.engine.warp.patches.table import runs

GRAPHS = 128
"""CUDA graphs of a call that are kept for each scene and number of worlds. Warp keeps 32. An environment that is
stepped from Python may alternate between more, as JAX gives it other buffers, and would capture one in every step. All
scenes share the call, and where homes take turns, a limit for all together would drop the graphs of those that wait."""

_callables = ScopedReplacement()


class Filled:
    """A function of Warp that JAX calls, whose graphs are found by where its arrays with elements lie."""

    def __init__(self, call: Any):
        """`call`: what `wp.jax_callable` gives; it reads its `array_input_indices` only to find graphs."""
        self._call, self._indices = call, tuple(call.array_input_indices)
        self._seen, self._lock = set[int](), threading.Lock()
        self._kinds = set[tuple[tuple[int, ...], ...]]()

    def __call__(self, *args: Any, **kwargs: Any) -> Any:
        """Traces a call. An array that has elements in any call traced so far counts in all of them."""
        with self._lock:
            self._seen.update(k for k in self._indices if args[k].size)
            counters.note(self._call, {k: args[k] for k in self._indices})
            self._call.array_input_indices = [k for k in self._indices if k in self._seen]
            self._kinds.add(tuple(args[k].shape for k in self._indices))
            self._call.graph_cache_max = GRAPHS * len(self._kinds)
        return self._call(*args, **kwargs)


def _callable(*args: Any, **kwargs: Any) -> Any:
    call = _callables.original(wp, "jax_callable")(*args, **{"graph_cache_max": GRAPHS, **kwargs})
    return Filled(call) if hasattr(call, "array_input_indices") else call


_callables.add({(wp, "jax_callable"): _callable})


@contextlib.contextmanager
def graphs_kept() -> Iterator[None]:
    """Calls of Warp that this thread traces inside the block find their graphs by arrays with elements alone.

    MJX registers a function once. Its cameras are the same functions for all users in the process: whether they find
    graphs in this way is decided by the first user.
    """
    with _callables.entered(runs("graphs")), counters.counters_in_place(runs("graphs")):
        yield
