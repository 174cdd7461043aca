"""Where arrays without elements lie does not decide which CUDA graph Warp replays (`engine.warp.patches.graphs`)."""

from __future__ import annotations

import contextlib

import jax
import jax.numpy as jnp
import pytest
import warp as wp

from ig2mj.engine.warp import patches
from ig2mj.engine.warp.engine import WarpEngine
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
