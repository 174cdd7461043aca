"""Kernels compiled for a GPU that this machine does not have: Warp's compiler needs neither the card nor its driver.

A login node, or the build of a container image, can so do what a GPU would otherwise wait for. Only Warp's kernels are
compiled; XLA's programs need the card.
"""

from __future__ import annotations

from typing import Any

import warp as wp

from ig2mj.engine.warp import kernels, tiles
from ig2mj.engine.warp.engine import WarpEngine
from ig2mj.engine.warp.patches.scope import ScopedReplacement
from ig2mj.errors import EngineError
from ig2mj.process import prepare_warp


class _Gpu:
    """A device that says that it is a GPU: some of MuJoCo Warp's kernels are others there."""

    is_cuda, is_cpu = True, False

    def __init__(self, device: Any):
        self._device = device

    def __getattr__(self, name: str) -> Any:
        return getattr(self._device, name)


def check(architecture: int) -> None:
    """Raises an EngineError that lists what there is, where Warp's compiler does not know an architecture."""
    prepare_warp()
    known = wp.get_cuda_supported_archs()
    if architecture not in known:
        listed = ", ".join(map(str, known))
        raise EngineError(f"Warp cannot compile for GPUs of architecture {architecture}; it can for {listed}")


def launches_on_gpu(engine: WarpEngine) -> list[kernels.Launch]:
    """The kernels of the engine's step and of the cameras that see its worlds, as a GPU launches them, on a machine
    with or without one."""
    here = wp.get_device
    as_gpu = ScopedReplacement()
    as_gpu.add(
        {
            (wp, "get_device"): lambda *arguments: _Gpu(here(*arguments)),
            (wp, "is_conditional_graph_supported"): lambda: True,  # the driver would say so
        }
    )
    with as_gpu.entered():
        return [*engine.launches(), *engine.launches_of_others]


def compile_for(launches: list[kernels.Launch], architecture: int, workers: int | None = None) -> int:
    """Compiles the modules of kernels for an architecture into Warp's cache, side by side.

    Args:
      architecture: compute capability times ten, e.g. 90 for an H100 or H200.
      workers: threads; None: one for each processor of this process.

    Returns:
      How many modules the kernels need. Those that are in the cache are not compiled again.

    Raises:
      EngineError: see `check`.
    """
    check(architecture)
    by_size = kernels.modules_of(launches)

    def compile_module(module: wp.Module, sizes: list[int]) -> None:
        usual = module.options["block_dim"]
        try:
            for module.options["block_dim"] in sizes:
                wp.compile_aot_module(module, arch=architecture, use_ptx=False)
        finally:
            module.options["block_dim"] = usual

    kernels.side_by_side(
        by_size, compile_module, workers, tiles.builder(kernels.not_made(launches), architecture, workers)
    )
    return sum(map(len, by_size.values()))
