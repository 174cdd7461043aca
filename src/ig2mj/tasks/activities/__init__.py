"""The six activities of the paper's experiments (appendix A.3), one file each.

Every home has at least 60 objects, of which nothing is removed. Robots start where all that an activity needs is within
reach from free floor; where that takes it, start states are restricted to what is near.
"""

from __future__ import annotations

from ig2mj.tasks.activities.bimanual_pick_and_place import BIMANUAL_PICK_AND_PLACE
from ig2mj.tasks.activities.cleaning_stained_shelf import CLEANING_STAINED_SHELF
from ig2mj.tasks.activities.cooking_meat import COOKING_MEAT
from ig2mj.tasks.activities.grasping_book import GRASPING_BOOK
from ig2mj.tasks.activities.slicing_fruit import SLICING_FRUIT
from ig2mj.tasks.activities.soaking_towel import SOAKING_TOWEL
from ig2mj.tasks.task import Task

ACTIVITIES: dict[str, Task] = {
    task.name: task
    for task in (
        GRASPING_BOOK,
        SOAKING_TOWEL,
        CLEANING_STAINED_SHELF,
        COOKING_MEAT,
        SLICING_FRUIT,
        BIMANUAL_PICK_AND_PLACE,
    )
}
"""Activities by name, in the paper's order."""
