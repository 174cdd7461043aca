"""Bimanual Pick and Place: a cauldron must be lifted with both hands from the floor onto a table.

The floor beside birch's coffee table is covered by a carpet, on which the cauldron stands.

The distances are those of iGibson's bimanual experiments: of each hand to the cauldron, and of the cauldron to 0.25 m
above the table. One arm cannot do it: Fetch has no part in it, as in the paper.
"""

from __future__ import annotations

from ig2mj.tasks.points import At, Hand
from ig2mj.tasks.task import BIMANUAL_WEIGHTS, BOTH, Acts, Near, Task

BIMANUAL_PICK_AND_PLACE = Task(
    name="BimanualPickAndPlace",
    summary="Lift the cauldron with both hands from the floor onto the coffee table.",
    home="birch",
    objects=("cauldron",),
    start=("(on_top cauldron_0 carpet_0)",),
    near=(
        Near("cauldron_0", (1.7, 0.0, 0.85), most=1.1),
        Near("cauldron_0", (1.85, 0.0, 0.15), most=0.8, least=0.42),
    ),
    goal="(on_top cauldron_0 coffee_table_0)",
    objects_of_interest=("cauldron_0", "coffee_table_0"),
    distances=(
        (Hand(0), At("cauldron_0")),
        (Hand(1), At("cauldron_0")),
        (At("cauldron_0"), At("coffee_table_0", above=0.25)),
    ),
    robots={"humanoid": Acts((1.85, 0.0, 0.55), hands=BOTH, weights=BIMANUAL_WEIGHTS)},
)
