"""A task for tests: an apple that lies on an armchair of home birch belongs on the coffee table."""

from __future__ import annotations

from ig2mj.tasks.points import At, Hand
from ig2mj.tasks.task import Acts, Task

APPLE_ON_TABLE = Task(
    name="AppleOnTable",
    summary="Put the apple on the coffee table.",
    home="birch",
    objects=("apple",),
    start=("(on_top apple_0 armchair_0)",),
    near=(),
    goal="(on_top apple_0 coffee_table_0)",
    objects_of_interest=("apple_0",),
    distances=((Hand(0), At("apple_0")), (At("apple_0"), At("coffee_table_0"))),
    robots={"humanoid": Acts((1.9, -1.0, 0.55), yaw=90.0)},
    grasping="assisted",
)
