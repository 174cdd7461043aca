"""Copies of worlds in shared memory."""

import multiprocessing

import numpy as np

from ig2mj.envs.shared_copies import SharedCopies
from ig2mj.planning.away import WorldCopy


def made(worlds, seed=0):
    """Physics and leaves of states of so many worlds; the physics of this test is a mapping of arrays."""
    random = np.random.default_rng(seed)
    physics = {
        "qpos": random.random((worlds, 3)),
        "asleep": random.random((worlds, 5)) < 0.5,
        "time": np.arange(worlds),
    }
    return physics, [random.random((worlds, 2, 4)).astype(np.float32), random.integers(0, 9, worlds)]


def of(physics, states, k):
    return WorldCopy({name: a[k] for name, a in physics.items()}, [a[k : k + 1] for a in states])  # pyright: ignore


def assert_same(one, other):
    assert one.physics.keys() == other.physics.keys()
    for name in one.physics:
        np.testing.assert_array_equal(one.physics[name], other.physics[name])
        assert one.physics[name].dtype == other.physics[name].dtype
    for a, b in zip(one.states, other.states, strict=True):
        np.testing.assert_array_equal(a, b)


def test_a_copy_is_read_where_it_was_put_also_through_memory_of_another():
    physics, states = made(3)
    like = of(physics, states, 0)
    memory = multiprocessing.get_context("spawn").RawArray
    own = SharedCopies(like, 7, allocate=lambda size: memory("B", size))
    other = SharedCopies(like, 7, own.memory)
    own.put([6, 0, 3], physics, states)
    for k, world in enumerate([6, 0, 3]):
        assert_same(other.get(world), of(physics, states, k))


def test_what_was_read_stays_as_it_is_when_its_place_is_written_again():
    physics, states = made(1)
    copies = SharedCopies(of(physics, states, 0), 1)
    copies.put([0], physics, states)
    before = copies.get(0)
    copies.put([0], *made(1, seed=1))
    assert_same(before, of(physics, states, 0))
