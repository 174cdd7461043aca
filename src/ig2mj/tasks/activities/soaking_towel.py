"""Soaking Towel: a towel on the dishwasher must be held under a tap that runs.

Towels are rigid, and folded flat they are wider than Fetch's gripper opens. With "physical" grasping the towel is
rolled up and stands on end, 7 cm across and 19 cm high, to the left of Fetch, which looks there: straight ahead it sees
the sink, which is always at one place, and no towel.
"""

from __future__ import annotations

from ig2mj.tasks.points import At, Hand, Water
from ig2mj.tasks.task import HUMANOID_WEIGHTS, RIGHT, Acts, Near, Physical, Task

SOAKING_TOWEL = Task(
    name="SoakingTowel",
    summary="Hold the towel under the running tap until it is soaked.",
    home="cedar",
    objects=("bath_towel",),
    start=("(on_top bath_towel_0 dishwasher_0)", "(toggled_on sink_0)"),
    near=(Near("bath_towel_0", (2.74, -2.95, 0.85), most=1.05),),
    flat=("bath_towel_0",),
    goal="(soaked bath_towel_0)",
    objects_of_interest=("bath_towel_0", "sink_0"),
    distances=((Hand(0), At("bath_towel_0")), (At("bath_towel_0"), Water("sink_0"))),
    robots={
        "humanoid": Acts((2.95, -2.95, 0.55), yaw=-45.0, hands=RIGHT, weights=HUMANOID_WEIGHTS),
        "fetch": Acts((2.78, -2.92, 0.0), yaw=-60.0),
    },
    physical=Physical(
        tuple((f"bath_towel/bath_towel_{number:02d}",) for number in (5, 6, 7)),
        near=(Near("bath_towel_0", (3.3, -2.9, 0.95), most=0.55),),
        robots={"fetch": Acts((2.78, -2.92, 0.0), yaw=-60.0, camera_tilt=0.75, camera_pan=1.25)},
    ),
)
