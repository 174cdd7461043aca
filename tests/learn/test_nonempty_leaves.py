"""Arrays without elements stay out of programs over several devices."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
from jax.sharding import PartitionSpec as P

from ig2mj.learn.nonempty_leaves import nonempty, nonempty_specs, restored, shards_of

TREE = {"a": jnp.ones((4, 3)), "b": (jnp.zeros((4, 0)), jnp.arange(2)), "c": jnp.zeros((0,), jnp.uint8)}
SPECS = {"a": P("d"), "b": (P("d"), P()), "c": P()}


def test_a_tree_comes_back_whole():
    leaves = nonempty(TREE)
    assert [a.shape for a in leaves] == [(4, 3), (2,)]
    again = restored(TREE, [a + 1 for a in leaves])
    assert jax.tree.structure(again) == jax.tree.structure(TREE)
    np.testing.assert_array_equal(again["b"][1], [1, 2])
    assert again["b"][0] is TREE["b"][0], "what has no elements is the one that was there"


def test_a_device_gets_its_part_and_makes_what_has_no_elements_itself():
    parts = shards_of(TREE, SPECS, 2)
    assert jax.tree.map(lambda a: a.shape, parts) == {"a": (2, 3), "b": ((2, 0), (2,)), "c": (0,)}
    made = restored(parts, [jnp.ones((2, 3)), jnp.arange(2)])
    assert made["b"][0].shape == (2, 0) and made["c"].dtype == jnp.uint8


def test_specs_are_those_of_what_is_handed_over():
    assert nonempty_specs(TREE, SPECS) == [P("d"), P()]
    assert nonempty_specs(TREE, P("d")) == [P("d"), P("d")]
