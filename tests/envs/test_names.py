"""Names of environments, in all forms in which they are written."""

from __future__ import annotations

import pytest

from ig2mj.envs.names import NAMES, activity_name, short_name
from ig2mj.envs.registry import TASKS, find_task
from ig2mj.errors import UnknownNameError


@pytest.mark.parametrize("name", ["CookingMeat", "ig2mj/CookingMeat", "ig2mj/CookingMeat-v0"])
def test_a_name_may_have_a_namespace_and_a_version(name):
    assert short_name(name) == "CookingMeat"


@pytest.mark.parametrize("name", ["CookingMeat-v1", "CookingMeet", "gym/CookingMeat", ""])
def test_other_names_are_unknown(name):
    assert short_name(name) is None
    with pytest.raises(UnknownNameError):
        find_task(name)


def test_every_name_has_a_task():
    assert list(NAMES) == list(TASKS)
    assert all(task.name == name for name, task in TASKS.items())


@pytest.mark.parametrize("name", ["activity/cleaning_windows", "ig2mj/activity/cleaning_windows-v0"])
def test_activities_of_behavior_have_a_folder_of_names(name):
    assert activity_name(name) == "cleaning_windows"
    assert activity_name("cleaning_windows") is None


def test_an_activity_that_does_not_exist_has_near_matches():
    with pytest.raises(UnknownNameError, match="cleaning_windows"):
        find_task("activity/cleaning_window")
