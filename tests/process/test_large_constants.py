"""Large constants of a program are arguments of it (`process.large_constants`)."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from ig2mj.process.large_constants import LEAST, WithLargeConstants

LARGE, SMALL = np.arange(LEAST, dtype=np.float32), np.arange(3, dtype=np.float32)


def texts(function, *args):
    """Sizes of the lowered program, with constants in it and as arguments."""
    made = WithLargeConstants(function)
    return len(made.plain.trace(*args).lower().as_text()), len(made.trace(*args).lower().as_text())


@pytest.mark.parametrize("kind", [np.asarray, jnp.asarray], ids=["numpy", "jax"])
def test_a_large_constant_is_not_part_of_the_program(kind):
    large = kind(LARGE)
    embedded, passed = texts(lambda k: jnp.asarray(large)[k], jnp.int32(5))
    assert embedded > LEAST > 5000 > passed


def test_also_where_a_loop_reads_it():
    large = jnp.asarray(LARGE)

    def outer(k):
        return jax.lax.scan(lambda sum_, n: (sum_ + large[n], large[n]), jnp.float32(0), k + jnp.arange(4))

    embedded, passed = texts(outer, jnp.int32(5))
    assert embedded > LEAST > 20_000 > passed
    total, single = WithLargeConstants(outer)(jnp.int32(5))
    assert total == 5 + 6 + 7 + 8
    assert single.tolist() == [5, 6, 7, 8]


def test_a_small_constant_stays():
    made = WithLargeConstants(lambda x: x + SMALL)
    assert len(jax.tree.leaves(made.trace(jnp.zeros(3)).in_avals)) == 1
    assert made(jnp.ones(3)).tolist() == [1, 2, 3]


def test_trees_go_in_and_come_out_and_donated_arguments_are_used_up():
    large = jnp.asarray(LARGE)
    made = WithLargeConstants(lambda tree, k: ({"sum": tree["a"] + large[k]}, (k,)), donate_argnums=0)
    a = jnp.ones(3)
    found, (k,) = made({"a": a}, jnp.int32(2))
    assert found["sum"].tolist() == [3, 3, 3]
    assert k == 2
    assert a.is_deleted()


def test_other_shapes_and_other_constants_of_a_later_call():
    other = jnp.asarray(LARGE * 2)
    large = jnp.asarray(LARGE)
    made = WithLargeConstants(lambda x: x + (large if x.ndim else other)[7])
    assert made(jnp.zeros(2)).tolist() == [7, 7]
    assert made(jnp.zeros(4)).tolist() == [7, 7, 7, 7]
    assert made(jnp.float32(0)) == 14


def test_it_can_be_part_of_another_program():
    large = jnp.asarray(LARGE)
    made = WithLargeConstants(lambda x: x + large[7])
    assert jax.jit(lambda x: made(x) * 2)(jnp.zeros(2)).tolist() == [14, 14]
    assert jax.vmap(made)(jnp.zeros(3)).tolist() == [7, 7, 7]
    assert made(jnp.ones(2)).tolist() == [8, 8]


def test_names_of_programs_are_those_of_the_functions():
    def several_steps(x):
        return x

    assert "jit_several_steps" in WithLargeConstants(several_steps).trace(jnp.zeros(2)).lower().as_text()
