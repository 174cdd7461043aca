"""A home before its furniture: walls, doors and windows stand, the ways before the doors are kept free."""

from __future__ import annotations

import random

import numpy as np

from ..plans.building import stair_boxes, wall_boxes
from ..plans.openings import opening_things
from ..plans.plan import Plan
from ..plans.porch import front_door, porch_rails
from .arrangement import AIR, Arrangement
from .ground import Ground
from .placed import Placed, yaw
from .room import HomeInProgress

WAY = 0.75  # m, kept free on both sides of a door
DOORMAT_AT = 0.45  # m, from the front door's wall to the middle of the mat


def start_home(
    plan: Plan, rng: random.Random, *, models: int = 3, limit: int | None = None, seed: int = 0
) -> HomeInProgress:
    """Doors and windows in their openings."""
    things = Arrangement(np.concatenate([wall_boxes(plan), stair_boxes(plan), porch_rails(plan)]))
    for opening, thing in opening_things(plan, seed):
        assert things.fits(thing), f"{plan.name}: the {opening.kind} between {opening.edge.rooms} has no room to open"
        thing.name = things.name(thing.category)
        things.put(thing)
    for opening in plan.openings:
        if opening.walkable and not plan.fully_open(opening.edge):
            edge = opening.edge
            p, q = edge.point(opening.low, -WAY), edge.point(opening.high, WAY)
            things.keep_free("way", np.array([[[p[0], p[1], 0.02], [q[0], q[1], 2.0]]]))
    return HomeInProgress(plan, things, Ground(plan), rng, models=models, limit=limit, seed=seed)


def lay_doormat(home: HomeInProgress) -> Placed | None:
    """A mat outside the front door."""
    door = front_door(home.plan)
    if door is None:
        return None
    outwards = -1.0 if door.edge.before is None else 1.0
    x, y = door.edge.point(door.centre, outwards * (door.edge.thickness / 2 + DOORMAT_AT))
    turn = yaw(90.0 if door.edge.axis == "x" else 0.0)
    index = home.index("mat")
    mat = Placed("mat", "mat", index, np.array([x, y, AIR]), turn, False, door.edge.rooms, seed=home.seed)
    if not home.things.fits(mat, ways=False):
        return None
    mat.name = home.things.name("mat")
    return home.things.put(mat)
