"""Every entry point computes with 32 bits and refuses to run in a forked process."""

from __future__ import annotations

import functools
import os
import subprocess
import sys

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from navigating import small

import ig2mj
from ig2mj.errors import EngineError
from ig2mj.process import entry
from ig2mj.process.entry import entry_point
from ig2mj.sampling import sample


@entry_point
class Face:
    """A class with members of all kinds."""

    def __init__(self):
        self.made = jnp.zeros(2).dtype

    def method(self):
        return jnp.zeros(2).dtype

    def __call__(self):
        return jnp.arange(2).dtype

    @classmethod
    def of_class(cls):
        return jnp.ones(2).dtype

    @staticmethod
    def of_none():
        return jnp.ones(2).dtype

    @property
    def told(self):
        """What it tells."""
        return jnp.ones(2).dtype

    @functools.cached_property
    def kept(self):
        return jnp.ones(2).dtype

    def _inside(self):
        return jnp.zeros(2).dtype


def test_all_public_members_of_a_class_compute_with_32_bits():
    with jax.enable_x64(True):
        face = Face()
        found = [face.made, face.method(), face.of_class(), face.of_none(), face.told, face.kept]
        assert found == [jnp.float32] * 6 and face() == jnp.int32
        assert face._inside() == jnp.float64, "what is not public runs where its caller does"
        assert jnp.zeros(2).dtype == jnp.float64, "the option is as it was"
    assert Face.told.__doc__ == "What it tells."


def test_the_option_is_as_it_was_after_an_error():
    @entry_point
    def fails():
        raise ValueError("no")

    with jax.enable_x64(True):
        with pytest.raises(ValueError, match="no"):
            fails()
        assert jnp.zeros(2).dtype == jnp.float64


def of_environment(tiny_home) -> list:
    env = ig2mj.make(small("PointNavigation"), worlds=2, pool_size=4, engine="native")
    state = env.reset(0)
    for k in range(3):
        state = env.step_autoreset(state, np.full((2, 2), 0.3 * k))
    return [state.obs, state.reward, state.info]


def of_worlds(tiny_home) -> list:
    worlds = ig2mj.Worlds(tiny_home, 2, "native", goal="(cooked apple)")
    batch = worlds.start(seed=3)
    for _ in range(2):
        batch, status = worlds.step(batch)
    batch = worlds.reset(batch, np.array([True, False]))
    return [batch.world.key, batch.world.states, batch.world.view.object_pos, status]


def of_simulation(tiny_home) -> list:
    world = ig2mj.Simulation(tiny_home, seed=5)
    world.set_state("temperature", "apple", 80.0)
    world.step(count=3)
    placed = world.set_predicate("on_top", "apple", "table", seed=2)
    return [world.states, np.array(placed), world.object_pose("apple"), np.array(world.predicate("cooked", "apple"))]


def of_sampling(tiny_home) -> list:
    pool = sample(tiny_home, ["(ontop apple table)"], 1, 4).pool
    assert pool is not None
    return [pool.physics, pool.states]


@pytest.mark.parametrize(
    "of", [of_simulation, *(pytest.param(f, marks=pytest.mark.slow) for f in (of_worlds, of_sampling, of_environment))]
)
def test_results_are_the_same_to_the_bit_in_double_precision(of, tiny_home):
    expected = jax.tree.map(np.asarray, of(tiny_home))
    with jax.enable_x64(True):
        found = jax.tree.map(np.asarray, of(tiny_home))
    for (path, a), b in zip(jax.tree_util.tree_leaves_with_path(expected), jax.tree.leaves(found), strict=True):
        assert a.dtype == b.dtype, path
        assert np.array_equal(a, b, equal_nan=a.dtype.kind == "f"), path


def run(code: str, **variables: str) -> subprocess.CompletedProcess[str]:
    """Runs a program in a process of its own, with the suite's compiled programs."""
    cache = jax.config.jax_compilation_cache_dir  # pyright: ignore[reportAttributeAccessIssue]
    shared = {"JAX_COMPILATION_CACHE_DIR": cache} if cache else {}
    environment = {**os.environ, "PYTHONPATH": "tests", **shared, **variables}
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=environment, timeout=250)


CONTRACT = """
import jax, jax.numpy, ig2mj
from ig2mj.testing import api_test
from navigating import small
assert jax.numpy.zeros(1).dtype == "float64"
api_test(ig2mj.make(small("PointNavigation"), worlds=2, pool_size=4, engine="native"), steps=2)
"""


@pytest.mark.slow
def test_the_quick_contract_holds_in_a_process_with_double_precision():
    """Where the option is on before ig2mj is imported, arrays that modules make are of 32 bits, too."""
    done = run(CONTRACT, JAX_ENABLE_X64="1")
    assert done.returncode == 0, done.stderr[-2000:]


FORK = """
import multiprocessing, warnings, jax, ig2mj
from ig2mj.errors import EngineError

def use():
    for made in (lambda: ig2mj.make("PointNavigation"), lambda: env.reset(0)):
        try:
            made()
        except EngineError as e:
            print(str(e)[:60], flush=True)

if __name__ == "__main__":
    warnings.simplefilter("ignore")
    from navigating import small
    env = ig2mj.make(small("PointNavigation"), pool_size=2, engine="native")
    env.reset(0)
    process = multiprocessing.get_context("fork").Process(target=use)
    process.start()
    process.join(60)
    print(process.exitcode)
"""


@pytest.mark.slow
def test_a_forked_process_is_refused_at_once():
    done = run(FORK)
    refused = "this process was forked from one in which JAX runs, whose th"
    assert done.stdout.splitlines() == [refused, refused, "0"], done.stderr[-2000:]


def test_the_error_of_a_fork_names_the_remedy(monkeypatch):
    monkeypatch.setattr(entry, "_forked", True)
    with pytest.raises(EngineError, match="spawn"):
        entry_point(lambda: None)()
