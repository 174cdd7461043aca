"""The hull budget: few pieces and few vertices, with little volume added and the outline kept."""

import time

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from ig2mj_converters.hulls import budget, convex


def box(size, at=(0, 0, 0)):
    hull = convex.hull_of(trimesh.creation.box(size).vertices + np.array(at))
    assert hull is not None
    return hull


def wire_rack():
    """92 thin wires, as of a dishwasher's tray."""
    along = [box((0.6, 0.004, 0.004), (0, 0.012 * i, 0)) for i in range(46)]
    upright = [box((0.004, 0.004, 0.1), (-0.29 + 0.0129 * i, 0.27, 0.05)) for i in range(46)]
    return along + upright


def test_a_wire_rack_of_92_hulls_is_merged_to_the_budget_quickly():
    hulls = wire_rack()
    started = time.perf_counter()
    merged = budget.Merging(hulls, 16).at(16)
    assert time.perf_counter() - started < 5
    assert len(merged) == 16
    assert sorted(i for m in merged for i in m.members) == list(range(92))
    for m in merged:
        for i in m.members:
            assert m.hull.contains(hulls[i].vertices, 1e-9).all()
    added = convex.union_volume([m.hull for m in merged]) - convex.union_volume(hulls)
    whole = convex.hull_of(np.concatenate([h.vertices for h in hulls]))
    assert added < 0.1 * whole.volume


def test_halves_of_a_box_are_merged_before_anything_else():
    halves = [box((1, 1, 1), (0, 0, 0)), box((1, 1, 1), (1, 0, 0)), box((0.2, 0.2, 3), (0.5, 0, 2))]
    merged = budget.Merging(halves, 2).at(2)
    assert [m.members for m in merged] == [(0, 1), (2,)]
    assert merged[0].hull.volume == pytest.approx(2.0)


def test_pieces_far_apart_still_come_down_to_one():
    spread = [box((0.1, 0.1, 0.1), (10.0 * i, 0, 0)) for i in range(60)]
    assert len(budget.Merging(spread, 1).at(1)) == 1


def test_within_the_budget_nothing_is_merged():
    hulls = wire_rack()[:16]
    assert [m.members for m in budget.Merging(hulls, 16).at(16)] == [(i,) for i in range(16)]


def test_merging_is_the_same_every_time():
    first, again = (budget.Merging(wire_rack(), 9).at(9) for _ in range(2))
    assert [m.members for m in first] == [m.members for m in again]


def test_hulls_inside_others_and_copies_go():
    hulls = [box((1, 1, 1)), box((0.5, 0.5, 0.5)), box((1, 1, 1)), box((0.5, 0.5, 0.5), (0.4, 0, 0))]
    assert budget.drop_contained(hulls, 1e-9) == [0, 3]


@settings(max_examples=8, deadline=None)
@given(st.integers(40, 300), st.integers(0, 2**31), st.tuples(*[st.floats(0.02, 2.0)] * 3))
def test_fewer_vertices_keep_bounding_box_and_volume(count, seed, size):
    points = np.random.default_rng(seed).normal(size=(count, 3))
    points *= np.array(size) / np.linalg.norm(points, axis=1, keepdims=True)
    hull = convex.hull_of(points)
    small = convex.reduce_vertices(hull, 32)
    assert len(small.vertices) <= 32
    np.testing.assert_allclose(np.ptp(small.vertices, axis=0), np.ptp(hull.vertices, axis=0), rtol=1e-9)
    assert abs(small.volume / hull.volume - 1) < 0.05
    away = max(convex.distance_outside(hull.vertices, small), convex.distance_outside(small.vertices, hull))
    assert away < 0.12 * hull.diagonal


def test_union_volume_counts_overlaps_once():
    assert convex.union_volume([box((1, 1, 1)), box((1, 1, 1), (0.5, 0, 0))]) == pytest.approx(1.5)


def test_flat_points_are_thickened_and_lines_refused():
    square = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.0]])
    hull, note = convex.solid_hull(square, 1e-3)
    assert note == "thickened" and hull.volume == pytest.approx(1e-3)
    assert convex.solid_hull(np.outer(np.arange(5.0), [1, 2, 3]), 1e-3) == (None, "is a line or a point")
    assert convex.solid_hull(square[:3], 1e-3)[0] is None
