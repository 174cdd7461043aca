"""Where arrays without elements lie does not decide which CUDA graph Warp replays (`engine.warp.patches.graphs`)."""

from __future__ import annotations

import contextlib
import ctypes
import types
from typing import ClassVar

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import warp as wp
from warp._src.jax import xla_ffi

from ig2mj.engine.warp import patches
from ig2mj.engine.warp.engine import WarpEngine
from ig2mj.engine.warp.patches import counters
from ig2mj.engine.warp.patches.graphs import GRAPHS, Filled, graphs_kept


def traced(call, *sizes):
    """Traces a call with arrays of these numbers of elements."""
    return jax.eval_shape(lambda *arrays: call(*arrays, output_dims=3), *(jnp.zeros(n) for n in sizes))


@pytest.fixture
def call() -> Filled:
    def sum_of(first: wp.array(dtype=float), second: wp.array(dtype=float), out: wp.array(dtype=float)) -> None:
        """Another one for each test, since Warp keeps what it made of a function; it is traced and never called."""

    sum_of.__annotations__ = {name: wp.array(dtype=float) for name in ("first", "second", "out")}
    with graphs_kept():
        return wp.jax_callable(sum_of)


def test_what_has_no_elements_does_not_count(call):
    traced(call, 3, 0)
    assert call._call.array_input_indices == [0]


def test_what_has_elements_in_any_call_counts_in_all(call):
    traced(call, 3, 0)
    traced(call, 0, 3)
    assert call._call.array_input_indices == [0, 1]
    traced(call, 3, 0)
    assert call._call.array_input_indices == [0, 1]


def test_more_graphs_are_kept_than_warp_would(call):
    assert call._call.graph_cache_max == GRAPHS > 32


def test_outside_the_block_warp_is_as_it_came():
    original = wp.jax_callable
    with graphs_kept():
        assert wp.jax_callable is not original
    assert wp.jax_callable is original


@pytest.mark.slow
@pytest.mark.parametrize("kernels", ["own", "upstream"])
def test_a_step_of_an_engine_leaves_out_what_its_scene_does_not_have(tiny_home, monkeypatch, kernels):
    called = []

    def noted(filled, *arrays, **named):
        called.append((filled, arrays))
        return trace(filled, *arrays, **named)

    trace = Filled.__call__
    monkeypatch.setattr(Filled, "__call__", noted)
    with contextlib.nullcontext() if kernels == "own" else patches.upstream_kernels():
        engine = WarpEngine(tiny_home, 3)  # a number of worlds that no other test traces
    jax.jit(engine.step).trace(engine.reset())
    filled, arrays = called[-1]
    counted = set(filled._call.array_input_indices)
    inputs = filled._call.input_args
    empty = {inputs[k].name for k in filled._indices if not arrays[k].size}
    assert {"flexvert_xpos", "flexedge_J", "ten_J", "sensordata"} <= empty
    assert {inputs[k].name for k in counted} & {"qpos", "qvel", "xfrc_applied"} == {"qpos", "qvel", "xfrc_applied"}
    assert all(k in counted for k in filled._indices if arrays[k].size)
    assert len(counted) < len(filled._indices)
    single = {inputs[k].name for k in getattr(filled._call, counters.NAME)}
    assert {"nacon", "ncollision"} <= single


class Frame:
    """What XLA hands to a call: arrays at addresses of the host."""

    def __init__(self, *arrays):
        kinds = [ctypes.c_int64 * a.ndim for a in arrays]
        self._dims = [kind(*a.shape) for kind, a in zip(kinds, arrays, strict=True)]
        self.buffers = [
            xla_ffi.XLA_FFI_Buffer(data=a.ctypes.data, rank=a.ndim, dims=d)
            for a, d in zip(arrays, self._dims, strict=True)
        ]
        self._pointers = (ctypes.c_void_p * len(arrays))(*map(ctypes.addressof, self.buffers))
        frame = xla_ffi.XLA_FFI_CallFrame()
        frame.args.size = len(arrays)
        frame.args.args = ctypes.cast(self._pointers, ctypes.POINTER(ctypes.c_void_p))
        self.pointer = ctypes.pointer(frame)
        self.pointer.owner = self  # what it points to lives as long


@pytest.fixture
def counted(monkeypatch):
    """A call with a counter that it raises by one, and an array of three; addresses that it saw."""
    monkeypatch.setattr(xla_ffi, "get_device_ordinal_from_callframe", lambda frame: 0)
    monkeypatch.setattr(xla_ffi, "get_stream_from_callframe", lambda frame: None)
    monkeypatch.setattr(counters, "_copy", lambda ordinal, to, of, size, stream: ctypes.memmove(to, of, size))
    room = (ctypes.c_byte * 1024)()
    monkeypatch.setattr(counters.AtOnePlace, "_place", lambda self, ordinal, size: ctypes.addressof(room))

    class Call:
        graph_mode, num_inputs = wp.JaxCallableGraphMode.WARP, 2
        input_args = (types.SimpleNamespace(in_out=True), types.SimpleNamespace(in_out=False))
        seen: ClassVar[list] = []

        def ffi_callback(self, call_frame, platform):
            buffers = counters._buffers(call_frame.contents)
            self.seen.append([buffers[k].contents.data for k in range(2)])
            ctypes.cast(buffers[0].contents.data, ctypes.POINTER(ctypes.c_int32))[0] += 1

    call = Call()
    counters.note(call, {0: np.zeros(1, np.int32), 1: np.zeros(3, np.float32)})
    return call, counters.AtOnePlace(call.ffi_callback)


def test_a_counter_that_moves_is_seen_at_one_place_and_keeps_what_is_written(counted):
    call, callback = counted
    for value in (3, 7):
        counter, others = np.array([value], np.int32), np.zeros(3, np.float32)
        frame = Frame(counter, others)
        callback(frame.pointer, "CUDA")
        assert counter[0] == value + 1
        assert frame.buffers[0].data == counter.ctypes.data
        assert call.seen[-1][1] == others.ctypes.data
    assert call.seen[0][0] == call.seen[1][0]


def test_an_array_that_had_one_element_in_another_call_stays_where_it_is(counted):
    call, callback = counted
    several = np.arange(4, dtype=np.int32)
    callback(Frame(several, np.zeros(3, np.float32)).pointer, "CUDA")
    assert call.seen[-1][0] == several.ctypes.data


def test_counters_stay_where_no_graph_is_captured(counted):
    call, callback = counted
    counter = np.zeros(1, np.int32)
    callback(Frame(counter, np.zeros(3, np.float32)).pointer, "CPU")
    assert call.seen[-1][0] == counter.ctypes.data
