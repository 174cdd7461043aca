"""Openings stay open: the inside of a drawer, of a shelf, of a rack is not filled for the sake of fewer pieces."""

import numpy as np
import pytest
import trimesh
from ig2mj_converters.base.description import Mesh, Shape
from ig2mj_converters.hulls import convex
from ig2mj_converters.hulls.budget import keep_to_budget
from ig2mj_converters.hulls.link_hulls import HullOptions, decompose_link
from ig2mj_converters.hulls.openings import Openings


def box(size, at=(0, 0, 0)):
    hull = convex.hull_of(trimesh.creation.box(size).vertices + np.array(at))
    assert hull is not None
    return hull


def drawer(slats=1):
    """An open box of 0.5 x 0.4 x 0.2 m with walls of 1 cm, every wall in so many upright slats."""
    hulls = [box((0.5, 0.4, 0.01))]
    for i in range(slats):
        x, y = (0.5 / slats, (i + 0.5) / slats - 0.5), (0.4 / slats, (i + 0.5) / slats - 0.5)
        hulls += [box((x[0], 0.01, 0.2), (0.5 * x[1], side * 0.195, 0.1)) for side in (-1, 1)]
        hulls += [box((0.01, y[0], 0.2), (side * 0.245, 0.4 * y[1], 0.1)) for side in (-1, 1)]
    return hulls


def test_the_inside_of_a_drawer_is_one_and_is_closed_by_its_hull():
    openings = Openings(drawer())
    assert openings.count == 1
    assert openings.stay_open(drawer())
    assert not openings.stay_open([box((0.5, 0.4, 0.2), (0, 0, 0.1))])


def test_each_compartment_counts_by_itself():
    shelf = [box((0.01, 0.3, 1.0), (side * 0.4, 0, 0.5)) for side in (-1, 1)]
    shelf += [box((0.8, 0.3, 0.01), (0, 0, 0.25 * i)) for i in range(5)]
    openings = Openings(shelf)
    assert openings.count == 4
    assert not openings.stay_open([*shelf, box((0.8, 0.3, 0.25), (0, 0, 0.125))])


def test_under_a_table_is_no_inside():
    legs = [box((0.05, 0.05, 0.7), (x, y, 0.35)) for x in (-0.5, 0.5) for y in (-0.3, 0.3)]
    assert Openings([box((1.2, 0.8, 0.04), (0, 0, 0.72)), *legs]).count == 0


def test_a_link_gets_as_few_pieces_as_keep_its_error_small_and_its_drawer_open():
    """A drawer of 41 slats: five boxes would do, and sixteen are never merged."""
    kept = keep_to_budget(drawer(10), [], few=4, most=64, max_volume_error=0.15)
    assert len(kept.pieces) == 5 and kept.open and kept.volume_error < 0.05
    assert len(keep_to_budget(drawer(10), [], few=16, most=64, max_volume_error=0.15).pieces) == 16


def test_a_small_inside_of_a_thick_body_is_kept_though_it_weighs_little():
    """A block with a pocket: filling the pocket would change its volume by 3 %."""
    block = [box((1, 1, 0.5), (0, 0, -0.25)), box((0.4, 1, 0.5), (-0.3, 0, 0.25)), box((0.4, 1, 0.5), (0.3, 0, 0.25))]
    block += [box((0.2, 0.4, 0.5), (0, -0.3, 0.25)), box((0.2, 0.4, 0.5), (0, 0.3, 0.25))]
    kept = keep_to_budget(block, [], few=1, most=64, max_volume_error=0.15)
    assert kept.open and len(kept.pieces) > 1


def rack():
    """The lower rack of a dishwasher: 90 wires of 4 mm, a tray with rows of upright prongs, one group each."""
    wires = [
        trimesh.creation.box((0.5, 0.004, 0.004)).apply_translation((0, y, 0)) for y in np.linspace(-0.25, 0.25, 15)
    ]
    wires += [
        trimesh.creation.box((0.004, 0.5, 0.004)).apply_translation((x, 0, 0)) for x in np.linspace(-0.25, 0.25, 15)
    ]
    for y in np.linspace(-0.2, 0.2, 6):
        prongs = [trimesh.creation.box((0.004, 0.004, 0.1)) for _ in range(10)]
        wires += [p.apply_translation((x, y, 0.05)) for p, x in zip(prongs, np.linspace(-0.23, 0.23, 10), strict=True)]
    return wires


def as_groups(meshes):
    return Shape("mesh", meshes=[Mesh(np.asarray(m.vertices), np.asarray(m.faces), f"g{i}") for i, m in
                                 enumerate(meshes)], grouped=True)  # fmt: skip


@pytest.mark.slow
def test_a_dishwasher_rack_of_90_wires_gets_the_pieces_that_it_needs():
    """Wires cannot be merged for nothing: what the budget does not give is told, with the number that would do."""
    coarse, usual, enough = (
        decompose_link([as_groups(rack())], HullOptions(cache=False, max_hulls=limit)) for limit in (16, 64, 90)
    )
    assert coarse.before == 90 and (coarse.after, usual.after) == (16, 64)
    assert usual.volume_error < coarse.volume_error / 4
    assert any("--max-hulls 88 would keep that under 15%" in w for w in usual.warnings)
    assert enough.after == 88 and enough.volume_error < 0.15 and not enough.warnings


def test_what_merging_would_fill_is_cut_up_anew_where_that_is_better():
    """A grating of 9 x 9 squares in 65 groups: merged to 24 it loses openings, cut into boxes it needs 22 of them."""
    cells = [
        trimesh.creation.box((0.1, 0.1, 0.02)).apply_translation((0.1 * i, 0.1 * j, 0))
        for i in range(9)
        for j in range(9)
        if not (i % 2 and j % 2)
    ]
    found = decompose_link([as_groups(cells)], HullOptions(cache=False, max_hulls=24))
    assert found.method == "recut" and found.after <= 24
    assert found.volume_error == pytest.approx(0, abs=1e-6)
