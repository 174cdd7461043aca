"""Letting an object down: what is computed early never rules out what full computation would find."""

from __future__ import annotations

import numpy as np
import pytest

from ig2mj.sampling import drop
from ig2mj.sampling.columns import CELL, ColumnWindow
from ig2mj.sampling.drop import MARGIN, Balance, rest_at
from ig2mj.sampling.many import make_sampler
from ig2mj.sampling.possible import possible_origins
from ig2mj.scene.scene import load_scene

PAIRS = [("plate_0", "breakfast_table_0"), ("apple_0", "fridge_0"), ("bowl_0", "breakfast_table_0")]


@pytest.fixture(scope="module")
def query():
    return make_sampler(load_scene("small_home")).query


def case(query, name, support):
    """An object turned by some angle, the level over its support, and all cells of it."""
    tables = query.scene.tables
    placed, bearer = tables.object_names.index(name), tables.object_names.index(support)
    half = 0.4
    shape = query.footprint(placed, np.array([np.cos(half), 0, 0, np.sin(half)]), np.zeros(2))
    low, high = query.box(bearer)
    cells = ColumnWindow.around(low[:2], high[:2])
    rows, cols = shape.underside.shape
    window = ColumnWindow(cells.row + shape.row, cells.col + shape.col, cells.rows + rows, cells.cols + cols)
    level = query.level(window, float(high[2]) + 0.01, without=(placed,))
    every = np.arange(cells.rows * cells.cols)
    return level, shape, cells, cells.row + every // cells.cols, cells.col + every % cells.cols, (bearer,)


@pytest.mark.parametrize(("name", "support"), PAIRS)
def test_a_first_look_at_few_cells_changes_nothing(query, name, support, monkeypatch):
    level, shape, _, row, col, supports = case(query, name, support)
    quick = rest_at(level, shape, row, col, supports)
    monkeypatch.setattr(drop, "FIRST_CELLS", 10**6)
    whole = rest_at(level, shape, row, col, supports)
    assert whole.clear.any()
    for field in ("clear", "full", "balanced"):
        assert np.array_equal(getattr(quick, field), getattr(whole, field))
    assert np.allclose(quick.height[quick.clear], whole.height[whole.clear])


@pytest.mark.parametrize(("name", "support"), PAIRS)
def test_full_support_is_balanced_and_balanced_is_clear(query, name, support):
    level, shape, _, row, col, supports = case(query, name, support)
    rest = rest_at(level, shape, row, col, supports)
    assert (rest.clear | ~rest.balanced).all() and (rest.balanced | ~rest.full).all()
    alone = rest_at(level, shape, row, col, supports, "full")
    assert np.array_equal(alone.full, rest.full)
    assert not rest_at(level, shape, row, col, supports, "loose").balanced.any()


@pytest.mark.parametrize(("name", "support"), PAIRS)
def test_what_is_found_is_among_what_is_possible(query, name, support):
    level, shape, cells, row, col, supports = case(query, name, support)
    rest = rest_at(level, shape, row, col, supports)
    for full, found in ((True, rest.full), (False, rest.clear)):
        possible = possible_origins(level, shape, supports, cells.rows, cells.cols, full).ravel()
        assert (possible | ~found).all()
        assert not possible.all(), "some cells are ruled out"


def in_polygon(contact, place):
    """Row by row: the widest angle without contact, seen from the origin."""
    corners = np.array([[-1, -1], [-1, 1], [1, -1], [1, 1]]) * CELL / 2
    found = []
    for touches in contact:
        seen = (place[touches][:, None] + corners).reshape(-1, 2)
        angles = np.sort(np.arctan2(seen[:, 1], seen[:, 0]))
        gaps = np.diff(angles, append=angles[:1] + 2 * np.pi)
        found.append(len(angles) > 0 and bool(gaps.max() <= np.pi - MARGIN))
    return np.array(found)


@pytest.mark.parametrize("cells", [30, 400])
@pytest.mark.parametrize("share", [0.0, 0.005, 0.03, 0.3, 1.0])
def test_balance_is_no_wide_angle_without_contact(cells, share):
    rng = np.random.default_rng(7)
    side = int(cells**0.5) + 1
    grid = np.stack(np.meshgrid(np.arange(side), np.arange(side)), -1).reshape(-1, 2)[:cells] * CELL
    for shift in (0.0, side * CELL * 0.45):  # the centre of mass in the middle, and near the rim
        place = grid - grid.mean(0) + rng.normal(0, 0.003, 2) + shift
        contact = rng.random((200, cells)) < share
        assert Balance(place)(contact).tolist() == in_polygon(contact, place).tolist()
