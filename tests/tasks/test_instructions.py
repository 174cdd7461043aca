"""Instructions of tasks: several wordings, some of them held out."""

from __future__ import annotations

import pytest

from ig2mj.envs.registry import find_task
from ig2mj.tasks.instructions import WORDINGS, wordings


@pytest.mark.parametrize("name", [*WORDINGS, "PointNavigation", "goal/small_home (inside apple_0 fridge_0)"])
def test_every_task_has_eight_wordings_and_four_that_are_held_out(name):
    task = find_task(name)
    usual, held_out = wordings(task), wordings(task, held_out=True)
    assert len(set(usual)) == 8 and len(set(held_out)) == 4 and not set(usual) & set(held_out)
    assert all(text[0].isupper() and text[-1] in ".?" for text in (*usual, *held_out))


def test_goals_are_said_in_words():
    task = find_task("goal/small_home (inside apple_0 fridge_0)")
    assert wordings(task)[1] == "Please see to it that apple 0 is inside fridge 0."
