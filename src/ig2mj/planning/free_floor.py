"""`FreeFloor`: where a robot can stand in one world, and paths between these places.

Axes: N points of a way, h and w cells of the map along y and x.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Sequence
from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Int

from ig2mj.planning.footprint import LOWEST
from ig2mj.planning.occupancy import RESOLUTION, Occupancy
from ig2mj.tasks.navigation.floor import FloorMap

Point = Sequence[float] | np.ndarray
"""World x and y, m."""

NEAR_GOAL, NEAR_START = 0.15, 0.5
"""m from the goal within which a free cell will do, and from the robot within which the way may begin."""

POCKET, STUCK, CHEST, LOOKED_AT = 60, 1.0, 1.05, 60
"""Cells of a part of the floor in which a robot is shut in, at most; m within which it gets out of there; m, height up
to which nothing that cannot move may be in between; and cells that are looked at."""

COMFORT, CAUTION = 0.15, 3.0
"""m of spare room from which on a way is not lengthened by nearness, and by how much it is where there is none."""

LOOKAHEAD = 120
"""Cells of a way that one straight line may replace."""


@dataclasses.dataclass(frozen=True, eq=False)
class FreeFloor:
    """Where a robot can stand in one world.

    Attributes:
      free: cells. spare: m by which each is farther from obstacles than it has to be.
    """

    occupancy: Occupancy
    free: Bool[np.ndarray, "h w"]
    spare: Float[np.ndarray, "h w"]

    def nearest(self, xy: Point, within: float) -> Int[np.ndarray, "2"] | None:
        """The free cell nearest to a point, m; None: there is none within `within`."""
        reach = int(np.ceil(within / RESOLUTION))
        row, column = self.occupancy.cells(np.asarray(xy, float))
        low = np.maximum([row - reach, column - reach], 0)
        part = self.free[low[0] : max(row + reach + 1, 0), low[1] : max(column + reach + 1, 0)]
        cells = np.argwhere(part) + low
        if not len(cells):
            return None
        apart = np.linalg.norm(self.occupancy.middles(cells) - np.asarray(xy, float), axis=1)
        best = int(np.argmin(apart))
        return cells[best] if apart[best] <= within else None

    def begin(self, xy: Point, within: float) -> Int[np.ndarray, "2"] | None:
        """The free cell from which a robot at a point begins its way: the nearest one, but where that is in a pocket,
        as between the robot and what fell in front of it, the nearest outside that no wall or furniture is in front of;
        within `STUCK` where none is nearer."""
        nearest = self.nearest(xy, within)
        if nearest is not None and self._sizes[self._labels[tuple(nearest)]] >= POCKET:
            return nearest
        cells = self.within(xy, max(within, STUCK))
        cells = cells[self._sizes[self._labels[tuple(cells.T)]] >= POCKET]
        order = np.argsort(np.linalg.norm(self.occupancy.middles(cells) - np.asarray(xy, float), axis=1))
        some = order[:: max(1, len(order) // LOOKED_AT)]
        here = self.occupancy.cells(np.asarray(xy, float))
        return next((cells[k] for k in some if self._opens(here, cells[k])), nearest)

    def _opens(self, one: Int[np.ndarray, "2"], other: Int[np.ndarray, "2"]) -> bool:
        """Whether nothing that cannot move is on the line between the middles of two cells, but for what the first one
        is in: a robot that was pushed leans on it."""
        count = 2 * int(np.abs(other - one).max()) + 1
        line = np.round(one + np.linspace(0, 1, count)[:, None] * (other - one)).astype(int)
        line = np.clip(line, 0, np.array(self.free.shape) - 1)
        taken = self.occupancy.still(LOWEST, CHEST)[tuple(line.T)]
        return not taken[int(np.argmin(taken)) :].any()

    @functools.cached_property
    def _labels(self) -> Int[np.ndarray, "h w"]:
        """Number of the part of the free floor that a cell belongs to; 0: it is not free."""
        import scipy.ndimage

        return np.asarray(scipy.ndimage.label(self.free, np.ones((3, 3)))[0])  # pyright: ignore[reportIndexIssue]

    @functools.cached_property
    def _sizes(self) -> Int[np.ndarray, "n"]:
        """Cells of each part."""
        return np.bincount(self._labels.ravel())

    def within(self, xy: Point, reach: float) -> Int[np.ndarray, "n 2"]:
        """Free cells whose middles are within `reach` (m) of a point."""
        point = np.asarray(xy, float)
        low = np.clip(self.occupancy.cells(point - reach), 0, self.free.shape)
        high = np.clip(self.occupancy.cells(point + reach) + 1, 0, self.free.shape)
        cells = np.argwhere(self.free[low[0] : high[0], low[1] : high[1]]) + low
        return cells[np.linalg.norm(self.occupancy.middles(cells) - point, axis=1) < reach]

    def distances(self, xy: Point, within: float = NEAR_GOAL) -> Float[np.ndarray, "h w"]:
        """m along the floor from each cell to the free one nearest to a point, with the surcharge of narrow places;
        infinite without a way.

        Args:
          within: m from the point that the free cell is at most.
        """
        start = self.begin(xy, within)
        return np.full(self.free.shape, np.inf) if start is None else self._field(start)[0]

    def joined(self, xy: Point) -> Bool[np.ndarray, "h w"]:
        """Cells with a way to the free one nearest to a point, within `NEAR_GOAL`: that may be in a pocket, outside
        of which `distances` begins."""
        there = self.nearest(xy, NEAR_GOAL)
        return (
            np.zeros(self.free.shape, bool)
            if there is None
            else self.free & (self._labels == self._labels[tuple(there)])
        )

    def way(self, start: Point, goal: Point) -> Float[np.ndarray, "N 2"] | None:
        """Points of a way between two positions, straightened; None where there is none."""
        begin, end = self.begin(start, NEAR_START), self.nearest(goal, NEAR_GOAL)
        if begin is None or end is None:
            return None
        distance, before = self._field(begin)
        if not np.isfinite(distance[tuple(end)]):
            return None
        width, cells = self.free.shape[1], [end]
        while (cell := before[tuple(cells[-1])]) >= 0:
            cells.append(np.array(divmod(int(cell), width)))
        return np.concatenate(
            [np.asarray(start, float)[None], self.occupancy.middles(self._straightened(np.array(cells[::-1])))]
        )

    def _field(self, start: Int[np.ndarray, "2"]) -> tuple[Float[np.ndarray, "h w"], Int[np.ndarray, "h w"]]:
        """Distance of every cell from a free one, and the cell before it on the way (row times width and column; -1:
        none). The last one is kept: a robot asks for many ways from where it is."""
        from scipy.sparse import csgraph

        key = (int(start[0]), int(start[1]))
        if key not in self._fields:
            places = np.flatnonzero(self.free.ravel())
            distance, before = np.full(self.free.shape, np.inf), np.full(self.free.shape, -1)
            away, came = csgraph.dijkstra(
                self._graph,
                directed=False,
                indices=int(np.searchsorted(places, key[0] * self.free.shape[1] + key[1])),
                return_predecessors=True,
            )
            distance.ravel()[places] = away
            before.ravel()[places] = np.where(came >= 0, places[np.maximum(came, 0)], -1)
            self._fields.clear()
            self._fields[key] = distance, before
        return self._fields[key]

    @functools.cached_property
    def _fields(self) -> dict[tuple[int, int], tuple[np.ndarray, np.ndarray]]:
        return {}

    @functools.cached_property
    def _graph(self) -> Any:
        """Steps between free cells; rows are free cells in order."""
        places = np.flatnonzero(self.free.ravel())
        number = np.full(self.free.shape, -1)
        number.ravel()[places] = np.arange(len(places))
        graph = FloorMap(self.free, self.occupancy.origin, RESOLUTION).graph(number).tocoo()
        slow = 1 + CAUTION * np.clip(1 - self.spare.ravel()[places] / COMFORT, 0.0, 1.0)
        graph.data = graph.data * (slow[graph.row] + slow[graph.col]) / 2
        return graph.tocsr()

    def _straightened(self, cells: Int[np.ndarray, "n 2"]) -> Int[np.ndarray, "N 2"]:
        """The way without points that a straight line over cells as free as those of the way can do without."""
        kept = [cells[0]]
        k = 0
        while k < len(cells) - 1:
            ahead = min(k + LOOKAHEAD, len(cells) - 1)
            while ahead > k + 1 and not self._sees(cells[k], cells[ahead], cells[k : ahead + 1]):
                ahead -= max(1, (ahead - k) // 8)
            k = ahead
            kept.append(cells[k])
        return np.array(kept)

    def _sees(self, one: np.ndarray, other: np.ndarray, between: np.ndarray) -> bool:
        count = 2 * int(np.abs(other - one).max()) + 1
        line = np.round(one + np.linspace(0, 1, count)[:, None] * (other - one)).astype(int)
        rows, columns = line.T
        if not self.free[rows, columns].all():
            return False
        own = min(COMFORT, float(self.spare[tuple(between.T)].min()))
        return bool(self.spare[rows, columns].min() >= own - 1e-9)
