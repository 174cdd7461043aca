"""Where hands carry what they hold, from where a base puts it away, and how far an arm has to reach."""

from types import SimpleNamespace

import numpy as np
import pytest

from ig2mj.planning.moves import goes_on
from ig2mj.planning.world import AWAY, BODY_SPARE, PlannedWorld

TRUNK = 0.3


class _World(PlannedWorld):
    """A robot at the origin that looks along y and holds a board of 0.4 m before it."""

    def __init__(self, opening, held="board"):
        body = SimpleNamespace(opening=opening, carry=np.array([[0.3, 0.1, 1.1]]), trunk=(TRUNK, 1.5), stands=0.0)
        self.body, self._held = body, held  # pyright: ignore[reportAttributeAccessIssue]

    @property
    def base(self):
        return np.zeros(2), np.pi / 2

    @property
    def held(self):
        return [self._held]

    def vertices(self, name):
        return np.array([[x, y, 1.0] for x in (-0.2, 0.2) for y in (0.5, 0.9)])

    def grip(self, hand):
        return np.array([0.0, 0.51, 1.05])


def test_an_arm_carries_a_board_farther_from_the_body_that_reaches_back_from_the_hand():
    """The hand turns with it on its way, so that it has half its width at least."""
    assert _World(0.1).carry(0)[0] == pytest.approx(TRUNK + BODY_SPARE + 0.4 / np.sqrt(2))
    assert _World(None).carry(0)[0] == pytest.approx(TRUNK + BODY_SPARE + 0.4 / np.sqrt(2))
    behind = np.array([0.0, 0.9, 1.05])
    assert _World(0.1, held="").carry(0, "board", behind)[0] == pytest.approx(TRUNK + BODY_SPARE + 0.4)


def test_a_base_stands_nearer_to_what_its_gripper_puts_away_from_it():
    board = np.array([[0.0, y, 0.0, 0.01] for y in (0.0, 0.2, 0.4)])
    down, away = np.array([0.0, 0.0, -1.0]), np.array([0.0, 0.6, -0.8])
    assert _World(0.1).away(board, away) == pytest.approx(AWAY)
    assert _World(0.1).away(board, -away) > AWAY + 0.2
    assert _World(0.1).away(board, down) == _World(None).away(board, away) > AWAY + 0.2


class _Arm:
    """Reaches 0.8 m, whatever is in the way."""

    def reaches(self, point):
        return bool(np.linalg.norm(point) <= 0.8)

    def __call__(self, points):
        return self.passes(points)

    def passes(self, points):
        return all(self.reaches(point) for point in points)


def test_an_arm_has_to_reach_a_grasp_itself_not_only_the_place_before_it():
    before, grasp = np.array([0.75, 0.0, 0.0]), np.array([0.85, 0.0, 0.0])
    assert goes_on([before], before, _Arm()) and not goes_on([before], grasp, _Arm())
    assert goes_on([before], grasp, None) and not goes_on(None, before, None)
