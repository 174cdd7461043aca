"""Tasks by name: one line for each. Names are known without importing any task."""

from __future__ import annotations

import pkgutil
import re
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ig2mj.tasks.custom.definition import RegisteredTask
    from ig2mj.tasks.navigation.task import NavigationTask
    from ig2mj.tasks.task import Task

TASKS: dict[str, str] = {
    "GraspingBook": "ig2mj.tasks.activities.grasping_book:GRASPING_BOOK",
    "SoakingTowel": "ig2mj.tasks.activities.soaking_towel:SOAKING_TOWEL",
    "CleaningStainedShelf": "ig2mj.tasks.activities.cleaning_stained_shelf:CLEANING_STAINED_SHELF",
    "CookingMeat": "ig2mj.tasks.activities.cooking_meat:COOKING_MEAT",
    "SlicingFruit": "ig2mj.tasks.activities.slicing_fruit:SLICING_FRUIT",
    "BimanualPickAndPlace": "ig2mj.tasks.activities.bimanual_pick_and_place:BIMANUAL_PICK_AND_PLACE",
    "PointNavigation": "ig2mj.tasks.navigation.task:POINT_NAVIGATION",
    "InteractiveNavigation": "ig2mj.tasks.navigation.task:INTERACTIVE_NAVIGATION",
    "DynamicNavigation": "ig2mj.tasks.navigation.task:DYNAMIC_NAVIGATION",
    "Reaching": "ig2mj.tasks.navigation.task:REACHING",
    "RoomRearrangement": "ig2mj.tasks.navigation.task:ROOM_REARRANGEMENT",
}
"""Where each is defined ("module:name"), in the order of `ig2mj.list_envs`."""


REGISTERED: dict[str, RegisteredTask] = {}
"""Tasks of this process that `ig2mj.register_task` has made known, by name."""

_REFERENCE = re.compile(r"(?P<file>.+\.py):(?P<name>[^:/\\]*)", re.DOTALL)


def split_reference(name: str) -> tuple[str, str] | None:
    """File and name of "my_tasks.py:MugToTable", the name '' of "my_tasks.py"; None of other names."""
    if name.endswith(".py"):
        return name, ""
    match = _REFERENCE.fullmatch(name)
    return None if match is None else (match["file"], match["name"])


def load_task(name: str) -> Task | NavigationTask:
    """The task of a name of `TASKS`."""
    return pkgutil.resolve_name(TASKS[name])
