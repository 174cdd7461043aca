"""Repairs of Warp 1.18 as JAX uses it. Each applies to the whole process and does not affect other users of Warp.

CUDA streams that belong to JAX stay known to Warp. Warp wraps JAX's stream in an object for each call and forgets the
stream when the object goes away. Two calls that overlap on one stream, as they do when JAX dispatches ahead, then fail
with "unknown stream": the first to end takes the stream from the other. Keeping them costs nothing: JAX has a handful
of streams, which live as long as it.

Python's garbage collector is off while Warp captures a CUDA graph. A capture runs Python code for up to seconds, so
that the collector runs in it, in the capturing thread. Compiled programs of JAX in reference cycles (an engine that was
dropped is one) are destroyed then, and XLA unloads their CUDA modules, which CUDA forbids while the thread captures:
"CUDA_ERROR_STREAM_CAPTURE_UNSUPPORTED: Failed to unload module", and the next launch fails with error 901, since the
capture is lost. (Warp delays unloading its own modules; it cannot know of XLA's.)

JAX's devices are found by their number in this process. Warp takes their number among the devices of all processes of
`jax.distributed`, finds no such GPU in the second process, and so loads no kernels beforehand there: the first call
would load them while it captures a graph.

With the second repair a capture also waits for kernels that other threads are still loading (`AWAITED`), since one that
needs them would load them itself, one after the other.
"""

from __future__ import annotations

import concurrent.futures
from typing import Any

import warp as wp

from ig2mj.process.gc_pause import GC_PAUSED

_REPAIRED = "_ig2mj_repaired"


AWAITED: set[concurrent.futures.Future] = set()
"""What must have ended, well or not, before Warp captures a graph."""


def keep_external_streams() -> None:
    """Applies the first repair, once per process."""
    if getattr(wp.Stream, _REPAIRED, False):
        return
    forget = wp.Stream.__del__

    def forget_own(self: Any) -> None:
        if self.owner:
            forget(self)

    wp.Stream.__del__ = forget_own
    setattr(wp.Stream, _REPAIRED, True)


def collect_nothing_during_captures() -> None:
    """Applies the second repair, once per process."""
    if getattr(wp.ScopedCapture, _REPAIRED, False):
        return
    enter, leave = wp.ScopedCapture.__enter__, wp.ScopedCapture.__exit__

    def enter_without_collector(self: Any) -> Any:
        concurrent.futures.wait(list(AWAITED))
        GC_PAUSED.begin()
        try:
            return enter(self)
        except BaseException:
            GC_PAUSED.end()
            raise

    def leave_and_collect(self: Any, exc_type: Any, exc_value: Any, traceback: Any) -> None:
        try:
            leave(self, exc_type, exc_value, traceback)
        finally:
            GC_PAUSED.end()

    wp.ScopedCapture.__enter__ = enter_without_collector
    wp.ScopedCapture.__exit__ = leave_and_collect
    setattr(wp.ScopedCapture, _REPAIRED, True)


def find_devices_of_this_process() -> None:
    """Applies the third repair, once per process."""
    if getattr(wp.device_from_jax, _REPAIRED, False):
        return
    find = wp.device_from_jax

    def find_local(jax_device: Any) -> Any:
        return wp.get_cuda_device(jax_device.local_hardware_id) if jax_device.platform == "gpu" else find(jax_device)

    setattr(find_local, _REPAIRED, True)
    wp.device_from_jax = find_local
