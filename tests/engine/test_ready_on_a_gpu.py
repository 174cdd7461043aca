"""What an engine does on a GPU before its first step, on a machine that has none."""

from __future__ import annotations

import pytest
import warp as wp
from gpu_stand_in import ARCHITECTURE, Memory, gpu_of_jax, gpu_of_warp

from ig2mj.engine.warp import ahead, kernels, tiles
from ig2mj.engine.warp.engine import WarpEngine
from ig2mj.engine.warp.patches import scratch
from ig2mj.process import prepare_warp


@pytest.fixture
def engine(tiny_home, monkeypatch) -> WarpEngine:
    """Knows the launches of a GPU; each time it is asked it takes and gives back a kilobyte."""
    engine = WarpEngine(tiny_home, 2)
    there = ahead.launches_on_gpu(engine)[:6]

    def launches(counter: scratch.Counter) -> list[kernels.Launch]:
        counter.deallocate(counter.allocate(1000), 1000)
        return there

    monkeypatch.setattr(engine, "launches", launches)
    return engine


@pytest.fixture
def loaded(monkeypatch) -> list:
    """Of each module that is to be loaded the device and the number of threads; of tiles the architecture."""
    noted = []
    monkeypatch.setattr(wp, "force_load", lambda on, modules, block_dim, max_workers: noted.append((on, block_dim)))
    monkeypatch.setattr(tiles, "builder", lambda launches, architecture: lambda: noted.append(architecture))
    return noted


@pytest.mark.parametrize("beforehand", [True, "meanwhile"])
def test_an_engine_gets_ready_on_a_gpu(engine, loaded, monkeypatch, beforehand):
    memory = Memory()
    gpu = gpu_of_warp(memory)
    monkeypatch.setattr(wp, "get_cuda_device", lambda number: {0: gpu}[number])
    monkeypatch.setattr(scratch, "_arenas", {})
    engine._get_ready(gpu_of_jax(), beforehand)
    kernels.load(engine.launches(scratch.Counter(memory)), gpu)  # begins when the others have ended
    block = engine._scratch
    assert block >= 2 * 1000 and memory.taken[1] == block, "memory for two worlds is taken"
    assert loaded.count(ARCHITECTURE) == 2
    assert all(item[0] is gpu for item in loaded if isinstance(item, tuple))


def test_tiles_are_made_for_what_warp_compiles_for(loaded):
    prepare_warp()
    for gpu in (gpu_of_warp(Memory()), gpu_of_warp(Memory(), newer_driver=True)):
        kernels.load([], gpu)
        assert gpu.get_cuda_compile_arch() in loaded
    oldest = wp.get_device("cpu").runtime.default_ptx_arch
    made = [architecture for architecture in loaded if not isinstance(architecture, tuple)]
    assert made == [ARCHITECTURE, min(ARCHITECTURE, oldest)]
