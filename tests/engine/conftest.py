"""Engines on the bench scene, made once per run."""

from __future__ import annotations

import pathlib

import engine_bench
import pytest

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
