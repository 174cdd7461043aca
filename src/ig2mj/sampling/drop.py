"""Where an object comes to rest when it is lowered vertically onto the surfaces of a level, and whether it stays there.

An object that goes down vertically stops where the gap between its underside and the surfaces first closes. That gives
the height for any shape of object and of surface, from a book on a table to an apple in a bowl. Then:

- *clear*: nothing hangs into it, and it hangs over nothing that is already there;
- *supported fully*: all of its base is on surfaces of the allowed objects (the paper's guarantee, table A.5);
- *balanced*: its centre of mass is above the polygon of the cells in which it touches, which is all that a bowl or a
  stool smaller than the object can offer.

Axes: N candidate places, M rows and K columns of the object's window.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Collection

import numpy as np
from jaxtyping import Bool, Float, Int

from ig2mj.sampling.columns import CELL, Level
from ig2mj.sampling.footprint import Footprint

TOUCH = 0.004
"""Metres. A gap that is no wider counts as contact: the cells round heights off."""

LEVEL_BASE = 0.006
"""Metres. All of a fully supported base is this close to a surface."""

HEADROOM = 0.004
"""Metres between an object and what is above it."""

MARGIN = 0.35
"""Radians. Contact cells, seen from the centre of mass, leave no angle wider than pi minus this."""

CHUNK = 300_000
"""Cells looked at together: they fit a processor's cache."""

SPARSE = 0.1
"""Share of cells that touch up to which they are sorted one by one."""

SOME_CELLS = 64
"""Cells, by angle, that are asked first where many touch."""

FIRST_CELLS = 48
"""Cells of the object, spread over it, that are looked at first."""


@dataclasses.dataclass(frozen=True)
class Rest:
    """Candidates of one level, one entry per place.

    Attributes:
      row, col: the origin's cell, of the world's grid. height: of the origin, metres, where it is clear.
      clear, full, balanced: see the module's text; `full` and `balanced` are false where it is not clear, and where the
        support is not an allowed object.
    """

    row: Int[np.ndarray, "N"]
    col: Int[np.ndarray, "N"]
    height: Float[np.ndarray, "N"]
    clear: Bool[np.ndarray, "N"]
    full: Bool[np.ndarray, "N"]
    balanced: Bool[np.ndarray, "N"]


def rest_at(
    level: Level,
    shape: Footprint,
    row: Int[np.ndarray, "N"],
    col: Int[np.ndarray, "N"],
    supports: Collection[int],
    support: str = "balanced",
) -> Rest:
    """Lets an object down with its origin in given cells; its window must lie within the level's.

    Args:
      level: surfaces and ceilings. shape: the object. row, col: of the world's grid. supports: objects that may bear
        it.
      support: what is asked for: "full", "balanced" or "loose" (clear is enough). Of candidates that are not clear, and
        of what was not asked for, nothing more is computed: `full` and `balanced` are False there.
    """
    window = level.window
    top = row + shape.row - window.row
    left = col + shape.col - window.col
    assert len(row) == 0 or (min(top.min(), left.min()) >= 0), "the level's window is too small"
    cells_r, cells_c = np.nonzero(shape.covered)
    under, over = shape.underside[cells_r, cells_c], shape.topside[cells_r, cells_c]
    base = shape.base[cells_r, cells_c]
    place = np.stack([cells_c + shape.col, cells_r + shape.row], 1) * CELL - shape.centre  # seen from the centre
    offset, start = cells_r * window.cols + cells_c, top * window.cols + left
    surface, ceiling, blocked = level.surface.ravel(), level.ceiling.ravel(), level.blocked.ravel()
    allowed = np.isin(level.owner, list(supports)).ravel()
    height = np.zeros(len(row))
    clear, full, balanced = (np.zeros(len(row), bool) for _ in range(3))

    def fits(places: Int[np.ndarray, "N"], cells: slice | Int[np.ndarray, "P"]) -> tuple[np.ndarray, np.ndarray]:
        """Height of the origin, and whether all is free, by some of the object's cells alone."""
        at = start[places, None] + offset[cells]
        found = (surface[at] - under[cells]).max(1)
        free = (found[:, None] + over[cells] + HEADROOM <= ceiling[at]).all(1)
        return found, free & ~blocked[at].any(1)

    balance = Balance(place)
    left_over = np.arange(len(row))
    if len(under) > 2 * FIRST_CELLS:  # a few cells rule out most places
        some = np.linspace(0, len(under) - 1, FIRST_CELLS).astype(int)
        left_over = np.concatenate([p[fits(p, some)[1]] for p in _chunks(left_over, FIRST_CELLS)])
    for places in _chunks(left_over, len(under)):
        height[places], free = fits(places, slice(None))
        places = places[free & np.isfinite(height[places])]
        clear[places] = True
        if support == "loose":
            continue
        at = start[places, None] + offset
        gap = height[places, None] + under - surface[at]
        contact, bears = gap <= TOUCH, allowed[at]
        sound = np.where(contact, bears, True).all(1)
        level_base = np.all(bears[:, base] & (gap[:, base] <= LEVEL_BASE), axis=1)
        if support == "full":
            sound &= level_base
        stays = balance(contact[sound])
        balanced[places[sound]] = stays
        full[places[sound]] = stays & level_base[sound]
    return Rest(row, col, height, clear, full, balanced)


def _chunks(places: Int[np.ndarray, "N"], cells: int) -> list[Int[np.ndarray, "M"]]:
    step = max(1, CHUNK // cells)
    return [places[k : k + step] for k in range(0, max(len(places), 1), step)]


class Balance:
    """Whether an object's centre of mass is above the polygon of the cells in which it touches.

    It is where no angle without contact, seen from the centre, is too wide. Angles are those of the cells' corners.
    """

    def __init__(self, place: Float[np.ndarray, "P 2"]):
        """`place`: of the cells' middles, in metres, seen from the centre of mass."""
        corners = np.array([[-1, -1], [-1, 1], [1, -1], [1, 1]]) * CELL / 2
        seen = (place[:, None] + corners).reshape(-1, 2)
        angle = np.arctan2(seen[:, 1], seen[:, 0])
        self._cell_corners = np.argsort(angle)
        """Corners by angle: 4 times the number of the cell, and which corner."""
        self._angle = angle[self._cell_corners]
        self._rank = np.empty(len(angle), int)
        self._rank[self._cell_corners] = np.arange(len(angle))
        self._some = self._cell_corners[:: max(1, len(angle) // SOME_CELLS)] // 4
        self._of_some = Balance(place[self._some]) if len(place) > 4 * SOME_CELLS else None

    def __call__(self, contact: Bool[np.ndarray, "N P"]) -> Bool[np.ndarray, "N"]:
        """For each row of cells that touch."""
        dense = bool(np.count_nonzero(contact) > SPARSE * contact.size)
        if dense and self._of_some is not None:  # what a few cells hold, more of them do
            found = self._of_some(contact[:, self._some])
            found[~found] = self._by_angles(contact[~found], dense)
            return found
        return self._by_angles(contact, dense)

    def _by_angles(self, contact: Bool[np.ndarray, "N P"], dense: bool) -> Bool[np.ndarray, "N"]:
        if dense or not contact.size:
            row, index = np.nonzero(contact[:, self._cell_corners // 4])
        else:
            row, cell = np.nonzero(contact)
            count = len(self._angle)
            key = np.sort((row[:, None] * count + self._rank.reshape(-1, 4)[cell]).ravel())
            row, index = np.divmod(key, count)
        found = np.zeros(len(contact), bool)
        if not len(row):
            return found
        angle = self._angle[index]
        begins = np.flatnonzero(np.diff(row, prepend=-1))
        ends = np.append(begins[1:], len(row)) - 1
        gap = np.diff(angle, prepend=angle[0])
        gap[begins] = angle[begins] + 2 * np.pi - angle[ends]
        found[row[begins]] = np.maximum.reduceat(gap, begins) <= np.pi - MARGIN
        return found


def origin(shape: Footprint, row: int, col: int, height: float) -> Float[np.ndarray, "3"]:
    """World position of the object's main body for a candidate."""
    return np.array([(col + 0.5) * CELL + shape.shift[0], (row + 0.5) * CELL + shape.shift[1], height])
