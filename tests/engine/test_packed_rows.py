"""Rows of many arrays as one array of bytes."""

import jax.numpy as jnp
import numpy as np

from ig2mj.engine.packed_rows import PackedRows

TREE = {
    "truth": jnp.array([[True, False], [False, True], [True, True]]),
    "number": jnp.array([-1, 2**31 - 1, -(2**31)], jnp.int32),
    "value": jnp.array([[[1.5, np.nan]], [[-0.0, np.inf]], [[3e-39, -7.0]]], jnp.float32),
    "small": jnp.array([[250], [1], [2]], jnp.uint8),
    "none": jnp.zeros((3, 0, 4), jnp.float32),
}


def test_packed_rows_are_the_rows_to_the_bit():
    rows = PackedRows(lambda tree: tree).begin(np.array([2, 0, 2], np.int32), TREE)()
    assert rows.keys() == TREE.keys()
    for name, array in TREE.items():
        chosen = np.asarray(array)[[2, 0, 2]]
        assert rows[name].dtype == chosen.dtype and rows[name].shape == chosen.shape
        assert rows[name].tobytes() == chosen.tobytes(), name


def test_trees_of_other_shapes_are_told_apart():
    packed = PackedRows(lambda tree: {**tree, "twice": 2 * tree["a"]})
    for size in (2, 3):
        array = jnp.arange(4 * size, dtype=jnp.float32).reshape(4, size)
        rows = packed.begin(np.array([3], np.int32), {"a": array})()
        np.testing.assert_array_equal(rows["twice"], 2 * np.asarray(array)[[3]])


def test_what_is_taken_can_be_written_to():
    rows = PackedRows(lambda tree: tree).begin(np.array([1], np.int32), TREE)()
    rows["value"][:] = 9.0
    assert (rows["value"] == 9.0).all()
