"""A home before its furniture: walls, doors and windows stand, the ways before the doors are kept free."""

from __future__ import annotations

import random

import numpy as np

from ..arrangement import Arrangement
from ..building import stair_boxes, wall_boxes
from ..floor_plans.openings import opening_things
from ..floor_plans.plan import Plan
from .ground import Ground
from .kit import HomeInProgress

WAY = 0.75  # m, kept free on both sides of a door


def start_home(
    plan: Plan, rng: random.Random, *, models: int = 3, limit: int | None = None, seed: int = 0
) -> HomeInProgress:
    """Doors and windows in their openings."""
    things = Arrangement(np.concatenate([wall_boxes(plan), stair_boxes(plan)]))
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
