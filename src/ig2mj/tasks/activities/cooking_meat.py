"""Cooking Meat: a steak next to the stove must be brought to a burner that is on.

The paper's meat lies on a shelf; ours lies on the counter next to the stove of birch's kitchen. The expert takes the
steak from above, carries it over the burner, and holds it there. Where nothing sticks it draws the steak over the
counter onto the stove.
"""

from __future__ import annotations

import dataclasses

import jax.numpy as jnp

from ig2mj.geometry.poses import length, quat_rotate_inverse
from ig2mj.scene.tables import LinkKind
from ig2mj.tasks.experts.motion import HandMotion, hand_motion, over, pointing, where
from ig2mj.tasks.experts.pushing import draw
from ig2mj.tasks.experts.reaching import REACH, take
from ig2mj.tasks.experts.sight import ExpertView
from ig2mj.tasks.points import At, Hand, Heat
from ig2mj.tasks.task import HUMANOID_WEIGHTS, RIGHT, Acts, Fit, Near, Task

MEAT, STOVE = "steak_0", "stove_0"

ABOVE = 0.10
"""m above the burner at which the steak cooks; its reach is 0.2 m."""

CARRY = 0.05
"""m higher on the way."""

HIGH, PITCH = 1.0, 0.7
"""m above the floor from which on an arm takes the steak with a gripper that points outwards, and rad by which it then
points down: a steeper one has its wrist at the height of wall cabinets, and its elbow at that of the counter."""

TURNED, ASIDE, RAISED = 0.5, -0.3, 0.1
"""rad of a turn that is still to be made above which the gripper would sweep a steak beyond `REACH`. It does not move
sideways until then, and stays below wall cabinets. Where the steak lies on the arm's side, by so many m to the left of
the robot's middle, the elbow would sweep it, and the gripper comes so many m higher instead."""


def plan(see: ExpertView) -> list[HandMotion]:
    """One hand."""
    if see.physical:
        return [draw(see, MEAT, see.goal(Heat(STOVE)))]
    over_burner = see.goal(Heat(STOVE), ABOVE)
    carry = hand_motion(over(see.com(MEAT), over_burner, over_burner[:, 2] + CARRY), close=True)
    if not see.on_arm:
        return [where(see.holds(MEAT), carry, take(see, MEAT))]
    offset = see.com(MEAT) - see.base_pos()
    high = offset[:, 2] > HIGH
    turn = jnp.where(high[:, None], pointing(see.hand_quat(), offset, PITCH), 0.0)
    turns = (length(turn) > TURNED) & (length(offset[:, :2]) > REACH)
    aside = quat_rotate_inverse(see.base_quat(), offset)[:, 1] < ASIDE
    get = take(see, MEAT, above=RAISED * (turns & aside))
    across = jnp.where((turns & ~aside)[:, None], 0.0, get.move[:, :2])
    get = dataclasses.replace(get, move=jnp.concatenate([across, get.move[:, 2:]], axis=1))
    return [dataclasses.replace(where(see.holds(MEAT), carry, get), turn=turn)]


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
