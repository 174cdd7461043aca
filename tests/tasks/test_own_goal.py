"""Goals in homes as tasks: what they are about."""

from __future__ import annotations

import pytest

from ig2mj.errors import UnknownNameError
from ig2mj.tasks.own_goal import goal_task


def test_a_goal_is_about_its_objects_not_about_substances_or_rooms():
    task = goal_task("small_home", "(and (filled bowl_0 milk) (covered plate_0 mud) (ontop bowl_0 plate_0))")
    assert task.objects_of_interest == ("bowl_0", "plate_0")


def test_a_goal_of_no_predicate_is_refused():
    with pytest.raises(UnknownNameError, match="filed"):
        goal_task("small_home", "(filed bowl_0 milk)")
