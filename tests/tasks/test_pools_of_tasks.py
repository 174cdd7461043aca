"""Pools of tasks: the same bytes from the same seeds, other states held out, everything within reach."""

from __future__ import annotations

import json

import numpy as np
import pytest

from ig2mj.errors import UnknownNameError
from ig2mj.tasks.activities import ACTIVITIES
from ig2mj.tasks.pools import (
    CHUNK,
    HASHES,
    MAX_CHUNKS,
    SEEDS,
    bare_scene,
    known_hash,
    limit_of,
    make_pool,
    pool_file,
    pool_hash,
    pool_of,
)
from ig2mj.tasks.variants import variant

TASK = ACTIVITIES["GraspingBook"]


@pytest.fixture
def cache(tmp_path, monkeypatch):
    monkeypatch.setenv("IG2MJ_CACHE_DIR", str(tmp_path))
    return tmp_path


@pytest.mark.slow
def test_a_pool_is_made_once_and_again_byte_for_byte(cache):
    scene = bare_scene(TASK)
    pool = pool_of(TASK, count=3)
    file = pool_file(TASK, scene, count=3)
    first = file.read_bytes()
    written = file.stat().st_mtime_ns
    assert pool.size == pool_of(TASK, count=3).size == 3
    assert file.stat().st_mtime_ns == written  # read, not made
    file.unlink()
    pool_of(TASK, count=3)
    assert file.read_bytes() == first

    held_out = make_pool(TASK, "held_out", 3, scene=scene)
    rows = [np.asarray(p.physics.qpos) for p in (pool, held_out)]
    assert not any((a == b).all() for a in rows[0] for b in rows[1])


def test_an_unknown_split_is_named(cache):
    with pytest.raises(UnknownNameError, match="held_out"):
        pool_of(TASK, "test")


def test_the_known_hashes_are_of_the_present_pools():
    """A change of a task, its home or the sampler's version asks for new pools: `ig2mj sample-task all`."""
    known = set(json.loads(HASHES.read_text()))
    files = set()
    tasks = [*ACTIVITIES.values(), *(variant(t, 0, "physical") for t in ACTIVITIES.values() if t.physical)]
    for task in tasks:
        scene = bare_scene(task)
        files |= {pool_file(task, scene, split).name for split in SEEDS}
    assert known <= files


@pytest.mark.slow
def test_a_small_pool_has_no_known_hash(cache):
    pool_of(TASK, count=2)
    file = pool_file(TASK, bare_scene(TASK), count=2)
    assert known_hash(file) is None and len(pool_hash(file)) == 64


@pytest.mark.slow
def test_a_pool_of_the_usual_size_is_made_anew_byte_for_byte(cache):
    task = ACTIVITIES["CookingMeat"]
    pool_of(task, jobs=2)
    file = pool_file(task, bare_scene(task))
    assert pool_hash(file) == known_hash(file)


def test_hashes_are_collected_in_the_form_of_those_on_file(tmp_path):
    from ig2mj.cli.sample_task import note_hash

    file = tmp_path / "out" / "hashes.json"
    for name, digest in (("b.npz", "2"), ("a.npz", "1"), ("b.npz", "3")):
        note_hash(file, name, digest)
    assert file.read_text() == json.dumps({"a.npz": "1", "b.npz": "3"}, indent=1) + "\n"
    assert HASHES.read_text() == json.dumps(json.loads(HASHES.read_text()), indent=1) + "\n"


def test_a_large_pool_may_try_more_seeds_than_a_usual_one():
    assert limit_of(512) == limit_of(1000) == MAX_CHUNKS
    assert limit_of(4096) * CHUNK == 8 * 4096  # seen: one start state in three or four is good
