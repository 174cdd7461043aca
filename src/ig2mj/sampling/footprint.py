"""Height profiles of an object from below and from above in a given orientation, on the grid of `columns`.

The underside determines the height at which a lowered object rests on a surface, the top side whether it fits below
obstacles.

Axes: M rows and N columns of the object's own window.
"""

from __future__ import annotations

import dataclasses

import numpy as np
from jaxtyping import Bool, Float

from ig2mj.sampling.columns import CELL, piece_columns
from ig2mj.scene.tables import SceneTables

FINE = 4
"""Each cell is looked at in this many steps per side, so that a fork or a pencil is not missed."""

BASE = 0.004
"""Metres. What is no higher than this above an object's lowest point belongs to its base."""


@dataclasses.dataclass(frozen=True)
class Footprint:
    """An object in one orientation; heights relative to the main body's origin.

    Attributes:
      rotation: of the main body, world frame. shift: the origin's place (x, y) relative to the middle of the cell that
        it is said to be in. row, col: first cell of the window relative to the origin's cell.
      underside, topside: lowest and highest point of each cell; NaN where the object is not above the cell.
      base: cells of the base. centre: x and y of the centre of mass relative to the middle of the origin's cell.
      low, high: lowest and highest point of all.
    """

    rotation: Float[np.ndarray, "3 3"]
    shift: Float[np.ndarray, "2"]
    row: int
    col: int
    underside: Float[np.ndarray, "M N"]
    topside: Float[np.ndarray, "M N"]
    base: Bool[np.ndarray, "M N"]
    centre: Float[np.ndarray, "2"]
    low: float
    high: float

    @property
    def covered(self) -> Bool[np.ndarray, "M N"]:
        """Cells that the object is above."""
        return ~np.isnan(self.underside)


def footprint(
    tables: SceneTables,
    object_index: int,
    piece_pos: Float[np.ndarray, "K 3"],
    piece_rotation: Float[np.ndarray, "K 3 3"],
    centre_of_mass: Float[np.ndarray, "3"],
    rotation: Float[np.ndarray, "3 3"],
    shift: Float[np.ndarray, "2"],
) -> Footprint:
    """An object's footprint.

    Args:
      piece_pos, piece_rotation: poses of the object's pieces in its main body's frame, in the order of the tables.
      centre_of_mass: of the whole object, in the main body's frame, metres.
      rotation: of the main body. shift: see `Footprint`, metres.

    Raises:
      ValueError: the object has no collision pieces.
    """
    pieces = np.flatnonzero(tables.piece_object == object_index)
    if not len(pieces):
        raise ValueError(f"'{tables.object_names[object_index]}' has no collision geometry")
    fine = CELL / FINE
    offset = np.array([shift[0] + CELL / 2, shift[1] + CELL / 2, 0.0])
    found = [
        piece_columns(tables, int(p), rotation @ pos + offset, rotation @ turn, fine)
        for p, pos, turn in zip(pieces, piece_pos, piece_rotation, strict=True)
    ]
    first_row = min(c.window.row for c in found) // FINE
    first_col = min(c.window.col for c in found) // FINE
    rows = -(-max(c.window.row + c.window.rows for c in found) // FINE) - first_row
    cols = -(-max(c.window.col + c.window.cols for c in found) // FINE) - first_col
    under = np.full((rows * FINE, cols * FINE), np.inf)
    top = np.full((rows * FINE, cols * FINE), -np.inf)
    for c in found:
        r, k = c.window.row - first_row * FINE, c.window.col - first_col * FINE
        here = (slice(r, r + c.window.rows), slice(k, k + c.window.cols))
        under[here] = np.fmin(under[here], c.low)
        top[here] = np.fmax(top[here], c.high)
    underside = under.reshape(rows, FINE, cols, FINE).min((1, 3))
    topside = top.reshape(rows, FINE, cols, FINE).max((1, 3))
    covered = np.isfinite(underside)
    low = float(underside[covered].min())
    return Footprint(
        rotation=rotation,
        shift=np.asarray(shift, float),
        row=first_row,
        col=first_col,
        underside=np.where(covered, underside, np.nan),
        topside=np.where(covered, topside, np.nan),
        base=covered & (underside <= low + BASE),
        centre=np.asarray(shift, float) + (rotation @ centre_of_mass)[:2],
        low=low,
        high=float(topside[covered].max()),
    )
