"""Engines on the bench scene, made once per run."""

from __future__ import annotations

import pathlib

import engine_bench
import pytest
import warp as wp

ENGINES = [
    "native",
    pytest.param("warp", marks=pytest.mark.slow),
    pytest.param("jax", marks=pytest.mark.slow),
]
"""The MJX engines compile for half a minute."""


@pytest.fixture(scope="session")
def bench_folder(tmp_path_factory) -> pathlib.Path:
    return tmp_path_factory.mktemp("bench")


@pytest.fixture(params=ENGINES)
def small(request, bench_folder) -> engine_bench.Bench:
    """Table, box and knife in two worlds, on each engine in turn."""
    return engine_bench.bench(bench_folder, request.param)


@pytest.fixture(params=ENGINES[:2])
def full(request, bench_folder) -> engine_bench.Bench:
    """The whole bench with its hand in two worlds, on the engines that can sleep."""
    return engine_bench.bench(bench_folder, request.param, 2, False)


@pytest.fixture(params=["cpu", pytest.param("cuda", marks=pytest.mark.gpu)])
def kernel_device(request):
    """Warp's device while the test runs. On the CPU a block has one thread: barriers and atomics are not tested."""
    if request.param == "cuda" and not wp.is_cuda_available():
        pytest.skip("Warp sees no CUDA device; on a machine that has one: make test-gpu")
    device = wp.get_cuda_device() if request.param == "cuda" else wp.get_device("cpu")
    with wp.ScopedDevice(device):
        yield device
