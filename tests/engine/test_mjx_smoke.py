"""What of the Warp engine can be tried in seconds: that it is made, starts and can be traced."""

from __future__ import annotations

import engine_bench
import jax
import numpy as np
import pytest

from ig2mj.engine import make_engine


@pytest.fixture(scope="module")
def engine(tmp_path_factory):
    return make_engine("warp", engine_bench.bench_home(tmp_path_factory.mktemp("small"), small=True), 2)


def test_the_warp_engine_starts_and_traces_on_a_processor(engine):
    physics = engine.reset()
    assert np.isfinite(np.asarray(physics.data.qpos)).all()
    traced = jax.make_jaxpr(lambda p: engine.step(p)[1].object_pos)(physics)
    assert [a.shape for a in traced.out_avals] == [(2, engine.tables.num_objects, 3)]


def test_the_start_is_committed_to_no_device(engine):
    """Or a program would be compiled once for the start and once more for what follows from it."""
    assert not [a for a in jax.tree.leaves((engine.reset(), engine.model)) if getattr(a, "committed", False)]


def test_two_engines_of_a_scene_begin_with_the_same_bytes(engine):
    """What a program holds as a constant must not be whatever stood in memory, or no cache would know it again."""
    litter = [np.full(size, 0x5A5A5A5A, np.int32) for size in range(1, 40_000, 7)]  # memory that is given back as it is
    del litter
    other = make_engine("warp", engine.scene, 2)
    for one, two in zip(jax.tree.leaves(engine.reset()), jax.tree.leaves(other.reset()), strict=True):
        assert np.asarray(one).tobytes() == np.asarray(two).tobytes()
