"""How Warp finds the CUDA graph that it captured of a call, and how many it keeps.

A step of MuJoCo, or its cameras, is one call that JAX makes from within a compiled program. Warp captures it as a CUDA
graph, 65 ms of a processor for a step of a home, and replays that graph wherever all arrays of the call lie where they
lay at the capture. Arrays without elements count, too, and XLA gives them whatever place comes to hand, another one in
most calls. A step has dozens of them (of flexes, tendons and sensors that a scene does not have), and where an
iteration of a training is two programs, captures therefore did not end. Here only arrays with elements count.
"""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Iterator
from typing import Any

import warp as wp

from ig2mj.engine.warp.patches.scope import ScopedReplacement
from ig2mj.engine.warp.patches.table import runs

GRAPHS = 128
"""CUDA graphs of a call that are kept. Warp keeps 32; an environment that is stepped from Python may need more in turn,
as JAX gives it other buffers, and would capture each anew in every step."""

_callables = ScopedReplacement()


class Filled:
    """A function of Warp that JAX calls, whose graphs are found by where its arrays with elements lie."""

    def __init__(self, call: Any):
        """`call`: what `wp.jax_callable` gives; it reads its `array_input_indices` for nothing else."""
        self._call, self._indices = call, tuple(call.array_input_indices)
        self._seen, self._lock = set[int](), threading.Lock()

    def __call__(self, *args: Any, **kwargs: Any) -> Any:
        """Traces a call. An array that has elements in any call traced so far counts in all of them."""
        with self._lock:
            self._seen.update(k for k in self._indices if args[k].size)
            self._call.array_input_indices = [k for k in self._indices if k in self._seen]
        return self._call(*args, **kwargs)


def _callable(*args: Any, **kwargs: Any) -> Any:
    call = _callables.original(wp, "jax_callable")(*args, **{"graph_cache_max": GRAPHS, **kwargs})
    return Filled(call) if hasattr(call, "array_input_indices") else call


_callables.add({(wp, "jax_callable"): _callable})


@contextlib.contextmanager
def graphs_kept() -> Iterator[None]:
    """Calls of Warp that this thread traces inside the block find their graphs by arrays with elements alone.

    MJX keeps what it registered of a function. Its cameras are the same functions for everybody: theirs find graphs so
    for all users in the process, or for none where another one drew first.
    """
    with _callables.entered(runs("graphs")):
        yield
