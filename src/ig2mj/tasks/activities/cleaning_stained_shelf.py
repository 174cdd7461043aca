"""Cleaning Stained Shelf: a wet towel must wipe the stains off a shelf; half of them may stay."""

from __future__ import annotations

from ig2mj.tasks.points import At, Hand, NearestStain
from ig2mj.tasks.task import HUMANOID_WEIGHTS, RIGHT, Acts, Near, Task

CLEANING_STAINED_SHELF = Task(
    name="CleaningStainedShelf",
    summary="Wipe half of the stains off the shelf with the wet towel.",
    home="fir",
    objects=("bath_towel",),
    start=("(on_top bath_towel_0 shelf_1)", "(soaked bath_towel_0)", "(stained shelf_1)"),
    near=(Near("bath_towel_0", (0.0, 3.25, 0.85), most=1.0),),
    flat=("bath_towel_0",),
    goal="(not (stained shelf_1))",
    objects_of_interest=("bath_towel_0", "shelf_1"),
    distances=((Hand(0), At("bath_towel_0")), (At("bath_towel_0"), NearestStain("shelf_1", "bath_towel_0"))),
    robots={
        "humanoid": Acts((-0.15, 3.4, 0.55), yaw=90.0, hands=RIGHT, weights=HUMANOID_WEIGHTS),
        "fetch": Acts((-0.05, 3.3, 0.0), yaw=60.0),
    },
    stains_of="shelf_1",
)
