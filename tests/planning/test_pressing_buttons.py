"""How hands press buttons: palm down, and grippers on arms also level and obliquely, which reach farther."""

import numpy as np
import pytest

from ig2mj.agents.fetch.figures import FINGERS, JOINTS, UPPER
from ig2mj.planning.switching import NEAR_BUTTON, SLOPES, pressings
from ig2mj.states.definitions.toggled_on import BUTTON_DISTANCE

BUTTON, FRONT = np.array([0.4, -0.2, 1.0]), np.array([0.6, 0.8, 0.0])
APART = float(JOINTS[FINGERS[0]].origin[1] + UPPER[FINGERS[0]])
"""m from Fetch's grasp point to each finger's frame when its gripper is open."""


@pytest.mark.parametrize("slope", [None, *SLOPES])
def test_a_finger_presses_the_button(slope):
    for pressing, lower in pressings(BUTTON, FRONT, slope):
        fingers = pressing.at + APART * np.array([[1.0], [-1.0]]) * pressing.fingers
        assert np.linalg.norm(fingers - BUTTON, axis=1).min() < BUTTON_DISTANCE - 0.02
        assert np.isclose(np.linalg.norm(pressing.aim - pressing.at), NEAR_BUTTON)
        assert np.isclose(pressing.palm @ pressing.fingers, 0.0)
        assert lower == pytest.approx(max(0.0, BUTTON[2] - pressing.at[2])) or slope is not None


@pytest.mark.parametrize("slope", SLOPES)
def test_a_gripper_that_slopes_points_at_the_button(slope):
    for pressing, _ in pressings(BUTTON, FRONT, slope):
        ahead = BUTTON - pressing.at
        assert ahead @ pressing.palm == pytest.approx(np.linalg.norm(ahead))
        assert (BUTTON - pressing.at) @ FRONT > 0.0
