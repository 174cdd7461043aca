"""Worlds of the tiny home on the native engine, and of the bench on Warp."""

from __future__ import annotations

import pathlib

import engine_bench
import jax
import numpy as np
import pytest

from ig2mj.states.initial import initial_states
from ig2mj.states.model import StateModel
from ig2mj.worlds.pool import Pool


@pytest.fixture(scope="session")
def bench_folder(tmp_path_factory) -> pathlib.Path:
    return tmp_path_factory.mktemp("bench")


@pytest.fixture(scope="session")
def home_model(tiny_home) -> StateModel:
    return StateModel.of_manifest(tiny_home.tables, tiny_home.manifest)


@pytest.fixture(scope="session")
def bench_pool(bench_folder) -> Pool:
    """Three states of the small bench: the box at x = -0.1, 0 and 0.1."""
    bench = engine_bench.bench(bench_folder, "native", 1)
    model = StateModel.of_manifest(bench.scene.tables, bench.scene.manifest)
    rows = []
    for x in (-0.1, 0.0, 0.1):
        physics = bench.write(bench.fresh(), bench.teleport("box", [x, 0, 0.451]))
        physics, view = bench.run(physics, 40)
        assert not view.awake.any()
        rows.append(bench.engine.export(physics, 0))
    physics = jax.tree.map(lambda *r: np.stack(r), *rows)
    return Pool(physics=physics, states=initial_states(model, 3))
