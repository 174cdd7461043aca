"""Links between the fingers of a gripper that pulls a door: by a handle there are several places."""

from __future__ import annotations

import numpy as np
import pytest

from ig2mj.planning import opening
from ig2mj.planning.clearance import Obstacles
from ig2mj.planning.pinches import SPARE_OPENING

OPENING = 0.1


class _Bar(Obstacles):
    """A handle, level along y: 2 cm high, and as long as given (m), about the origin."""

    def __init__(self, long: float):
        self._half = np.array([0.05, long / 2, 0.01])

    def distance(self, points):
        beyond = np.abs(points) - self._half
        return np.linalg.norm(np.maximum(beyond, 0.0), axis=-1) + np.minimum(beyond.max(-1), 0.0)


@pytest.mark.parametrize(("long", "across"), [(0.06, {1, 2}), (0.3, {2})])
def test_a_handle_is_taken_across_and_near_either_finger(long, across):
    """Along its length where it fits between the fingers, and across; in the middle first."""
    grip = np.array([0.05, 0.0, 0.0]), np.array([1.0, 0.0, 0.0])
    found = opening._pinched(_Bar(long), grip, OPENING)
    assert {int(np.argmax(np.abs(fingers))) for _, fingers in found} == across
    assert len(found) == 3 * len(across)
    for k in range(0, len(found), 3):
        fingers = found[k][1]
        off = [float((point - grip[0]) @ fingers) for (point, _), _ in found[k : k + 3]]
        assert abs(off[0]) < 0.01 and off[1] > 0.005 > -0.005 > off[2]
        assert max(np.abs(off)) < OPENING / 2 - SPARE_OPENING


def test_a_flat_face_is_not_taken_between_fingers():
    grip = np.array([0.05, 0.0, 0.0]), np.array([1.0, 0.0, 0.0])
    wall = _Bar(2.0)
    wall._half = np.array([0.05, 1.0, 1.0])
    assert opening._pinched(wall, grip, OPENING) == []
