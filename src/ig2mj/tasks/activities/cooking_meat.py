"""Cooking Meat: a steak beside the stove must be brought to a burner that is on.

The paper's meat lies on a shelf; ours lies on the counter next to the stove of birch's kitchen.
"""

from __future__ import annotations

from ig2mj.tasks.points import At, Hand, Heat
from ig2mj.tasks.task import HUMANOID_WEIGHTS, RIGHT, Acts, Near, Task

COOKING_MEAT = Task(
    name="CookingMeat",
    summary="Bring the steak from the counter to the burner until it is cooked.",
    home="birch",
    objects=("steak",),
    start=("(on_top steak_0 bottom_cabinet_1)", "(toggled_on stove_0)"),
    near=(Near("steak_0", (-2.1, -1.83, 0.85), most=1.0),),
    flat=("steak_0",),
    goal="(cooked steak_0)",
    objects_of_interest=("steak_0", "stove_0"),
    distances=((Hand(0), At("steak_0")), (At("steak_0"), Heat("stove_0"))),
    robots={
        "humanoid": Acts((-2.25, -1.68, 0.55), yaw=90.0, hands=RIGHT, weights=HUMANOID_WEIGHTS),
        "fetch": Acts((-2.2, -1.65, 0.0), yaw=90.0),
    },
)
