"""Cooking Meat: take the steak from above, carry it over the burner, and hold it there. Where nothing sticks it is
drawn over the counter onto the stove.
"""

from __future__ import annotations

from ig2mj.tasks.experts.motion import Wish, over, where, wish
from ig2mj.tasks.experts.pushing import draw
from ig2mj.tasks.experts.reaching import take
from ig2mj.tasks.experts.sight import Sight
from ig2mj.tasks.points import Heat

MEAT, STOVE = "steak_0", "stove_0"

ABOVE = 0.10
"""m above the burner at which the steak cooks; its reach is 0.2 m."""

CARRY = 0.05
"""m higher on the way."""


def plan(see: Sight) -> list[Wish]:
    """One hand."""
    if see.physical:
        return [draw(see, MEAT, see.goal(Heat(STOVE)))]
    over_burner = see.goal(Heat(STOVE), ABOVE)
    carry = wish(over(see.com(MEAT), over_burner, over_burner[:, 2] + CARRY), close=True)
    return [where(see.holds(MEAT), carry, take(see, MEAT))]
