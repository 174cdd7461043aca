"""The kinds of convex pairs side by side: each kind's kernel in a branch of the CUDA graph of its own.

MuJoCo Warp launches a kernel for each pair of types of geoms, one after the other, and each takes as long as its
slowest pair, 100 to 250 us, while most of the GPU has nothing to do. Here they are launched on streams of their own
that begin where the broad phase ends; collision detection goes on when all have ended. They share buffers: places in
them come from one counter for all kinds (upstream has one for each, and uses the same places again).
"""

from __future__ import annotations

import threading
from collections.abc import Sequence
from typing import Any

import warp as wp
from mujoco.mjx.third_party.mujoco_warp._src import collision_convex, collision_driver

from ig2mj.engine.warp.patches import launching
from ig2mj.engine.warp.patches.replacements import original

MOST = 8
"""Streams of a device; further kernels follow the first ones."""

_here = threading.local()
_streams: dict[str, list[wp.Stream]] = {}
_lock = threading.Lock()


def ccd_kernel_builder(*arguments: Any) -> wp.Kernel:
    """The kernel of a kind, with the first counter of places; upstream's has one for each kind."""
    first, second, gjk, epa, multiple, _, block, warn = arguments
    return original(collision_convex, "ccd_kernel_builder")(first, second, gjk, epa, multiple, 0, block, warn)


def convex_narrowphase(m: Any, d: Any, ctx: Any, collision_table: Any) -> None:
    """As upstream, with each kernel on the next stream."""
    device = d.geom_xpos.device
    if not device.is_cuda:
        original(collision_driver, "convex_narrowphase")(m, d, ctx, collision_table)
        return
    streams, main = _streams_of(device), device.stream
    used: list[wp.Stream] = []

    def branch(kernel: wp.Kernel, inputs: Sequence[Any]) -> wp.Stream | None:
        if "ccd_kernel" not in kernel.key:
            return None
        stream = streams[len(used) % len(streams)]
        if stream not in used:
            stream.wait_stream(main)
        used.append(stream)
        _here.kept.append(inputs)  # freed where the branches have joined, and not at the end of upstream's function
        return stream

    with launching.branching(branch):
        original(collision_driver, "convex_narrowphase")(m, d, ctx, collision_table)
    _here.used = used


def narrowphase(m: Any, d: Any, ctx: Any) -> None:
    """As upstream; other pairs are looked at beside the convex ones, on the stream that was there."""
    _here.kept, _here.used = [], []
    try:
        original(collision_driver, "_narrowphase")(m, d, ctx)
        for stream in dict.fromkeys(_here.used):
            d.geom_xpos.device.stream.wait_stream(stream)
    finally:
        _here.kept, _here.used = [], []


def _streams_of(device: Any) -> list[wp.Stream]:
    with _lock:
        if device.alias not in _streams:
            _streams[device.alias] = [wp.Stream(device) for _ in range(MOST)]
        return _streams[device.alias]
