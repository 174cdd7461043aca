"""The maps of a scene folder (iGibson's dataset format): rooms, and where a robot can drive. 1 pixel is 0.01 m.

All maps are square with the world's origin in their middle; row is y, column is x, not flipped.
"""

from __future__ import annotations

import math
import pathlib

import numpy as np
from PIL import Image
from scipy import ndimage

from ..dataset.root import ROOM_TYPES
from ..furnish.arrangement import FLAT, Arrangement
from .building import stair_boxes
from .plan import Plan, Rect

PIXEL = 0.01
BORDER = 0.5  # m, around the house
LOW, HIGH = 0.05, 1.5  # m: what reaches into this range of heights is in a robot's way


class Maps:
    """uint8 images of one home.

    Attributes:
      side: pixels. insseg: room number + 1; semseg: line of room_categories.txt + 1; trav_no_obj, trav: 255 is free.
    """

    def __init__(self, plan: Plan, home: Arrangement):
        x0, y0, x1, y1 = plan.extent()
        half = max(-x0, -y0, x1, y1) + BORDER
        self.side = 2 * math.ceil(half * 10) * 10  # whole decimetres on both sides of the origin
        shape = (self.side, self.side)
        self.insseg, self.semseg, floor = (np.zeros(shape, np.uint8) for _ in range(3))
        for number, room in enumerate(plan.rooms):
            cells = self._cells(plan.inside(room))
            self.insseg[cells] = number + 1
            self.semseg[cells] = ROOM_TYPES.index(room.kind) + 1
            floor[cells] = 255
        for opening in plan.openings:
            if opening.walkable and not opening.edge.outer:
                self._doorway(opening, floor)
        for low, high in stair_boxes(plan):
            floor[self._cells((low[0], low[1], high[0], high[1]))] = 0
        self.trav_no_obj = floor
        self.trav = floor.copy()
        for thing in home.things.values():
            if thing.category in ("door", "window", *FLAT):
                continue
            for low, high in thing.boxes():
                if low[2] < HIGH and high[2] > LOW:
                    self.trav[self._cells((low[0], low[1], high[0], high[1]))] = 0

    def _doorway(self, opening, floor: np.ndarray) -> None:
        """The floor under an opening is driven over, and belongs to no room."""
        edge = opening.edge
        post = 0.04 if opening.kind == "door" else 0.0
        half = edge.thickness / 2
        p, q = edge.point(opening.low + post, -half), edge.point(opening.high - post, half)
        floor[self._cells((p[0], p[1], q[0], q[1]))] = 255

    def _cells(self, rect: Rect) -> tuple[slice, slice]:
        x0, y0, x1, y1 = (round(v / PIXEL) + self.side // 2 for v in rect)
        return slice(max(y0, 0), max(y1, 0)), slice(max(x0, 0), max(x1, 0))

    def write(self, scene: pathlib.Path) -> None:
        """Writes `layout/floor_*_0.png`."""
        folder = scene / "layout"
        folder.mkdir(parents=True, exist_ok=True)
        images = {"insseg": self.insseg, "semseg": self.semseg, "trav": self.trav, "trav_no_obj": self.trav_no_obj}
        for name, pixels in images.items():
            Image.fromarray(pixels).save(folder / f"floor_{name}_0.png", optimize=True)
        Image.fromarray(self.trav).save(folder / "floor_0.png", optimize=True)
        Image.fromarray(self.trav_no_obj).save(folder / "floor_no_obj_0.png", optimize=True)
        Image.fromarray(np.where(self.insseg > 0, 1, 0).astype(np.uint8)).save(folder / "floor_lighttype_0.png")


def reachable(free: np.ndarray, radius: float, resolution: float) -> np.ndarray:
    """Where the middle of a disc can stand and drive: the largest connected part of the map eroded by its radius.

    Args:
      free: [n, n] bool. radius: m. resolution: m per cell.
    """
    return reachable_and_cut_off(free, radius, resolution)[0]


def reachable_and_cut_off(free: np.ndarray, radius: float, resolution: float) -> tuple[np.ndarray, np.ndarray]:
    """As `reachable`; and where the disc's middle can stand, but not get to."""
    distance = np.asarray(ndimage.distance_transform_edt(np.pad(free, 1)))[1:-1, 1:-1]
    stands = distance * resolution >= radius
    labels, count = ndimage.label(stands)  # pyright: ignore[reportGeneralTypeIssues]
    if count == 0:
        return stands, stands
    reach = labels == 1 + int(np.argmax(np.bincount(labels.ravel())[1:]))
    return reach, stands & ~reach
