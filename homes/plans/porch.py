"""The landing outside a home's front door, so that who drives out of it neither falls nor leaves the world."""

from __future__ import annotations

import numpy as np

from .plan import Opening, Plan

DEPTH, ASIDE = 1.3, 0.3
"""m that it reaches from the wall, and beyond the door on both sides."""
THICKNESS = 0.2  # m of its slab, whose top is the floor's height
RAIL, RAIL_WIDTH = 1.0, 0.08  # m, height and thickness of the parapet on its three open sides


def front_door(plan: Plan) -> Opening | None:
    """The door that leads outside."""
    return next((o for o in plan.openings if o.kind == "door" and o.edge.outer), None)


def porch_slab(plan: Plan) -> np.ndarray:
    """[n, 2, 3] the floor before the front door, from the outer face of the wall on; n is 0 without such a door."""
    door = front_door(plan)
    return _blocks([] if door is None else [_block(door, 0.0, DEPTH, -ASIDE, ASIDE, -THICKNESS, 0.0)])


def porch_rails(plan: Plan) -> np.ndarray:
    """[n, 2, 3] the parapet around it."""
    door = front_door(plan)
    if door is None:
        return _blocks([])
    w = RAIL_WIDTH
    ends = [
        _block(door, 0.0, DEPTH - w, -ASIDE, -ASIDE + w - door.width, 0.0, RAIL),
        _block(door, 0.0, DEPTH - w, ASIDE - w + door.width, ASIDE, 0.0, RAIL),
    ]
    return _blocks([*ends, _block(door, DEPTH - w, DEPTH, -ASIDE, ASIDE, 0.0, RAIL)])


def _block(door: Opening, near: float, far: float, before: float, after: float, z0: float, z1: float) -> np.ndarray:
    """[2, 3] from `near` to `far` metres outside the wall; along it from `before` metres before the door's low end to
    `after` metres behind its high end."""
    edge = door.edge
    way = -1.0 if edge.before is None else 1.0
    face = edge.thickness / 2
    corners = [edge.point(door.low + before, way * (face + near)), edge.point(door.high + after, way * (face + far))]
    low, high = np.min(corners, axis=0), np.max(corners, axis=0)
    return np.array([[*low, z0], [*high, z1]])


def _blocks(found: list[np.ndarray]) -> np.ndarray:
    return np.array(found).reshape(-1, 2, 3)
