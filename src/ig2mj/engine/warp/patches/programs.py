"""Which functions a program of JAX runs when it calls MuJoCo Warp: ours or the original ones.

MJX registers a Python function with XLA while JAX traces a program. XLA calls it later, in threads of its own: on a CPU
in every step, on a GPU for each new set of buffers, while Warp captures a CUDA graph that is replayed from then on.
So what stands in MuJoCo Warp's modules counts at the call and not at the trace, and the choice must travel with the
registered function. MJX keeps one registration per function; ours is another function and gets one of its own, so that
no other user of MJX in the process ever calls it.
"""

from __future__ import annotations

import contextlib
import functools
import threading
from collections.abc import Callable, Iterator
from typing import Any

from mujoco.mjx.warp import ffi

from ig2mj.engine.warp.patches import pins
from ig2mj.engine.warp.patches.replacements import KERNELS
from ig2mj.engine.warp.patches.scope import ScopedReplacement
from ig2mj.engine.warp.patches.scratch import used

REGISTER = "jax_callable_variadic_tuple"
"""Name of MJX's function that registers another with XLA."""

_here = threading.local()
_registrations = ScopedReplacement()


@functools.cache
def _choosing(function: Callable[..., Any], own: bool) -> Callable[..., Any]:
    """The function with MuJoCo Warp's functions chosen while it runs. The same one each time, so that MJX finds it."""

    from ig2mj.engine.warp.patches.resting import noted  # not before: it needs names that may not exist

    @functools.wraps(function)
    def run(*args: Any, **kwargs: Any) -> Any:
        if not own:
            with KERNELS.entered(False):
                return function(*args, **kwargs)
        with KERNELS.entered(True), noted(), used():
            return function(*args, **kwargs)

    return run


def _register(function: Callable[..., Any], *args: Any, **kwargs: Any) -> Any:
    return _registrations.original(ffi, REGISTER)(_choosing(function, _here.own), *args, **kwargs)


_registrations.add({(ffi, REGISTER): _register})


@contextlib.contextmanager
def traced_with(own: bool) -> Iterator[None]:
    """What this thread traces inside the block runs, whenever it does, with our functions or (not `own`) upstream's."""
    if pins.obstacles():  # MJX may register its functions in another way
        yield
        return
    before = getattr(_here, "own", False)
    _here.own = own
    try:
        with _registrations.entered():
            yield
    finally:
        _here.own = before
