"""What a gripper lets fall into a container from over its rim: a box of 0.4 x 0.4 x 0.36 m with thin sides."""

from __future__ import annotations

import numpy as np
import pytest

from ig2mj.geometry.host_rotations import about_vertical
from ig2mj.planning.clearance import Obstacles
from ig2mj.planning.over_mouths import ABOVE, _cells, _falling, _rotations
from ig2mj.planning.world import HELD_MARGIN, PlannedWorld

SIDE, HEIGHT, WALL = 0.4, 0.36, 0.005
CORNERS = np.array([[x, y, z] for x in (-SIDE / 2, SIDE / 2) for y in (-SIDE / 2, SIDE / 2) for z in (0.0, HEIGHT)])


def _plate(middle, size):
    return np.array(middle) - np.array(size) / 2, np.array(middle) + np.array(size) / 2


BOTTOM = _plate((0.0, 0.0, WALL / 2), (SIDE, SIDE, WALL))
SIDES = [_plate((s * SIDE / 2, 0.0, HEIGHT / 2), (WALL, SIDE, HEIGHT)) for s in (-1, 1)]
ENDS = [_plate((0.0, s * SIDE / 2, HEIGHT / 2), (SIDE, WALL, HEIGHT)) for s in (-1, 1)]
FLAPS = [_plate((s * SIDE / 4, 0.0, HEIGHT), (SIDE / 2, SIDE, WALL)) for s in (-1, 1)]


class _Obstacles(Obstacles):
    """Boxes, given by their lower and upper corners, turned about the vertical."""

    def __init__(self, boxes, turn=0.0):
        self._boxes, self._frame = boxes, about_vertical(turn)

    def distance(self, points):
        own = points @ self._frame
        return np.min([np.maximum(low - own, own - high).max(-1) for low, high in self._boxes], axis=0)

    def clear_at(self, spheres, points, together=64):
        at = points[:, None] + spheres[None, :, :3]
        return (self.distance(at) > spheres[:, 3]).all(1)


class _World(PlannedWorld):
    """A hand at the origin of the world that holds a block by its middle."""

    def __init__(self, size):
        half = np.array(size) / 2
        self._block = np.array([[x, y, z] for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1)]) * half

    def points(self, name):
        return self._block

    def grip(self, hand):
        return np.zeros(3)

    def pose(self, name):
        return np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0])


@pytest.mark.parametrize("turn", [0.0, 0.6])
def test_places_above_a_mouth_are_within_the_box_however_it_is_turned(turn):
    cells = _cells(CORNERS @ about_vertical(turn).T, _Obstacles([BOTTOM, *SIDES, *ENDS], turn))
    own = np.column_stack([cells, np.zeros(len(cells))]) @ about_vertical(turn)
    assert len(cells) > 40
    assert np.abs(own).max() < SIDE / 2 - HELD_MARGIN


def test_none_are_above_a_flap_that_is_shut():
    cells = _cells(CORNERS, _Obstacles([BOTTOM, *SIDES, *ENDS, FLAPS[0]]))
    assert len(cells) and cells[:, 0].min() > 0.0
    assert not len(_cells(CORNERS, _Obstacles([BOTTOM, *SIDES, *ENDS, *FLAPS])))


def test_a_block_falls_in_the_middle_of_the_open_half_with_its_middle_below_the_rim():
    obstacles = _Obstacles([BOTTOM, *SIDES, *ENDS, FLAPS[0]])
    cells = _cells(CORNERS, obstacles)
    spot = _falling(_World((0.08, 0.2, 0.1)), "block", 0, np.eye(3), cells, CORNERS, obstacles)
    assert spot is not None
    assert spot.pos[:2] == pytest.approx((SIDE / 4, 0.0), abs=0.03)
    assert spot.pos[2] < HEIGHT < spot.pos[2] - 0.05 + spot.drop + ABOVE


def test_what_is_wider_than_the_open_half_falls_in_on_edge_only():
    obstacles = _Obstacles([BOTTOM, *SIDES, *ENDS, FLAPS[0]])
    cells, book = _cells(CORNERS, obstacles), _World((0.25, 0.25, 0.03))
    upright = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
    assert _falling(book, "block", 0, np.eye(3), cells, CORNERS, obstacles) is None
    assert _falling(book, "block", 0, upright, cells, CORNERS, obstacles) is not None


def test_the_turn_in_which_it_is_carried_comes_first():
    oblique = np.array([np.sqrt(1.0 - 0.44**2), 0.0, -0.44])
    found = _rotations(np.eye(3), oblique, 0.0)
    assert found[0] == pytest.approx(np.eye(3), abs=1e-9)
    assert all(rotation @ rotation.T == pytest.approx(np.eye(3), abs=1e-9) for rotation in found)
