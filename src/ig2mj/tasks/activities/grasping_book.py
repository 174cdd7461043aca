"""Grasping Book: a notebook must be taken from a table."""

from __future__ import annotations

from ig2mj.tasks.points import At, Hand
from ig2mj.tasks.task import HUMANOID_WEIGHTS, RIGHT, Acts, Near, Task

GRASPING_BOOK = Task(
    name="GraspingBook",
    summary="Take the notebook from the coffee table.",
    home="birch",
    objects=(),
    start=("(on_top notebook_0 coffee_table_0)",),
    near=(Near("notebook_0", (2.15, -0.1, 0.85), most=0.95),),
    goal="(not (on_top notebook_0 coffee_table_0))",
    objects_of_interest=("notebook_0",),
    distances=((Hand(0), At("notebook_0")),),
    robots={
        "humanoid": Acts((2.3, 0.05, 0.55), hands=RIGHT, weights=HUMANOID_WEIGHTS),
        "fetch": Acts((2.3, 0.0, 0.015)),
    },
)
