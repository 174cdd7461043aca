"""Arrays of one element lie at one place in all captured CUDA graphs of a call.

Warp replays the graph that it captured of a call only where all arrays are at the addresses of the capture
(`ig2mj.engine.warp.patches.graphs`). XLA keeps the large arrays of a program in place, but not always those of a
single element, such as MuJoCo Warp's number of contacts of all worlds: it may put them into any chunk of 256 bytes
that is free, so that every iteration of a training in several homes captures graphs again. Here a call sees a copy of
such an array that never moves; what it writes is copied back. A copy takes some microseconds of the stream.
"""

from __future__ import annotations

import contextlib
import ctypes
import threading
from collections.abc import Iterator, Mapping
from typing import Any, no_type_check

import warp as wp
from warp._src.jax import ffi, xla_ffi

from ig2mj.engine.warp.patches.scope import ScopedReplacement

NAME = "ig2mj_counters"
"""Attribute of a call: bytes of its arrays that had one element when it was traced, by number of the input."""

STRIDE = 256
"""Bytes between two copies, as CUDA aligns memory."""

_registrations = ScopedReplacement()


class AtOnePlace:
    """What XLA calls for a function of Warp, with copies in place of arrays of one element."""

    def __init__(self, callback: Any):
        """`callback`: the method `ffi_callback` of what `wp.jax_callable` gives."""
        self._callback, self._call = callback, callback.__self__
        self._places, self._lock = dict[int, list[Any]](), threading.Lock()

    @no_type_check
    def __call__(self, call_frame: Any, platform: str) -> Any:
        """As `ffi_callback`. Where no graph is captured, the arrays stay where they are."""
        frame, counters = call_frame.contents, getattr(self._call, NAME, {})
        captures = platform == "CUDA" and self._call.graph_mode == wp.JaxCallableGraphMode.WARP
        if not (captures and counters and frame.args.size == self._call.num_inputs):
            return self._callback(call_frame, platform)
        try:
            return self._at_one_place(call_frame, platform, counters)
        except RuntimeError as e:
            text = f"{type(e).__name__}: {e}"
            return xla_ffi.create_ffi_error(frame.api, xla_ffi.XLA_FFI_Error_Code.UNKNOWN, text)

    @no_type_check
    def _at_one_place(self, call_frame: Any, platform: str, counters: Mapping[int, int]) -> Any:
        frame = call_frame.contents
        buffers = _buffers(frame)
        single = {k: size for k, size in counters.items() if _elements(buffers[k].contents) == 1}
        ordinal = xla_ffi.get_device_ordinal_from_callframe(frame)
        stream = xla_ffi.get_stream_from_callframe(frame)
        with self._lock:
            place = self._place(ordinal, STRIDE * len(counters))
            copies = {k: place + STRIDE * n for n, k in enumerate(sorted(counters)) if k in single}
            own = {k: buffers[k].contents.data for k in single}
            for k, size in single.items():
                _copy(ordinal, copies[k], own[k], size, stream)
                buffers[k].contents.data = copies[k]
            try:
                return self._callback(call_frame, platform)
            finally:
                for k, size in single.items():
                    buffers[k].contents.data = own[k]
                    if self._call.input_args[k].in_out:
                        _copy(ordinal, own[k], copies[k], size, stream)

    @no_type_check
    def _place(self, ordinal: int, room: int) -> int:
        """Where the copies on a device lie, `room` bytes."""
        blocks = self._places.setdefault(ordinal, [])
        if not blocks or blocks[-1].size < room:  # smaller ones stay: captured graphs use them
            # not zeros, which Warp's stream would write, perhaps after the first copy into it on XLA's
            blocks.append(wp.empty(room, dtype=wp.uint8, device=wp.get_cuda_device(ordinal)))
        return blocks[-1].ptr


@no_type_check
def note(call: Any, arrays: Mapping[int, Any]) -> None:
    """Notes which inputs of a call have one element. `arrays`: what it is traced with, by number of the input."""
    found = {k: a.dtype.itemsize for k, a in arrays.items() if a.size == 1}
    setattr(call, NAME, {**getattr(call, NAME, {}), **found})


@no_type_check
def _buffers(frame: Any) -> Any:
    return ctypes.cast(frame.args.args, ctypes.POINTER(ctypes.POINTER(xla_ffi.XLA_FFI_Buffer)))


@no_type_check
def _elements(buffer: Any) -> int:
    count = 1
    for k in range(buffer.rank):
        count *= buffer.dims[k]
    return count


@no_type_check
def _copy(ordinal: int, destination: int, source: int, size: int, stream: Any) -> None:
    runtime = wp._src.context.runtime
    if not runtime.core.wp_memcpy_d2d(wp.get_cuda_device(ordinal).context, destination, source, size, stream):
        raise RuntimeError(f"a counter cannot be copied: {runtime.get_error_string()}")


def _register(name: str, callback: Any) -> Any:
    return _registrations.original(ffi, "_register_ffi_targets")(name, AtOnePlace(callback))


_registrations.add({(ffi, "_register_ffi_targets"): _register})


@contextlib.contextmanager
def counters_in_place(active: bool) -> Iterator[None]:
    """Functions of Warp that this thread makes known to JAX inside the block keep their counters at one place."""
    with _registrations.entered(active):
        yield
