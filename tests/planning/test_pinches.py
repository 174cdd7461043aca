"""Where a gripper takes what lies flat: a synthetic gripper and boxes."""

import numpy as np
import pytest

from ig2mj.planning.clearance import Obstacles
from ig2mj.planning.pinches import BITE, SHALLOW, around_corners, between_fingers, holds, over_edges

OPENING, TIP, THICK = 0.1, 0.03, 0.013


class Box(Obstacles):
    """A box that stands on the floor z = 0, m."""

    def __init__(self, *size):
        self.half, self.middle = np.array(size) / 2, np.array([0.0, 0.0, size[2] / 2])

    def distance(self, points):
        beyond = np.abs(points - self.middle) - self.half
        return np.linalg.norm(np.maximum(beyond, 0.0), axis=-1) + np.minimum(beyond.max(-1), 0.0)

    @property
    def corners(self):
        return self.middle + self.half * np.array(np.meshgrid(*[[-1.0, 1.0]] * 3)).reshape(3, -1).T


def corners_of_fingers(fingers, palm):
    """Of two fingers and the palm behind them, m from the grasp point."""
    side = np.cross(palm, fingers)
    reach = [OPENING / 2, OPENING / 2 + THICK]
    return np.array(
        [
            x * palm + s * y * fingers + z * side
            for x in (-0.1, TIP)
            for s in (-1, 1)
            for y in reach
            for z in (-0.01, 0.01)
        ]
    )


@pytest.mark.parametrize("height", [0.012, 0.03, 0.2])
def test_what_is_wider_than_the_fingers_open_is_taken_by_an_edge_of_any_side(height):
    box = Box(0.4, 0.36, height)
    points, fingers, palms = over_edges(corners_of_fingers, OPENING, box, box.corners)
    sides = {tuple(np.sign(np.round(p[:2], 1))) for p in points}
    assert {(1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0)} <= sides
    for point, finger, palm in zip(points, fingers, palms, strict=True):
        hand = corners_of_fingers(finger, palm) + point
        assert hand[:, 2].min() > 0.0 and box.distance(hand).min() > -0.005
        assert palm[2] < -0.8 and finger @ -point > 0.0  # it comes from above, the inner finger over the object
    assert holds(corners_of_fingers, OPENING, box, points, fingers, palms).all()
    assert not holds(corners_of_fingers, OPENING, box, points - 0.1 * fingers, fingers, palms).any()
    assert not holds(corners_of_fingers, OPENING, box, points - 0.08 * palms, fingers, palms).any()


def test_a_sheet_is_taken_by_its_corners_with_a_side_of_the_fingers_on_the_floor():
    sheet = Box(0.14, 0.18, 0.003)
    points, fingers, palms = around_corners(corners_of_fingers, OPENING, sheet, sheet.corners)
    assert {tuple(np.sign(p[:2])) for p in points} == {(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)}
    for point, finger, palm in zip(points, fingers, palms, strict=True):
        hand = corners_of_fingers(finger, palm) + point
        tips = hand[np.argsort(hand[:, 2])[:4]]  # the lowest corners of both fingers, inner and outer ones
        assert np.allclose(tips[:, 2], 0.0, atol=1e-6) and sheet.distance(hand).min() > 0.0
        right, left = (tips[(tips - point) @ finger * s > 0].mean(0) for s in (-1, 1))
        between = right + np.linspace(0.0, 1.0, 50)[:, None] * (left - right) + [0.0, 0.0, 0.002]
        assert (sheet.distance(between) < 0.0).any()
        assert palm[2] > -0.5  # almost level
    thick = Box(0.14, 0.18, 0.012)
    assert not len(around_corners(corners_of_fingers, OPENING, thick, thick.corners)[0])


def test_between_the_fingers_is_what_is_thinner_than_they_bite():
    down, across = np.array([[0.0, 0.0, -1.0]]), np.array([[1.0, 0.0, 0.0]])
    pen = Box(0.02, 0.15, 0.01)
    top = np.array([[0.0, 0.0, 0.01]])
    assert len(between_fingers(pen, top, across, down, OPENING, BITE)[0]) == 0
    found, points = between_fingers(pen, top, across, down, OPENING, SHALLOW)
    assert len(found) == 3 and np.allclose(points[0], top[0], atol=0.005)
