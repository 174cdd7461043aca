"""Grasping Book: a notebook must be taken from a table.

The expert takes it from above and lifts it. Where nothing sticks it draws the notebook off the table: flat on the table
the notebook is wider than Fetch's gripper opens, and too thin to be taken by its edges.
"""

from __future__ import annotations

import jax.numpy as jnp

from ig2mj.tasks.experts.motion import HandMotion, hand_motion, where
from ig2mj.tasks.experts.pushing import draw
from ig2mj.tasks.experts.reaching import take
from ig2mj.tasks.experts.sight import ExpertView
from ig2mj.tasks.points import At, Hand
from ig2mj.tasks.task import HUMANOID_WEIGHTS, RIGHT, TABLES, Acts, Fit, Near, Task

TABLE = "coffee_table_0"

BEHIND = 0.04
"""m behind the notebook's middle that fingers press on."""

NEARER = 0.17
"""m from the table's near edge that the notebook is drawn to where it lies farther away: sideways, the arm is short."""

BEYOND = 0.06
"""m beyond the table's edge that the notebook's middle is drawn to."""


def plan(see: ExpertView) -> list[HandMotion]:
    """One hand: to the notebook, and up; or over the table's edge on its left or right."""
    (book,) = see.objects
    if see.physical:
        return [_off_the_table(see, book)]
    up = jnp.zeros_like(see.hand_pos()).at[:, 2].set(0.1)
    return [where(see.holds(book), hand_motion(up, close=True), take(see, book))]


def _off_the_table(see: ExpertView, book: str) -> HandMotion:
    low, high = see.box(book)
    edge_low, edge_high = see.box(TABLE)
    middle, side = 0.5 * (low + high), 0.5 * (edge_low + edge_high)[:, 1]
    goal_x = jnp.minimum(middle[:, 0], edge_low[:, 0] + NEARER)
    goal_y = jnp.where(middle[:, 1] > side, edge_high[:, 1] + BEYOND, edge_low[:, 1] - BEYOND)
    return draw(see, book, jnp.stack([goal_x, goal_y, middle[:, 2]], axis=1), BEHIND)


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
    expert=plan,
    fit=Fit(surface=TABLE, surfaces=TABLES, of_home=("notebook_0",)),
)
