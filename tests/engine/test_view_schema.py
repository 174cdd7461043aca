"""The view's schema, and that every engine and the tests' views made by hand keep to it."""

from __future__ import annotations

import jax
import numpy as np
import pytest
from hand_world import HandWorld, Item

from ig2mj.engine.view import SCHEMA, assemble, axis_sizes, blank_view, faults, read_field, replace_fields

SIZES = dict(zip("WOBLJAQHFY", range(1, 11), strict=True))


def test_the_schema_lists_the_leaves_of_the_view_in_their_order():
    leaves = jax.tree_util.tree_flatten_with_path(blank_view(SIZES))[0]
    assert [jax.tree_util.keystr(path, simple=True, separator=".") for path, _ in leaves] == list(SCHEMA)
    assert all(field.doc and field.axes[0] == "W" for field in SCHEMA.values())
    assert [leaf.shape for _, leaf in leaves] == [field.shape(SIZES) for field in SCHEMA.values()]
    assert {str(leaf.dtype) for _, leaf in leaves} == {"float32", "bool"}


def test_a_view_with_a_wrong_array_has_a_fault_that_names_it():
    view = blank_view(SIZES)
    assert faults(view, SIZES) == []
    shorter = replace_fields(view, {"joint_pos": np.zeros((1, 4), np.float32)})
    assert faults(shorter, SIZES) == ["joint_pos is float32[1, 4], not float32[1, 5] [W J]"]
    halved = replace_fields(view, {"agent.hand_pos": np.zeros((1, 8, 3), np.float16)})
    assert faults(halved, SIZES) == ["agent.hand_pos is float16[1, 8, 3], not float32[1, 8, 3] [W H 3]"]


def test_a_view_is_put_together_from_what_is_read_of_it():
    view = blank_view(SIZES)
    again = assemble({name: read_field(view, name) for name in SCHEMA})
    assert all(a is b for a, b in zip(jax.tree.leaves(view), jax.tree.leaves(again), strict=True))


def test_engines_keep_to_the_schema(full):
    sizes = axis_sizes(full.engine.tables, full.num_worlds)
    physics = full.fresh()
    assert faults(full.view(physics), sizes) == []
    _, view = full.run(physics, 1)
    assert faults(view, sizes) == []


@pytest.mark.slow
def test_the_jax_engine_keeps_to_the_schema(bench_folder):
    import engine_bench

    bench = engine_bench.bench(bench_folder, "jax")
    assert faults(bench.view(bench.fresh()), axis_sizes(bench.engine.tables, bench.num_worlds)) == []


def test_views_made_by_hand_keep_to_the_schema():
    home = HandWorld(Item("fish"), Item("oven", fixed=True, joints=[(0, 1)]), fingers=2)
    assert faults(home.view(fingers=[(0, 0, 0), (1, 1, 1)], worlds=3), axis_sizes(home.tables, 3)) == []
