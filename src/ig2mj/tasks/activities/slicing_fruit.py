"""Slicing Fruit: an apple must be cut with a knife that lies on the same table.

With "physical" grasping the knife has a stout handle, 3.6 cm wide and 5 cm high, on which it stands with its edge down.
Of the other's handle, which is 2.1 cm high as it lies, fingers over a table hold a centimetre, and it slips from them.
"""

from __future__ import annotations

from ig2mj.tasks.points import At, Hand
from ig2mj.tasks.task import HUMANOID_WEIGHTS, RIGHT, Acts, Near, Physical, Task

NEAR = (
    Near("apple_0", (2.15, -0.1, 0.85), most=0.95),
    Near("carving_knife_0", (2.15, -0.1, 0.85), most=0.95),
)

SLICING_FRUIT = Task(
    name="SlicingFruit",
    summary="Cut the apple on the coffee table with the knife.",
    home="birch",
    objects=("apple", "carving_knife"),
    start=("(on_top apple_0 coffee_table_0)", "(on_top carving_knife_0 coffee_table_0)"),
    near=NEAR,
    flat=("carving_knife_0",),
    goal="(sliced apple_0)",
    objects_of_interest=("carving_knife_0", "apple_0"),
    distances=((Hand(0), At("carving_knife_0")), (At("carving_knife_0"), At("apple_0"))),
    robots={
        # 5 cm nearer, the camera loses one apple in seven, which lies below its picture or beside it.
        "humanoid": Acts((2.24, -0.03, 0.55), hands=RIGHT, weights=HUMANOID_WEIGHTS),
        # At the usual 0.45 rad most of the low table before it is below its picture.
        "fetch": Acts((2.28, -0.12, 0.015), yaw=-15.0, camera_tilt=1.0),
    },
    physical=Physical(
        tuple((f"apple/apple_{apple:02d}", f"carving_knife/carving_knife_{4 + apple:02d}") for apple in range(3)),
        near=NEAR,
    ),
)
