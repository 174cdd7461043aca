"""Pools of tasks: the same rows everywhere, whatever number is asked for, other states held out, all within reach."""

from __future__ import annotations

import dataclasses

import jax
import numpy as np
import pytest

from ig2mj.errors import EngineError, InputError, UnknownNameError
from ig2mj.process.program_cache import say_not_kept
from ig2mj.tasks import pools
from ig2mj.tasks.activities import ACTIVITIES
from ig2mj.tasks.pool_files import SHIPPED, StartStates, different_rows
from ig2mj.tasks.pools import CHUNK, COUNT, MAX_CHUNKS, SEEDS, limit_of, make_pool, pool_of, start_states
from ig2mj.tasks.variants import variant
from ig2mj.worlds.archive import read_header
from ig2mj.worlds.pool import Pool, load_pool, save_pool

TASK = ACTIVITIES["GraspingBook"]
TASKS = [*ACTIVITIES.values(), *(variant(t, 0, "physical") for t in ACTIVITIES.values() if t.physical)]


@pytest.fixture
def cache(tmp_path, monkeypatch):
    monkeypatch.setenv("IG2MJ_CACHE_DIR", str(tmp_path))
    return tmp_path


def equal(one: Pool, other: Pool) -> bool:
    pairs = zip(jax.tree.leaves(one), jax.tree.leaves(other), strict=True)
    return all(np.array_equal(np.asarray(a), np.asarray(b)) for a, b in pairs)


# Those that ship.


@pytest.mark.slow
@pytest.mark.parametrize("split", SEEDS)
def test_every_activity_s_pool_ships_in_the_usual_size(split):
    """A change of a task, its home or the sampler's version asks for new ones: `make pools`."""
    files = {start_states(task, split).shipped for task in TASKS}
    assert None not in files
    named = {file.name for file in files if file is not None}
    assert named == {file.name for file in SHIPPED.glob(f"*-{split}-*.npz")}
    for task in TASKS[:2]:
        states = start_states(task, split)
        assert states.shipped is not None
        assert load_pool(states.shipped, states.scene).size >= COUNT[split]


@pytest.mark.slow
def test_no_start_state_for_training_is_held_out():
    for task in TASKS:
        rows = [np.asarray(pool_of(task, split).physics.qpos) for split in SEEDS]
        assert not set(map(bytes, rows[0])) & set(map(bytes, rows[1])), task.name


def test_numbers_of_rows_are_those_of_single_precision():
    for leaf in jax.tree.leaves(pool_of(TASK, "held_out")):
        leaf = np.asarray(leaf)
        if np.issubdtype(leaf.dtype, np.floating):
            assert np.array_equal(leaf, leaf.astype(np.float32).astype(leaf.dtype))


def test_the_steak_lies_flat_in_every_start_state():
    task = ACTIVITIES["CookingMeat"]
    at = start_states(task).scene.model.joint("steak_0/free").qposadr[0]
    for split in SEEDS:
        _, x, y, _ = np.asarray(pool_of(task, split).physics.qpos)[:, at + 3 : at + 7].T
        assert (np.abs(1 - 2 * (x**2 + y**2)) >= pools.FLAT).all()


def test_a_pool_that_ships_is_neither_sampled_nor_copied(cache):
    assert pool_of(TASK).size == COUNT["train"] and pool_of(TASK, "held_out").size == COUNT["held_out"]
    assert equal(pool_of(TASK, count=3), pool_of(TASK).rows(np.arange(3)))
    assert not list((cache / "pools").rglob("*"))


# Files, without a sampler.


@pytest.fixture
def states(tiny_home) -> StartStates:
    return StartStates("Tiny-train", tiny_home, lambda digest: [1, digest])


@pytest.fixture
def sampled(states, cache):
    """`sample` of rows that carry their candidate's number as time; every third candidate is no good. And its calls."""
    from ig2mj.engine.registry import make_engine
    from ig2mj.states.initial import initial_states
    from ig2mj.states.model import StateModel

    engine = make_engine("native", states.scene, 1)
    physics = jax.tree.map(np.asarray, engine.snapshot(engine.reset()))
    initial = jax.tree.map(np.asarray, initial_states(StateModel.of_manifest(engine.tables, states.scene.manifest), 1))
    calls: list[tuple[int, int]] = []

    def sample(tried: int, rows: int):
        calls.append((tried, rows))
        made = 0
        while made < rows:
            good = tried % 3 != 2
            row = Pool(dataclasses.replace(physics, time=np.full(1, tried + 0.1)), initial)
            tried, made = tried + 1, made + good
            yield tried, row if good else None

    return sample, calls


def test_a_smaller_pool_is_the_first_rows_and_a_larger_one_goes_on(states, sampled):
    sample, calls = sampled
    whole = states.pool(5, sample)
    assert np.asarray(whole.physics.time) == pytest.approx([0.1, 1.1, 3.1, 4.1, 6.1])
    assert equal(states.pool(2, sample), whole.rows(np.arange(2)))
    assert calls == [(0, 5)], "fewer rows are read"
    more = states.pool(7, sample)
    assert calls[1:] == [(7, 2)], "more rows go on after the last candidate"
    assert np.asarray(more.physics.time) == pytest.approx([0.1, 1.1, 3.1, 4.1, 6.1, 7.1, 9.1])
    assert equal(more.rows(np.arange(5)), whole)
    assert len(list(states.cached.parent.glob("*.npz"))) == 1


def test_what_cannot_be_kept_is_used_all_the_same(states, sampled, cache, capsys):
    sample, _ = sampled
    say_not_kept.cache_clear()
    (cache / "pools").write_text("a file where a folder must be", encoding="utf-8")
    assert states.pool(2, sample).size == 2
    assert f"start states are not kept in {cache / 'pools'} (" in capsys.readouterr().err
    with pytest.raises(OSError, match="pools"):
        states.pool(2, sample, cache / "pools" / "own.npz")


def test_what_is_sampled_is_rounded_before_it_is_used(states, sampled):
    time = np.asarray(states.pool(2, sampled[0]).physics.time)
    assert time.dtype == np.float64 and np.array_equal(time, np.float64(np.float32([0.1, 1.1])))


def test_rows_that_differ_are_counted(states, sampled):
    pool = states.pool(3, sampled[0])
    qpos = np.array(pool.physics.qpos)
    qpos[1, 0] += 1e-3
    qpos[2, 0] += 1e-6
    other = pool.replace(physics=pool.physics.with_whole(qpos=qpos))
    assert different_rows(pool, other) == [1] and different_rows(pool, pool) == []


def test_a_file_with_a_wrong_count_is_refused(states, sampled):
    pool = states.pool(2, sampled[0])
    save_pool(pool, states.cached, states.scene, {"tried": -4})
    with pytest.raises(InputError, match="-4 tried candidates"):
        states.pool(3, sampled[0])


def test_an_unknown_split_is_named(cache):
    with pytest.raises(UnknownNameError, match="held_out"):
        pool_of(TASK, "test")


# Sampling.


@pytest.mark.slow
def test_batches_of_any_size_hold_the_same_rows(cache, monkeypatch):
    monkeypatch.setattr(pools, "CHUNK", 2)
    whole = make_pool(TASK, count=3, file=cache / "whole.npz")
    make_pool(TASK, count=1, file=cache / "parts.npz")
    parts = make_pool(TASK, count=3, file=cache / "parts.npz")
    assert equal(parts, whole)
    assert read_header(cache / "parts.npz")["tried"] == read_header(cache / "whole.npz")["tried"]
    monkeypatch.setattr(pools, "CHUNK", CHUNK)
    assert different_rows(make_pool(TASK, count=1, file=cache / "one.npz"), whole) == []


@pytest.mark.slow
def test_a_start_that_is_never_within_reach_ends(cache, monkeypatch):
    monkeypatch.setattr(pools, "HOPELESS", 2)
    near = dataclasses.replace(TASK.near[0], most=1e-3)
    with pytest.raises(EngineError, match="2 tries gave only 0 of 1 start states"):
        make_pool(dataclasses.replace(TASK, near=(near,)), count=1, file=cache / "never.npz")


def test_a_large_pool_may_try_more_seeds_than_a_usual_one():
    assert limit_of(512) == limit_of(1000) == MAX_CHUNKS
    assert limit_of(4096) * CHUNK == 8 * 4096  # seen: one start state in three or four is good
