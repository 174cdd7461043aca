"""Cleaning Stained Shelf: a wet towel must wipe the stains off a shelf; half of them may stay.

The shelf is a board on the wall of birch's kitchen, open to all sides but the wall's. Our homes' own shelves are
bookcases, of whose stains few can be reached within an episode: those on the back, in the corners and behind cannot.
The towel is a folded hand towel whose underside wipes, and lies on it: towels are rigid, and turning one over
takes a third of an episode. Stains are spread evenly over all faces of the board but its underside.
"""

from __future__ import annotations

from ig2mj.tasks.points import At, Hand, NearestStain
from ig2mj.tasks.task import HUMANOID_WEIGHTS, RIGHT, Acts, Task

SHELF = "shelf/shelf_14@-1,-3.405,0.9,90"
"""Where the board is fixed: its middle 14.5 cm from the wall, its top 92.5 cm above the floor."""

CLEANING_STAINED_SHELF = Task(
    name="CleaningStainedShelf",
    summary="Wipe half of the stains off the shelf with the wet towel.",
    home="birch",
    objects=("hand_towel", SHELF),
    start=("(on_top hand_towel_0 shelf_2)", "(soaked hand_towel_0)", "(stained shelf_2)"),
    near=(),
    upright=("hand_towel_0",),
    goal="(not (stained shelf_2))",
    objects_of_interest=("hand_towel_0", "shelf_2"),
    distances=((Hand(0), At("hand_towel_0")), (At("hand_towel_0"), NearestStain("shelf_2", "hand_towel_0"))),
    robots={
        "humanoid": Acts((-1.15, -2.83, 0.55), yaw=-90.0, hands=RIGHT, weights=HUMANOID_WEIGHTS),
        "fetch": Acts((-1.15, -2.62, 0.0), yaw=-90.0),
    },
    stains_of="shelf_2",
)
