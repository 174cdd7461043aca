"""A home before its furniture: walls, doors and windows stand, the ways before the doors are kept free."""

from __future__ import annotations

import random

import numpy as np

from ..plans.building import stair_boxes, wall_boxes
from ..plans.openings import opening_things
from ..plans.plan import Opening, Plan
from ..plans.porch import front_door, porch_rails
from .arrangement import AIR, WAY, Arrangement
from .ground import Ground
from .placed import Placed, yaw
from .room import HomeInProgress

WAY_DEPTH = 0.75  # m, kept free on both sides of a door
DOORMAT_AT = 0.45  # m, from the front door's wall to the middle of the mat


class NoRoomToOpen(Exception):
    """A door or a window that does not fit into its opening, or cannot open.

    Attributes:
      opening: where it is. problem: what is in the way, as the end of a sentence.
    """

    def __init__(self, plan: Plan, opening: Opening, problem: str):
        self.opening, self.problem = opening, problem
        super().__init__(f"{plan.name}: the {opening.kind} of {', '.join(opening.edge.rooms)} {problem}")


def start_home(
    plan: Plan, rng: random.Random, *, models: int = 3, limit: int | None = None, seed: int = 0
) -> HomeInProgress:
    """Doors and windows in their openings. Raises NoRoomToOpen."""
    things = Arrangement(np.concatenate([wall_boxes(plan), stair_boxes(plan), porch_rails(plan)]))
    for opening, thing in opening_things(plan, seed):
        if problem := things.obstacle(thing):
            raise NoRoomToOpen(plan, opening, problem)
        thing.name = things.name(thing.category)
        things.put(thing)
    leaves = [thing.open_boxes() for thing in things.things.values() if thing.category == "door"]
    for opening in plan.openings:
        if opening.walkable and not plan.fully_open(opening.edge):
            edge = opening.edge
            p, q = edge.point(opening.low, -WAY_DEPTH), edge.point(opening.high, WAY_DEPTH)
            things.keep_free(WAY, np.array([[[p[0], p[1], 0.02], [q[0], q[1], 2.0]]]))
    ground = Ground(plan, np.concatenate(leaves) if plan.leaves_at_walls and leaves else None)
    return HomeInProgress(plan, things, ground, rng, models=models, limit=limit, seed=seed)


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
