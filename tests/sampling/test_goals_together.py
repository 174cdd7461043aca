"""Conditions that only hold together: neighbours of each other, neighbours inside a container."""

from __future__ import annotations

import collections

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ig2mj.errors import StateError
from ig2mj.sampling.budget import Budget
from ig2mj.sampling.conditions import order, read_conditions
from ig2mj.sampling.many import make_sampler
from ig2mj.sampling.orientations import TILT, tipped
from ig2mj.sampling.rules import next_to
from ig2mj.scene.scene import load_scene


@pytest.fixture(scope="module")
def sampler():
    return make_sampler(load_scene("small_home"))


def sampled(sampler, *texts, seed=0, **options):
    reasons = collections.Counter()
    conditions = read_conditions(texts)
    return sampler.sample(conditions, np.random.default_rng(seed), Budget(400), reasons, **options), reasons


def test_of_two_neighbours_of_each_other_the_later_one_gets_both_conditions():
    plan = order(read_conditions(["(next_to a b)", "(next_to b a)", "(on_top a t)", "(on_top b t)"]))
    (first, alone), (second, both) = plan.placements
    assert {first, second} == {"a", "b"} and [c.predicate for c in alone] == ["on_top"]
    assert sorted(c.predicate for c in both) == ["next_to", "next_to", "on_top"]


def test_what_stands_next_to_a_fixed_object_is_moved_and_not_the_fixed_one():
    plan = order(read_conditions(["(next_to sink bucket)"]), fixed={"sink"})
    assert [name for name, _ in plan.placements] == ["bucket"]


def test_supports_in_a_circle_are_refused_still():
    with pytest.raises(StateError, match="circle"):
        order(read_conditions(["(inside a b)", "(next_to a c)", "(on_top b a)"]))


def test_larger_objects_come_first_where_nothing_else_decides():
    plan = order(read_conditions(["(inside a c)", "(inside b c)"]), rank={"a": -1.0, "b": -2.0})
    assert [name for name, _ in plan.placements] == ["b", "a"]


@pytest.mark.parametrize(
    "texts",
    [
        ("(next_to apple_0 bowl_0)", "(next_to bowl_0 apple_0)", "(on_top bowl_0 breakfast_table_0)"),
        pytest.param(
            ("(inside apple_0 fridge_0)", "(inside bowl_0 fridge_0)", "(next_to apple_0 bowl_0)"),
            marks=pytest.mark.slow,
        ),
    ],
)
def test_neighbours_are_sampled_together(sampler, texts):
    row, reasons = sampled(sampler, *texts)
    assert row is not None, reasons
    assert sampler.holds(read_conditions(texts), row.states)


def test_what_holds_already_is_left_where_it_is(sampler):
    texts = ["(on_top plate_0 breakfast_table_0)", "(on_top apple_0 plate_0)"]
    start, _ = sampled(sampler, texts[0])
    assert start is not None
    before = sampler.start
    try:
        sampler.start_from(start.physics, start.states)
        row, reasons = sampled(sampler, *texts, seed=1, keep=True)
        assert row is not None, reasons
        plate = sampler.query.scene.object_index("plate_0")
        body = sampler.query.scene.tables.object_root[plate]
        address = sampler.query.scene.model.body_jntadr[body]
        address = sampler.query.scene.model.jnt_qposadr[address]
        moved = np.abs(row.physics.scene.qpos - start.physics.scene.qpos)[address : address + 3]
        assert moved.max() < 0.01
    finally:
        sampler.start_from(*before)


def test_where_columns_allow_it_next_to_holds_of_many_places(sampler):
    """The columns know distance and direction, not heights; what they allow, the predicate often confirms."""
    query, rng, held = sampler.query, np.random.default_rng(0), []
    query.load(sampler.start[0])
    apple, bowl = (query.scene.object_index(name) for name in ("apple_0", "bowl_0"))
    middle = np.rint(query.view.object_com[0, bowl, [1, 0]] * 100).astype(int)
    height = float(query.view.object_com[0, bowl, 2] - query.view.object_com[0, apple, 2])
    height += float(query.view.object_pos[0, apple, 2])
    for angle in rng.uniform(-np.pi, np.pi, 4):
        quat = np.array([np.cos(angle / 2), 0, 0, np.sin(angle / 2)])
        area = next(next_to.areas(query, apple, bowl)(query.footprint(apple, quat, np.zeros(2)), rng))
        assert area.allowed is not None
        row, col = (np.mgrid[-40:40, -40:40] + middle[:, None, None]).reshape(2, -1)
        allowed = np.flatnonzero(area.allowed(row, col))
        assert 0 < len(allowed) < len(row) / 4
        for n in rng.choice(allowed, 6):
            query.place(apple, np.array([(col[n] + 0.5) * 0.01, (row[n] + 0.5) * 0.01, height]), quat)
            held.append(sampler.holds(read_conditions(["(next_to apple_0 bowl_0)"]), sampler.start[1]))
    query.load(sampler.start[0])
    assert np.mean(held) > 0.4


@given(seed=st.integers(0, 10_000), angle=st.floats(-3.0, 3.0))
def test_a_tipped_object_lies_on_another_side(seed, angle):
    upright = np.array([np.cos(angle / 2), 0.0, 0.0, np.sin(angle / 2)])
    along = np.array([1.0, 0.0, 0.0, 0.0]) if seed % 2 else None
    w, x, y, z = tipped(upright, np.random.default_rng(seed), along)
    assert w * w + x * x + y * y + z * z == pytest.approx(1.0)
    up = 1 - 2 * (x * x + y * y)  # vertical part of what was the vertical axis
    assert abs(up) <= np.sin(TILT) + 1e-9
