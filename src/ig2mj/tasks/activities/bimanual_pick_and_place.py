"""Bimanual Pick and Place: a cauldron must be lifted with both hands from the floor onto a table.

The floor next to birch's coffee table is covered by a carpet, on which the cauldron stands.

The distances are those of iGibson's bimanual experiments: of each hand to the cauldron, and of the cauldron to 0.25 m
above the table. One arm cannot do it, so Fetch has no part in it, as in the paper. Each hand of the expert takes the
cauldron at its side of the rim, and both lift it onto the table.
"""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np

from ig2mj.geometry.poses import quat_rotate
from ig2mj.tasks.experts.motion import HandMotion, hand_motion, over, where
from ig2mj.tasks.experts.reaching import take_at
from ig2mj.tasks.experts.sight import ExpertView
from ig2mj.tasks.points import At, Hand
from ig2mj.tasks.task import BIMANUAL_WEIGHTS, BOTH, Acts, Fit, Near, Task

POT, TABLE = "cauldron_0", "coffee_table_0"

SIDE = 0.13
"""m from the middle of the cauldron, to the left and to the right of the robot, at which hands take its rim."""

INSIDE = 0.18
"""m from the table's edges at which the cauldron's middle is put down, at least."""

CLEARANCE = 0.05
"""m between cauldron and table on the way."""


def plan(see: ExpertView) -> list[HandMotion]:
    """Both hands, the left one first."""
    pot, (low, high) = see.com(POT), see.box(POT)
    table_low, table_high = see.box(TABLE)
    both = see.holds(POT, 0) & see.holds(POT, 1)
    stands = table_high[:, 2] + pot[:, 2] - low[:, 2]  # of its centre of mass
    place = jnp.clip(pot[:, :2], table_low[:, :2] + INSIDE, table_high[:, :2] - INSIDE)
    goal = jnp.concatenate([place, stands[:, None] - 0.02], axis=1)
    lift = hand_motion(over(pot, goal, stands + CLEARANCE), close=True)
    wishes = []
    for hand, side in ((0, SIDE), (1, -SIDE)):
        left = quat_rotate(see.base_quat(), jnp.asarray(np.array([0.0, side, 0.0], np.float32)))
        rim = jnp.concatenate([(0.5 * (low + high) + left)[:, :2], high[:, 2:]], axis=1)
        wait = hand_motion(jnp.zeros_like(pot), close=True)
        alone = where(see.holds(POT, hand), wait, take_at(see, rim, hand))
        wishes.append(where(both, lift, alone))
    return wishes


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
    expert=plan,
    fit=Fit(
        surface="carpet_0", surfaces=("carpet",), anchor=TABLE, anchors=("coffee_table",), on_floor=True, within=1.05
    ),
)
