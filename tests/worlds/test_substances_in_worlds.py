"""Substances in worlds: pouring on engines, skipped work, files, what can be asked and set."""

from __future__ import annotations

import jax
import numpy as np
import pytest
from substance_world import GLASS

import ig2mj
from benchmarks.harness.pouring import write_pouring
from ig2mj.errors import AbilityError, StateError, UnknownNameError
from ig2mj.sampling.many import sample
from ig2mj.simulation import Simulation
from ig2mj.states import initial_states
from ig2mj.states.model import StateModel
from ig2mj.worlds import load_pool, save_pool
from ig2mj.worlds.pool import load_pool_scene


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    return ig2mj.load_scene(write_pouring(tmp_path_factory.mktemp("pouring"), 0.6, glass=GLASS))


@pytest.fixture(scope="module")
def poured(scene):
    """A simulation in which all has flowed."""
    simulation = Simulation(scene)
    for _ in range(100):
        simulation.step()
    return simulation


def _volumes(states) -> np.ndarray:
    return np.asarray(states.volume)[0, :, 0]


def test_a_jug_pours_into_a_glass_and_nothing_is_lost(poured):
    np.testing.assert_allclose(_volumes(poured.states), [0, 0.6], atol=1e-5)
    assert poured.predicate("filled", "glass", "water") and poured.predicate("empty", "jug")
    assert poured.holds("(and (contains glass water) (present water) (not (covered floor water)))")
    assert poured.state("volume", "glass") == pytest.approx(0.6, abs=1e-5)
    assert "it holds 2 l" in poured.explain("(filled jug water)")


def test_a_saved_world_has_its_substances(poured, scene, tmp_path):
    poured.save(tmp_path / "world.npz")
    other = Simulation(scene)
    other.load(tmp_path / "world.npz")
    np.testing.assert_array_equal(_volumes(other.states), _volumes(poured.states))


def test_what_is_set_holds(scene):
    simulation = Simulation(scene)
    for predicate, name in (("covered", "glass"), ("contains", "glass"), ("insource", "glass")):
        assert simulation.set_predicate(predicate, name, "water")
        assert simulation.predicate(predicate, name, "water")
        assert simulation.set_predicate(predicate, name, "water", value=False)
        assert not simulation.predicate(predicate, name, "water")
    assert simulation.set_predicate("empty", "glass") and simulation.predicate("empty", "glass")
    with pytest.raises(UnknownNameError, match="substances="):
        simulation.predicate("filled", "glass", "salt")
    with pytest.raises(AbilityError, match="no container"):
        simulation.set_predicate("filled", "floor", "water")


def test_a_scene_without_substances_says_so(tiny_home):
    model = StateModel.of_manifest(tiny_home.tables, tiny_home.manifest)
    states = initial_states(model, 1)
    with pytest.raises(StateError, match="substances="):
        _ = states.volume


@pytest.mark.slow
def test_what_is_skipped_changes_nothing(scene):
    plain, skipping = Simulation(scene, incremental=False), Simulation(scene)
    for _ in range(100):
        plain.step()
        skipping.step()
        for a, b in zip(jax.tree.leaves(plain.states), jax.tree.leaves(skipping.states), strict=True):
            np.testing.assert_array_equal(np.asarray(a), np.asarray(b))


@pytest.mark.slow
def test_engines_agree(scene):
    native, batched = ig2mj.Worlds(scene, 2, "native"), ig2mj.Worlds(scene, 2, "jax")
    one, other = native.start(), batched.start()
    for _ in range(45):
        (one, _), (other, _) = native.step(one), batched.step(other)
    assert float(one.world.states.volume[0, 1, 0]) > 0.5
    np.testing.assert_allclose(one.world.states.volume, other.world.states.volume, atol=1e-3)


@pytest.mark.slow
def test_sampled_rows_and_their_pools_have_substances(scene, tmp_path):
    wanted = ["(filled glass water)", "(covered floor water)"]
    done = sample(scene, wanted, 2, seed=1)
    assert done.pool is not None and done.complete
    save_pool(done.pool, tmp_path / "pool.npz", scene)
    again = load_pool(tmp_path / "pool.npz", load_pool_scene(tmp_path / "pool.npz", scene.folder))
    assert (np.asarray(again.states.volume)[:, 1, 0] > 0.2 * 0.64).all()
    assert again.states.coat.any()
