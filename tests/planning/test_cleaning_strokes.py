"""Where a cleaning tool goes to take a particle off, and what its box covers there."""

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest

from ig2mj.planning.cleaning import _press
from ig2mj.planning.cleaning_strokes import Stroke, one_after_another, spread
from ig2mj.planning.clearance import Obstacles
from ig2mj.planning.held_tools import ALIKE, FIRST, PRESSED, SHIFTED_TURNS, HeldTool, Region, regions_of, turn_about
from ig2mj.planning.moves import way_back
from ig2mj.planning.stances import SPREAD
from ig2mj.planning.tool_areas import is_hidden
from ig2mj.planning.world import DirtSpot, PlannedWorld

UP = np.array([0.0, 0.0, 1.0])

SPONGE = np.array(np.meshgrid([-0.05, 0.05], [-0.05, 0.05], [-0.01, 0.01])).reshape(3, -1).T - [0.0, 0.0, 0.04]
"""Corners of a flat tool below a hand, m."""


def covered(region, pressed_on, spots):
    low, high = region.swept(pressed_on)
    return [s for s in spots if (low <= s.pos).all() and (s.pos <= high).all()]


@pytest.mark.parametrize("angle", [0.0, 0.8])
def test_a_tool_is_pressed_so_far_into_a_face_however_it_is_tilted(angle):
    region, spot = Region.turned(turn_about(np.array([1.0, 0.0, 0.0]), angle), SPONGE), DirtSpot(0, np.zeros(3), UP)
    grip = region.at(spot)
    assert (grip + region.corners)[:, 2].min() == pytest.approx(-PRESSED)
    assert covered(region, spot, [spot]) == [spot]
    assert region.above(spot)[2] > grip[2]


def test_a_tilted_tool_reaches_particles_above_the_face_that_it_is_pressed_on():
    face, above = DirtSpot(0, np.zeros(3), UP), DirtSpot(1, np.array([0.0, 0.03, 0.04]), -UP)
    flat, tilted = (Region.turned(turn_about(np.array([1.0, 0.0, 0.0]), a), SPONGE) for a in (0.0, 0.8))
    assert covered(flat, face, [face, above]) == [face]
    assert covered(tilted, face, [face, above]) == [face, above]


def test_upper_sides_come_first_and_then_the_nearest():
    spots = [DirtSpot(n, np.array([x, 0.0, 0.8]), UP) for n, x in enumerate((0.0, 1.0, 0.1))]
    side = DirtSpot(3, np.array([0.0, 0.0, 0.5]), np.array([1.0, 0.0, 0.0]))
    strokes = [Stroke(s, 0, [s]) for s in (side, *spots)]
    assert [s.spot.number for s in one_after_another(strokes)] == [0, 2, 1, 3]


def test_a_gripper_turns_its_tool_about_the_face_until_it_points_away_from_the_robot():
    ahead, out = np.array([1.0, 0.0, -1.0]) / np.sqrt(2), np.array([1.0, 0.0, 1.0]) / np.sqrt(2)
    held = HeldTool.__new__(HeldTool)
    held.hand, held.has_area, held.out, held.corners, held.whole = 0, True, out, np.eye(3), np.eye(3)
    axes = lambda hand: (np.array([0.0, 1.0, 0.0]), ahead)  # noqa: E731
    held.world = SimpleNamespace(body=SimpleNamespace(opening=0.1), base=(np.zeros(2), 0.0), hand_axes=axes)
    regions = regions_of(held, 0.0, np.array([0.0, 0.0, 1.0]))
    first = regions[0].rotation
    assert first @ out == pytest.approx([0.0, 0.0, -1.0], abs=1e-6)
    assert first @ ahead == pytest.approx([1.0, 0.0, 0.0], abs=1e-6)
    assert all((r.rotation @ ahead)[0] > -0.5 for r in regions)


@pytest.mark.parametrize("normal", [UP, np.array([0.0, 1.0, 0.0])])
def test_a_gripper_tilts_its_tool_where_it_does_not_reach_otherwise(normal):
    palm = np.array([0.6, 0.0, -0.8])
    held = HeldTool.__new__(HeldTool)
    held.hand, held.has_area, held.out, held.corners, held.whole = 0, True, -UP, SPONGE, SPONGE
    axes = lambda hand: (np.array([0.0, 1.0, 0.0]), palm)  # noqa: E731
    held.world = SimpleNamespace(body=SimpleNamespace(opening=0.1), base=(np.zeros(2), 0.0), hand_axes=axes)
    regions = [r for r in regions_of(held, 0.0, normal) if not r.shift.any()]
    tilted = [float((r.rotation @ held.out) @ -normal) < 0.999 for r in regions]
    assert any(tilted) and sorted(tilted) == tilted, "those first in which it lies on the face"
    points = [r.rotation @ palm for r in regions]
    first = tilted.index(True)
    assert all(a @ b < ALIKE for k, a in enumerate(points[first:], first) for b in points[:k])


def test_an_arm_brings_a_tool_to_a_face_before_it_presses():
    """It moves by few mm in its first steps, so that pressing would be over before."""
    region, spot = Region.turned(np.eye(3), SPONGE), DirtSpot(0, np.zeros(3), UP)
    world = SimpleNamespace(index=lambda name: 3, turned_hand=lambda *_: (1.0, 0.0, 0.0, 0.0))
    heights = {}
    for opening in (None, 0.1):
        world.body = SimpleNamespace(opening=opening)
        program = _press(world, "sponge", 0, region, spot, [region.above(spot)])
        assert all(phase.keeps == 3 for phase in program)
        heights[opening] = [round(phase.pos[2] - region.at(spot)[2], 3) for phase in program]
    assert heights == {None: [0.06, 0.0, 0.06], 0.1: [0.06, 0.03, 0.0, 0.06]}


class Board(Obstacles):
    """A board at a height of 0.5 m from x = 0 on."""

    def clear_along(self, spheres, start, ahead, along):
        points = start + ahead * along[:, None]
        return not ((points[:, 0] > 0.0) & (np.abs(points[:, 2] - 0.5) < 0.05)).any()


class BelowBoard(PlannedWorld):
    """Where a hand is, and where it carries a rag."""

    at, home = np.array([0.5, 0.0, 0.3]), np.array([-0.5, 0.0, 1.0])
    stance = None
    obstacles = lambda self, *_: object.__new__(Board)  # noqa: E731
    carried = lambda self, *_: self.home  # noqa: E731
    grip = lambda self, hand: self.at  # noqa: E731
    hand_axes = lambda self, hand: (UP, UP)  # noqa: E731
    spheres = lambda self, *_, **__: np.zeros((1, 4))  # noqa: E731


def test_an_arm_comes_from_below_a_board_the_way_that_it_came():
    world, before = object.__new__(BelowBoard), np.array([-0.3, 0.0, 0.3])
    came = [world.home, before, world.at]
    assert way_back(world, 0, "rag", came) == [before], "from there the straight way is free"
    world.at = np.array([-0.1, 0.0, 0.7])
    assert way_back(world, 0, "rag", came) == [], "and from here it is"


def held_rag(rim=0.004):
    """A rag below a floating hand, whose lower side cleans up to `rim` m from its edge."""
    side, low = 0.16, -0.05
    whole = np.array(np.meshgrid([-side, side], [-side, side], [low, low + 0.02])).reshape(3, -1).T
    inner = side - rim
    held = HeldTool.__new__(HeldTool)
    held.hand, held.has_area, held.out, held.whole = 0, True, -UP, whole
    held.corners = np.array(np.meshgrid([-inner, inner], [-inner, inner], [low, low + 0.008])).reshape(3, -1).T
    axes = lambda hand: (np.array([1.0, 0.0, 0.0]), -UP)  # noqa: E731
    held.world = SimpleNamespace(body=SimpleNamespace(opening=None), base=(np.zeros(2), 0.0), hand_axes=axes)
    return held


@pytest.mark.parametrize("normal", [UP, np.array([1.0, 0.0, 0.0]), np.array([0.0, -1.0, 0.0])])
def test_only_turns_count_in_which_the_part_that_cleans_comes_to_the_face_first(normal):
    held = held_rag()
    regions = regions_of(held, 0.0, normal)
    assert any(r.shift.any() for r in regions)
    for region in regions:
        assert (region.corners @ normal).min() - (held.whole @ region.rotation.T @ normal).min() <= FIRST


def test_where_no_turn_brings_the_part_that_cleans_first_the_best_ones_count():
    held = held_rag()
    held.whole = held.whole - [0.0, 0.0, 0.03]  # a rim stands out all around it
    assert regions_of(held, 0.0, UP)


@pytest.mark.parametrize("normal", [UP, np.array([1.0, 0.0, 0.0]), np.array([0.6, 0.8, 0.0])])
def test_a_tool_takes_a_particle_off_with_each_side_of_its_box(normal):
    regions = [r for r in regions_of(held_rag(), 0.0, normal) if r.shift.any()]
    spot = DirtSpot(0, np.array([1.0, 2.0, 0.1]), normal)
    assert len(regions) == 8 * SHIFTED_TURNS
    for region in regions:
        assert abs(region.shift @ normal) < 1e-9
        assert covered(region, spot, [spot]) == [spot]
    assert min(np.linalg.norm(r.shift) for r in regions) > 0.1


def test_a_thin_tool_takes_off_all_particles_of_a_face_that_it_lies_on():
    region = regions_of(held_rag(), 0.0, UP)[0]
    spots = [DirtSpot(n, np.array([x, 0.0, 0.0]), UP) for n, x in enumerate((0.0, 0.1, -0.14, 0.2))]
    assert covered(region, spots[0], spots) == spots[:3]


def test_what_stands_next_to_a_particle_leaves_room_for_a_tool_that_is_shifted():
    wall = 0.05  # m beyond the particle
    spot = DirtSpot(0, np.zeros(3), UP)
    reach = [region.box(region.at(spot))[1][0] for region in regions_of(held_rag(), 0.0, UP)]
    assert reach[0] > wall and min(reach) < wall


def test_stances_are_looked_for_in_front_of_each_face_with_particles():
    near, far = DirtSpot(0, np.zeros(3), UP), DirtSpot(1, np.array([0.5 * SPREAD, 0.0, 0.0]), UP)
    other, side = DirtSpot(2, np.array([2 * SPREAD, 0.0, 0.0]), UP), DirtSpot(3, np.zeros(3), np.array([1.0, 0.0, 0.0]))
    assert spread([near, far, other, side]) == [near, other, side]


def test_a_cleaning_area_inside_of_its_tool_is_hidden(tiny_home):
    tables = tiny_home.tables
    piece = int(np.flatnonzero(tables.piece_object == tables.object_names.index("book"))[0])
    half = np.ptp(tables.piece_vertices[piece], axis=0) / 2

    def hidden(share):
        first = {
            "link_body": int(tables.piece_body[piece]),
            "link_geom": -1,
            "link_pos": tables.piece_pos[piece],
            "link_quat": tables.piece_quat[piece],
            "link_half": share * half,
        }
        changed = {name: getattr(tables, name).copy() for name in first}
        for name, value in first.items():
            changed[name][0] = value
        return is_hidden(dataclasses.replace(tables, **changed), 0)

    assert hidden(0.5) and not hidden(1.0)
    assert not is_hidden(tables, -1)


def test_an_arm_presses_a_rag_flat_before_it_tilts_it_onto_its_rim():
    held = held_rag(0.0015)
    held.world.body = SimpleNamespace(opening=0.1)
    held.world.hand_axes = lambda hand: (np.array([0.0, 1.0, 0.0]), np.array([0.6, 0.0, -0.8]))
    flat = [bool(r.rotation[2, 2] > 0.999) for r in regions_of(held, 0.0, UP)]
    assert not all(flat) and sorted(flat, reverse=True) == flat, "also with the particle near its rim"
