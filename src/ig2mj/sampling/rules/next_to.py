"""NextTo(a, b): a strip around b, on whatever level surface is there. The paper does not sample this predicate.

Places are chosen by what the predicate asks of columns: how far the two are apart, and that a horizontal ray from a's
centre of mass meets b (`ig2mj.states.relations`). Heights are left to the predicate itself.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator

import numpy as np
from jaxtyping import Bool, Int

from ig2mj.sampling.columns import CELL, ColumnWindow
from ig2mj.sampling.footprint import Footprint
from ig2mj.sampling.placement import Areas, PlacementArea
from ig2mj.sampling.possible import meets
from ig2mj.sampling.query import SceneQuery
from ig2mj.states.relations.adjacency import HORIZONTAL_LINES
from ig2mj.states.relations.nearness import SHARE_OF_SIZE

STEP = 0.01
"""Metres above and below b's lowest point from which surfaces are looked for."""

Cells = Int[np.ndarray, "..."]
Allowed = Callable[[Cells, Cells], Bool[np.ndarray, "..."]]


def areas(query: SceneQuery, _: int, neighbour: int) -> Areas:
    """The rule for putting something next to `neighbour`."""
    return beside(query, neighbour, None)


def beside(query: SceneQuery, neighbour: int, limit: float | None, looks: bool = True) -> Areas:
    """Places at most `limit` metres from the neighbour; None: as near as NextTo asks.

    Args:
      looks: of NextTo, the placed object is the first argument, whose rays must meet the second; else the neighbour is.
    """
    tables = query.scene.tables
    supports = tuple(int(o) for o in np.flatnonzero(~tables.object_parked) if o != neighbour)

    def strip(shape: Footprint, rng: np.random.Generator) -> Iterator[PlacementArea]:
        cells = _Cells(query, neighbour, shape, limit)
        allowed = cells.apart() if limit is not None else cells.apart(cells.facing(looks))
        low, high, reach = cells.low[:2], cells.high[:2], cells.near + max(shape.underside.shape) * CELL
        for height in (cells.low[2] + STEP, cells.low[2] - STEP, cells.high[2] + STEP):
            yield PlacementArea(low - reach, high + reach, float(height), supports, allowed)

    return strip


def narrowed(areas: Areas, query: SceneQuery, neighbour: int, looks: bool = True) -> Areas:
    """Another rule's areas, but only where NextTo allows it; `looks`: see `beside`. It may be under the neighbour."""

    def both(shape: Footprint, rng: np.random.Generator) -> Iterator[PlacementArea]:
        cells = _Cells(query, neighbour, shape, None)
        near = cells.close(cells.facing(looks))
        for area in areas(shape, rng):

            def allowed(row: np.ndarray, col: np.ndarray, area: PlacementArea = area) -> np.ndarray:
                here = near(row, col)
                return here if area.allowed is None else here & area.allowed(row, col)

            yield dataclasses.replace(area, allowed=allowed)

    return both


class _Cells:
    """Cells of an object's origin around a neighbour.

    Attributes:
      low, high: the neighbour's box. near: metres that the two may be apart at most.
    """

    def __init__(self, query: SceneQuery, neighbour: int, shape: Footprint, limit: float | None):
        self._query, self._neighbour, self._shape = query, neighbour, shape
        self.low, self.high = query.box(neighbour)
        rows, cols = shape.underside.shape
        if limit is None:
            edges = np.mean([cols * CELL, rows * CELL, shape.high - shape.low]) + np.mean(self.high - self.low)
            limit = float(SHARE_OF_SIZE * edges)
        self.near = limit
        reach = self.near + max(rows, cols) * CELL
        self._origins = ColumnWindow.around(self.low[:2] - reach, self.high[:2] + reach)
        first = self._origins
        self._window = ColumnWindow(first.row + shape.row, first.col + shape.col, first.rows + rows, first.cols + cols)
        self._occupied = query.covered(neighbour, self._window)

    def close(self, facing: Bool[np.ndarray, "R C"] | None = None) -> Allowed:
        """Cells where the object is near enough, and, if given, `facing`."""
        import scipy.ndimage

        away = np.asarray(scipy.ndimage.distance_transform_edt(~self._occupied)) * CELL
        found = self._meets(away <= self.near + CELL / 2)
        return self._lookup(found if facing is None else found & facing)

    def apart(self, facing: Bool[np.ndarray, "R C"] | None = None) -> Allowed:
        """Likewise, and neither above nor below the neighbour."""
        free = ~self._meets(self._occupied)
        return self.close(free if facing is None else free & facing)

    def facing(self, looks: bool) -> Bool[np.ndarray, "R C"]:
        """Cells where, seen from above, a horizontal ray of the first object meets the second; see `beside`."""
        lines = np.concatenate([HORIZONTAL_LINES[:, :2], -HORIZONTAL_LINES[:, :2]])
        steps = int(np.hypot(*self._occupied.shape)) if not looks else self._steps()
        offsets = np.unique(np.rint(lines[:, None] * np.arange(steps)[:, None]).astype(int).reshape(-1, 2), axis=0)
        if not looks:
            com = np.asarray(self._query.view.object_com[0, self._neighbour, :2])
            cell = np.floor(com / CELL).astype(int)
            star = np.zeros_like(self._occupied)
            col, row = (cell + offsets - [self._window.col, self._window.row]).T
            inside = (row >= 0) & (row < self._window.rows) & (col >= 0) & (col < self._window.cols)
            star[row[inside], col[inside]] = True
            return self._meets(star)
        centre = np.rint(self._shape.centre / CELL).astype(int)
        seen = np.zeros((self._origins.rows, self._origins.cols), bool)
        reach = int(np.abs(offsets).max()) + int(np.abs(centre).max())
        first = self._origins
        wide = ColumnWindow(first.row - reach, first.col - reach, first.rows + 2 * reach, first.cols + 2 * reach)
        occupied = self._query.covered(self._neighbour, wide)
        for col, row in (offsets + centre + reach).tolist():
            seen |= occupied[row : row + first.rows, col : col + first.cols]
        return seen

    def _steps(self) -> int:
        """Cells from the object's centre to the farthest point of the strip."""
        return int(np.ceil(self.near / CELL + np.hypot(*self._shape.underside.shape)))

    def _meets(self, cells: Bool[np.ndarray, "R C"]) -> Bool[np.ndarray, "M N"]:
        return meets(cells, self._shape.covered, self._origins.rows, self._origins.cols)

    def _lookup(self, found: Bool[np.ndarray, "R C"]) -> Allowed:
        first = self._origins

        def allowed(row: np.ndarray, col: np.ndarray) -> np.ndarray:
            r, c = row - first.row, col - first.col
            known = (r >= 0) & (r < first.rows) & (c >= 0) & (c < first.cols)
            return known & found[np.where(known, r, 0), np.where(known, c, 0)]

        return allowed
