"""The convex kernels of all kinds side by side: each in a branch of its own of the CUDA graph.

MuJoCo Warp launches a kernel for each pair of geom types, one after the other, and each takes as long as its slowest
pair, 100 to 250 us, while most of the GPU is idle. Here they are launched on streams of their own that begin where the
broad phase ends; collision detection continues when all have ended. They share buffers: places in them come from one
counter for all kinds (upstream has one for each, and uses the same places again).
"""

from __future__ import annotations

import threading
from collections.abc import Iterator
from typing import Any

import warp as wp
from mujoco.mjx.third_party.mujoco_warp._src import collision_convex, collision_driver

from ig2mj.engine.warp.patches import pair_lists, phases
from ig2mj.engine.warp.patches.replacements import original
from ig2mj.engine.warp.patches.scope import ScopedReplacement
from ig2mj.engine.warp.patches.table import runs

MOST = 8
"""Streams of a device; further kernels follow the first ones."""

ON_PROCESSORS = False
"""Whether the same is done on a CPU, where nothing is gained: tests compare contacts."""

_here = threading.local()
_streams: dict[str, list[wp.Stream]] = {}
_lock = threading.Lock()


def ccd_kernel_builder(*arguments: Any) -> wp.Kernel:
    """The kernel of a kind, with the first counter of places; upstream's has one for each kind."""
    first, second, gjk, epa, multiple, _, block, warn = arguments
    kernel = original(collision_convex, "ccd_kernel_builder")(first, second, gjk, epa, multiple, 0, block, warn)
    phases.note(kernel, (first, second, gjk, epa, multiple, 0, block, warn))
    return kernel


def convex_narrowphase(m: Any, d: Any, ctx: Any, collision_table: Any) -> None:
    """As upstream, with each kernel on the next stream."""
    device = d.geom_xpos.device
    if not (wp.get_device(device.alias).is_cuda or ON_PROCESSORS):  # `ahead` answers for a GPU that is not there
        original(collision_driver, "convex_narrowphase")(m, d, ctx, collision_table)
        return
    calls = _calls(m, d, ctx, collision_table)
    kinds = [phases.kind(call["kernel"]) for call in calls]
    for call, kind in zip(calls, kinds, strict=True):
        if kind is None:  # of height fields
            wp.launch(**call)
    convex = [call for call, kind in zip(calls, kinds, strict=True) if kind is not None]
    if not convex:
        return
    # All memory is there and counts are 0 before the streams begin: what comes later on this one, they do not wait for.
    if runs("pair_lists"):
        lists = pair_lists.listed_by_kind(m, d, ctx, [kind for kind in kinds if kind is not None])
        for call, pairs in zip(convex, lists, strict=True):
            call["inputs"] = _of_list(m, d, ctx, call["inputs"], pairs)
    launches = [[call] for call in convex]
    if runs("phases"):
        memory = phases.handover(d, len(convex))
        launches = [phases.launches(d, call, memory, number) for number, call in enumerate(convex)]
    _here.kept = [convex, launches]  # freed where the branches have joined, and not at the end of this function
    for of_kind, options in zip(launches, _in_turn(device), strict=False):
        for launch in of_kind:
            wp.launch(**{**launch, **options})


def narrowphase(m: Any, d: Any, ctx: Any) -> None:
    """As upstream; other pairs are processed alongside the convex ones, on the stream that was current before."""
    _here.kept, _here.used, _here.calls = [], [], []
    try:
        original(collision_driver, "_narrowphase")(m, d, ctx)
        for stream in dict.fromkeys(_here.used):
            d.geom_xpos.device.stream.wait_stream(stream)
    finally:
        _here.kept, _here.used, _here.calls = [], [], []


def _calls(m: Any, d: Any, ctx: Any, collision_table: Any) -> list[dict[str, Any]]:
    """What upstream would launch: the arguments of each `warp.launch`."""
    _here.calls = []
    with _noting.entered():
        original(collision_driver, "convex_narrowphase")(m, d, ctx, collision_table)
    return _here.calls


def _note(kernel: wp.Kernel, dim: Any, inputs: Any, outputs: Any, **options: Any) -> None:
    _here.calls.append({"kernel": kernel, "dim": dim, "inputs": list(inputs), "outputs": list(outputs)} | options)


def _block_size(kernel: wp.Kernel, device: Any) -> tuple[int, int]:
    if phases.kind(kernel) and runs("phases"):
        return 1, 1  # both phases are launched in its place, and the true number would have it compiled
    return _noting.original(wp, "get_suggested_block_size")(kernel, device)


_noting = ScopedReplacement()
_noting.add({(wp, "launch"): _note, (wp, "get_suggested_block_size"): _block_size})


def _of_list(m: Any, d: Any, ctx: Any, inputs: list[Any], pairs: pair_lists.PairList) -> list[Any]:
    """Inputs of a kernel with a kind's own pairs in place of all."""
    own = {
        id(d.ncollision): pairs.count,
        id(ctx.collision_pair): pairs.pair,
        id(ctx.collision_pairid): pairs.pairid,
        id(ctx.collision_worldid): pairs.world,
    }
    replaced = [own.get(id(value), value) for value in inputs]
    assert sum(a is not b for a, b in zip(inputs, replaced, strict=True)) == len(own)
    return replaced


def _in_turn(device: Any) -> Iterator[dict[str, Any]]:
    """The stream of each kernel, as an option of `warp.launch`; without a GPU none."""
    if not (device.is_cuda and runs("branches")):
        while True:
            yield {}
    streams, main = _streams_of(device), device.stream
    while True:
        stream = streams[len(_here.used) % len(streams)]
        if stream not in _here.used:
            stream.wait_stream(main)
        _here.used.append(stream)
        yield {"stream": stream}


def _streams_of(device: Any) -> list[wp.Stream]:
    with _lock:
        if device.alias not in _streams:
            _streams[device.alias] = [wp.Stream(device) for _ in range(MOST)]
        return _streams[device.alias]
