"""Whether all that opens in a furnished home has room to: found while building, before anything is converted."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from ..plans.building import stair_boxes, wall_boxes
from ..plans.plan import Plan
from ..shapes.sweeps import Hull, face_normals, overlap
from .placed import Placed, boxes_of

TOLERANCE = 2e-5  # m: the rounding of normals


def blocked(plan: Plan, things: Iterable[Placed]) -> list[tuple[str, str]]:
    """(object, what is in the way) for everything whose moving parts meet a wall, stairs, or another fixed object."""
    things = list(things)
    still = [(thing.name, thing.parts()) for thing in things if thing.fixed]
    still.append(("walls", [_block(box) for box in (*wall_boxes(plan), *stair_boxes(plan))]))
    boxes = [boxes_of(parts) for _, parts in still]
    found = []
    for thing in things:
        ways = thing.swept()
        for (name, parts), around in zip(still, boxes, strict=True):
            if name != thing.name and any(_meets(way, parts, around) for way in ways):
                found.append((thing.name, name))
    return found


def _meets(way: Hull, parts: list[Hull], boxes: np.ndarray) -> bool:
    low, high = way[0].min(0), way[0].max(0)
    near = np.flatnonzero(np.all((boxes[:, 0] < high) & (boxes[:, 1] > low), axis=1))
    return any(overlap(way, parts[k]) > TOLERANCE for k in near)


def _block(box: np.ndarray) -> Hull:
    picks = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)])
    points = np.where(picks == 1, box[1], box[0])
    return points, face_normals(points)
