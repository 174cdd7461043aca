"""Where a cleaning tool goes to take a particle off, and what its box covers there."""

from types import SimpleNamespace

import numpy as np
import pytest

from ig2mj.planning.cleaning_strokes import PRESSED, HeldTool, Region, Stroke, one_after_another, regions_of, turn_about
from ig2mj.planning.world import DirtSpot

UP = np.array([0.0, 0.0, 1.0])

SPONGE = np.array(np.meshgrid([-0.05, 0.05], [-0.05, 0.05], [-0.01, 0.01])).reshape(3, -1).T - [0.0, 0.0, 0.04]
"""Corners of a flat tool below a hand, m."""


def covered(region, pressed_on, spots):
    low, high = region.box(region.at(pressed_on))
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
    held.hand, held.has_area, held.out, held.corners = 0, True, out, np.eye(3)
    axes = lambda hand: (np.array([0.0, 1.0, 0.0]), ahead)  # noqa: E731
    held.world = SimpleNamespace(body=SimpleNamespace(opening=0.1), base=(np.zeros(2), 0.0), hand_axes=axes)
    regions = regions_of(held, 0.0, np.array([0.0, 0.0, 1.0]))
    first = regions[0].rotation
    assert first @ out == pytest.approx([0.0, 0.0, -1.0], abs=1e-6)
    assert first @ ahead == pytest.approx([1.0, 0.0, 0.0], abs=1e-6)
    assert all((r.rotation @ ahead)[0] > -0.5 for r in regions)
