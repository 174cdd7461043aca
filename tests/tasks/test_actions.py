"""Actions of tasks: +-1 is 0.5 m/s and 0.5 rad/s of a hand, and nothing else moves (appendix A.3)."""

from __future__ import annotations

import numpy as np
import pytest

from ig2mj.agents import Fetch, Humanoid
from ig2mj.agents.fetch import FetchController
from ig2mj.agents.humanoid import HumanoidController
from ig2mj.tasks.actions import hand_actions

HUMANOID = HumanoidController.action_names, Humanoid.hand_controls
FETCH = FetchController.action_names, Fetch.hand_controls


@pytest.mark.parametrize(
    ("robot", "hands", "closing", "size"),
    [
        (HUMANOID, (1,), False, 6),
        (HUMANOID, (1,), True, 7),
        (HUMANOID, (0, 1), False, 12),
        (HUMANOID, (0, 1), True, 14),
        (FETCH, (0,), False, 6),
        (FETCH, (0,), True, 7),
    ],
)
def test_numbers_of_an_action(robot, hands, closing, size):
    assert hand_actions(*robot, hands, closing).size == size


def test_one_is_half_a_metre_per_second_of_the_right_hand():
    full = np.asarray(hand_actions(*HUMANOID, (1,), False)(np.full((1, 6), 3.0, np.float32)))[0]
    assert full[20:26] == pytest.approx([0.05] * 6)  # m and rad in 0.1 s; more than 1 is clipped
    assert not full[:20].any() and not full[26:].any()


def test_fetch_keeps_its_gripper_open_where_it_is_not_asked():
    action = np.asarray(hand_actions(*FETCH, (0,), False)(np.ones((1, 6), np.float32)))[0]
    assert action[FETCH[0].index("gripper")] == 1.0
    assert not action[:4].any()
