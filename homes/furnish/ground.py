"""Can a robot still get everywhere? A coarse map of the floor that furniture is only put on where the answer is yes."""

from __future__ import annotations

import numpy as np

from ..plans.building import stair_boxes
from ..plans.layout_maps import HIGH, LOW, reachable_and_cut_off
from ..plans.plan import Plan, Rect
from .arrangement import FLAT
from .placed import Placed

CELL = 0.05  # m
RADIUS = 0.34
"""m: the robot's 0.3 m and what a 5 cm map may be wrong by."""
LEAST_SHARE = 0.12
"""Of a room's floor that the robot's middle must be able to stand on, or LEAST_AREA (m2) in a tiny room."""
LEAST_AREA = 0.04
LARGEST_POCKET = 0.25
"""m2 on which the robot's middle could stand but cannot get to, at most, where open doors count."""


class Ground:
    """Free floor of a plan at `CELL`; row is y, column is x, the world's origin in the middle."""

    def __init__(self, plan: Plan, leaves: np.ndarray | None = None):
        """`leaves`: [n, 2, 3] boxes of doors that stand open, m; then the front door must be reached, too, and no large
        part of a room may be cut off. None: open doors do not count."""
        x0, y0, x1, y1 = plan.extent()
        self._half = int(np.ceil((max(-x0, -y0, x1, y1) + 0.5) / CELL))
        self.free = np.zeros((2 * self._half, 2 * self._half), bool)
        self._rooms: dict[str, tuple[slice, slice]] = {}
        self._gates: dict[tuple[int, int], str] = {}
        self._area: dict[str, float] = {}
        for room in plan.rooms:
            cells = self._inner_cells(plan.inside(room))
            self.free[cells] = True
            self._rooms[room.name] = cells
            self._area[room.name] = self.free[cells].size * CELL**2
        for low, high in stair_boxes(plan):
            self.free[self._outer_cells((low[0], low[1], high[0], high[1]))] = False
        self._pockets = np.inf if leaves is None else LARGEST_POCKET
        for opening in plan.openings:
            if opening.walkable and opening.edge.outer and leaves is not None:
                inwards = (1.0 if opening.edge.before is None else -1.0) * (opening.edge.thickness / 2 + RADIUS + CELL)
                x, y = opening.edge.point(opening.centre, inwards)
                self._gates[self._cell(y), self._cell(x)] = "the front door"
            if not opening.walkable or opening.edge.outer:
                continue
            post = 0.04 if opening.kind == "door" else 0.0
            half = opening.edge.thickness / 2 + CELL
            p = opening.edge.point(opening.low + post, -half)
            q = opening.edge.point(opening.high - post, half)
            self.free[self._inner_cells((p[0], p[1], q[0], q[1]))] = True
            x, y = opening.edge.point(opening.centre)
            self._gates[self._cell(y), self._cell(x)] = f"the way between {' and '.join(opening.edge.rooms)}"
        if leaves is not None:
            self.free = self._less(leaves)

    def allows(self, thing: Placed) -> bool:
        """Whether every room and doorway can still be reached with this object in its place."""
        return not self.cut_off(thing)

    def cut_off(self, thing: Placed) -> str:
        """The first room or doorway that cannot be reached with this object in its place, or ''."""
        after = self._without(thing)
        return "" if after is None else self._unreachable(after)

    def cut_off_by(self, boxes: np.ndarray) -> str:
        """The same with boxes [n, 2, 3] in the way."""
        return self._unreachable(self._less(boxes))

    def occupy(self, thing: Placed) -> None:
        """Takes an object's floor away."""
        after = self._without(thing)
        if after is not None:
            self.free = after

    def _without(self, thing: Placed) -> np.ndarray | None:
        if thing.category in (*FLAT, "door", "window"):
            return None
        after = self._less(thing.boxes())
        return None if np.array_equal(after, self.free) else after

    def _less(self, boxes: np.ndarray) -> np.ndarray:
        after = self.free.copy()
        for low, high in boxes:
            if low[2] < HIGH and high[2] > LOW:
                after[self._outer_cells((low[0], low[1], high[0], high[1]))] = False
        return after

    def _unreachable(self, free: np.ndarray) -> str:
        reach, pocket = reachable_and_cut_off(free, RADIUS, CELL)
        for gate, name in self._gates.items():
            if not reach[gate]:
                return name
        for name, cells in self._rooms.items():
            need = max(LEAST_AREA, min(LEAST_SHARE * self._area[name], 1.2))
            if reach[cells].sum() * CELL**2 < need:
                return name
            if pocket[cells].sum() * CELL**2 > self._pockets:
                return f"a part of {name}"
        return ""

    def _cell(self, v: float) -> int:
        return int(np.floor(v / CELL)) + self._half

    def _inner_cells(self, rect: Rect) -> tuple[slice, slice]:
        x0, y0, x1, y1 = rect
        low, high = (lambda v: int(np.ceil(v / CELL - 1e-6)) + self._half), (lambda v: int(np.floor(v / CELL + 1e-6)))
        return slice(low(y0), high(y1) + self._half), slice(low(x0), high(x1) + self._half)

    def _outer_cells(self, rect: Rect) -> tuple[slice, slice]:
        x0, y0, x1, y1 = rect
        low, high = (lambda v: max(0, self._cell(v + 1e-6))), (lambda v: max(0, self._cell(v - 1e-6) + 1))
        return slice(low(y0), high(y1)), slice(low(x0), high(x1))
