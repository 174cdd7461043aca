"""Random disturbance: which objects move, how far, and that a world's disturbance is its own."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from ig2mj.engine.native.engine import NativeEngine
from ig2mj.sampling.perturbation import LIFT, SHIFT, loose_objects, perturb
from ig2mj.worlds.random_streams import episode_keys


@pytest.fixture(scope="module")
def view(tiny_home):
    engine = NativeEngine(tiny_home, 40, threads=1)
    return engine.view(engine.reset())


def keys(count: int) -> jax.Array:
    return jnp.asarray(episode_keys(1, jnp.arange(count), jnp.zeros(count, jnp.int32)))


def test_loose_objects_are_neither_fixed_nor_halves_nor_parked(tiny_home):
    names = {tiny_home.object_names[i] for i in loose_objects(tiny_home.tables)}
    assert names == {"box", "book", "knife", "apple", "ball", "can", "rod", "pan", "sponge"}


@pytest.mark.slow
def test_only_those_that_may_move_do_and_only_so_far(tiny_home, view):
    loose = loose_objects(tiny_home.tables)
    write = jax.device_get(perturb(tiny_home.tables, loose, view, keys(40), 0.5))
    mask = np.asarray(write.object_mask)
    assert not np.delete(mask, loose, axis=1).any()
    assert mask[:, loose].mean() == pytest.approx(0.5, abs=0.08)
    moved = (np.asarray(write.object_pos) - view.object_pos)[mask]
    assert (np.abs(moved[:, :2]) <= SHIFT + 1e-6).all() and np.abs(moved[:, :2]).max() > 0.8 * SHIFT
    assert ((moved[:, 2] >= LIFT[0] - 1e-6) & (moved[:, 2] <= LIFT[1] + 1e-6)).all()
    quat = np.asarray(write.object_quat)[mask]
    np.testing.assert_allclose(np.linalg.norm(quat, axis=-1), 1.0, atol=1e-5)


def test_objects_turn_about_the_vertical(tiny_home, view):
    write = jax.device_get(perturb(tiny_home.tables, loose_objects(tiny_home.tables), view, keys(40), 1.0))
    box = tiny_home.object_index("box")  # stands upright at the start
    quat = np.asarray(write.object_quat)[:, box]
    np.testing.assert_allclose(quat[:, 1:3], 0.0, atol=1e-6)
    angle = 2 * np.arctan2(quat[:, 3], quat[:, 0])
    assert np.ptp(np.mod(angle, 2 * np.pi)) > 5.0, "all around"


@pytest.mark.parametrize(("share", "count"), [(0.0, 0), (1.0, 40 * 9)])
def test_nobody_or_everybody(tiny_home, view, share, count):
    write = perturb(tiny_home.tables, loose_objects(tiny_home.tables), view, keys(40), share)
    assert int(np.asarray(write.object_mask).sum()) == count


def test_a_world_is_disturbed_alike_in_any_batch(tiny_home, view):
    loose = loose_objects(tiny_home.tables)
    many = jax.device_get(perturb(tiny_home.tables, loose, view, keys(40)))
    first = jax.tree.map(lambda a: a[:3], view)
    few = jax.device_get(perturb(tiny_home.tables, loose, first, keys(3)))
    np.testing.assert_array_equal(many.object_mask[:3], few.object_mask)
    np.testing.assert_allclose(many.object_pos[:3], few.object_pos, atol=1e-6)
