"""`SmallCall`: one function of one world's program, the same results, and the usual way where XLA cannot."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np

from ig2mj.process.xla_small_call import SmallCall

X = np.random.default_rng(0).normal(size=(7, 100)).astype(np.float32)


def _chosen(x, unused, nothing):
    middle = jax.lax.cond(x[0, 0] > 0, lambda: x * 2, lambda: x + 1)
    return {"sum": jnp.cumsum(middle, axis=1), "least": jnp.min(jnp.where(middle > 0, middle, 0), axis=0)}, nothing


def test_results_are_those_of_the_usual_program_and_arguments_may_be_of_no_use():
    arguments = X, np.ones(3, bool), np.zeros((0, 2), np.float32)
    one = SmallCall(_chosen)
    for _ in range(2):
        made = one(*arguments)
    assert one.is_one and one._cache_size() == 1
    jax.tree.map(np.testing.assert_array_equal, made, jax.jit(_chosen)(*arguments))


def test_what_cannot_be_one_function_is_compiled_as_usual_and_without_a_word(capfd):
    one = SmallCall(lambda x: jnp.sort(x, axis=0))
    assert np.array_equal(one(X), np.sort(X, axis=0)) and not one.is_one
    assert np.array_equal(one(-X), np.sort(-X, axis=0))
    inside = SmallCall(lambda x: jax.lax.cond(x[0, 0] > 0, lambda: x[0, :2], lambda: jax.lax.top_k(x[0], 2)[0]))
    assert inside(X).shape == (2,) and not inside.is_one
    assert "rror" not in capfd.readouterr().err  # XLA writes there


def test_keys_of_random_numbers_are_taken():
    one, key = SmallCall(lambda key, x: x + jax.random.uniform(key, x.shape)), jax.random.key(3)
    assert np.array_equal(one(key, X), X + jax.random.uniform(key, X.shape))


def test_without_arguments_there_is_a_result_too():
    one = SmallCall(lambda: jnp.arange(3))
    assert one().tolist() == [0, 1, 2] and not one.is_one
    one = SmallCall(lambda nothing: nothing + jnp.ones((0, 2)))
    assert one(np.zeros((0, 2), np.float32)).shape == (0, 2)
