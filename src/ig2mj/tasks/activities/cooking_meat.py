"""Cooking Meat: a steak next to the stove must be brought to a burner that is on.

The paper's meat lies on a shelf; ours lies on the counter next to the stove of birch's kitchen. The expert takes the
steak from above, carries it over the burner, and holds it there. Where nothing sticks it draws the steak over the
counter onto the stove.
"""

from __future__ import annotations

from ig2mj.scene.tables import LinkKind
from ig2mj.tasks.experts.motion import HandMotion, hand_motion, over, where
from ig2mj.tasks.experts.pushing import draw
from ig2mj.tasks.experts.reaching import take
from ig2mj.tasks.experts.sight import ExpertView
from ig2mj.tasks.points import At, Hand, Heat
from ig2mj.tasks.task import HUMANOID_WEIGHTS, RIGHT, Acts, Fit, Near, Task

MEAT, STOVE = "steak_0", "stove_0"

ABOVE = 0.10
"""m above the burner at which the steak cooks; its reach is 0.2 m."""

CARRY = 0.05
"""m higher on the way."""


def plan(see: ExpertView) -> list[HandMotion]:
    """One hand."""
    if see.physical:
        return [draw(see, MEAT, see.goal(Heat(STOVE)))]
    over_burner = see.goal(Heat(STOVE), ABOVE)
    carry = hand_motion(over(see.com(MEAT), over_burner, over_burner[:, 2] + CARRY), close=True)
    return [where(see.holds(MEAT), carry, take(see, MEAT))]


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
    expert=plan,
    fit=Fit(
        surface="bottom_cabinet_1",
        surfaces=("bottom_cabinet", "countertop", "dishwasher", "console_table", "sink"),
        anchor="stove_0",
        anchors=("stove",),
        link=LinkKind.HEAT_SOURCE,
        target=(0.67, -0.5),
        heights=(0.7, 1.1),
    ),
)
