"""Vertical columns through convex pieces: from which height to which height is there something above each cell?

The world is cut into square columns of `CELL` metres, and every convex piece is intersected with the columns' axes.
Seen along a column the scene is a list of intervals, so that surfaces, what is above them, and the free gap between
the two can be read off: all vertical rays of the paper's pose sampling at once (appendix A.2). A piece's intervals are
computed again only after it has moved.

Axes: P pieces, R rows (y) and C columns (x) of a window of cells.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Collection

import numpy as np
from jaxtyping import Bool, Float, Int

from ig2mj.geometry.poses import matrices_on_host
from ig2mj.scene.tables import PieceKind, SceneTables

CELL = 0.01
"""Metres. Side of a column; iGibson's height maps have this resolution too (sampling_utils.py)."""

_LEVEL = 1e-9
"""A plane whose normal has a smaller vertical part is upright."""


@dataclasses.dataclass(frozen=True)
class ColumnWindow:
    """A rectangle of cells: first row and column of the world's grid, and how many. Cell (0, 0) touches the origin."""

    row: int
    col: int
    rows: int
    cols: int

    @classmethod
    def around(cls, low: np.ndarray, high: np.ndarray, cell: float = CELL) -> ColumnWindow:
        """The cells that a box from `low` to `high` (x, y, ..., metres) touches."""
        first = np.floor(np.asarray(low[:2], float) / cell).astype(int)
        last = np.ceil(np.asarray(high[:2], float) / cell).astype(int)
        col, row = first.tolist()
        cols, rows = np.maximum(last - first, 1).tolist()
        return cls(row, col, rows, cols)

    def centres(self, cell: float = CELL) -> tuple[Float[np.ndarray, "C"], Float[np.ndarray, "R"]]:
        """x of the columns and y of the rows, metres."""
        return (self.col + np.arange(self.cols) + 0.5) * cell, (self.row + np.arange(self.rows) + 0.5) * cell

    def slices_in(self, outer: ColumnWindow) -> tuple[slice, slice, slice, slice] | None:
        """Where this window and another overlap: rows and columns of the outer one, then of this one; None nowhere."""
        row0, row1 = max(self.row, outer.row), min(self.row + self.rows, outer.row + outer.rows)
        col0, col1 = max(self.col, outer.col), min(self.col + self.cols, outer.col + outer.cols)
        if row0 >= row1 or col0 >= col1:
            return None
        return (
            slice(row0 - outer.row, row1 - outer.row),
            slice(col0 - outer.col, col1 - outer.col),
            slice(row0 - self.row, row1 - self.row),
            slice(col0 - self.col, col1 - self.col),
        )


@dataclasses.dataclass(frozen=True)
class ConvexPieceColumns:
    """Where a piece begins and ends in each column of its window, metres; NaN where the column misses it."""

    window: ColumnWindow
    low: Float[np.ndarray, "R C"]
    high: Float[np.ndarray, "R C"]


def piece_columns(
    tables: SceneTables, piece: int, pos: Float[np.ndarray, "3"], rotation: Float[np.ndarray, "3 3"], cell: float = CELL
) -> ConvexPieceColumns:
    """Columns of one piece.

    Args:
      tables, piece: the scene and the piece's number.
      pos, rotation: world pose of the piece's own frame.
      cell: side of a column, metres.
    """
    corners = tables.piece_vertices[piece] @ rotation.T + pos
    window = ColumnWindow.around(corners.min(0), corners.max(0), cell)
    x, y = window.centres(cell)
    x, y = x[None, :] - pos[0], y[:, None] - pos[1]
    kind, size = PieceKind(int(tables.piece_kind[piece])), tables.piece_size[piece]
    with np.errstate(invalid="ignore", divide="ignore"):
        if kind == PieceKind.POLYHEDRON:
            low, high = _polyhedron(tables.piece_planes[piece], rotation, x, y)
        elif kind == PieceKind.SPHERE:
            low, high = _sphere(np.zeros(3), size[0], x, y)
        else:
            low, high = _cylinder(rotation[:, 2], size[0], size[1], x, y)
            if kind == PieceKind.CAPSULE:
                between = low < high  # the line passes between the two ends
                low, high = np.where(between, low, np.nan), np.where(between, high, np.nan)
                for end in (-1, 1):
                    ball = _sphere(end * size[1] * rotation[:, 2], size[0], x, y)
                    low, high = np.fmin(low, ball[0]), np.fmax(high, ball[1])
        hit = low < high
    return ConvexPieceColumns(window, np.where(hit, low + pos[2], np.nan), np.where(hit, high + pos[2], np.nan))


def _polyhedron(
    planes: Float[np.ndarray, "N 4"], rotation: np.ndarray, x: np.ndarray, y: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    real = np.any(planes[:, :3] != 0, axis=1)
    normals, offsets = planes[real, :3] @ rotation.T, planes[real, 3]
    shape = np.broadcast_shapes(x.shape, y.shape)
    low, high = np.full(shape, -np.inf), np.full(shape, np.inf)
    for (nx, ny, nz), d in zip(normals, offsets, strict=True):
        rest = d - nx * x - ny * y
        if nz > _LEVEL:
            np.minimum(high, rest / nz, out=high)
        elif nz < -_LEVEL:
            np.maximum(low, rest / nz, out=low)
        else:
            high = np.where(rest >= 0, high, -np.inf)
    return low, high


def _sphere(centre: np.ndarray, radius: float, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    half = np.sqrt(radius**2 - (x - centre[0]) ** 2 - (y - centre[1]) ** 2)
    return centre[2] - half, centre[2] + half


def _cylinder(
    axis: np.ndarray, radius: float, half: float, x: np.ndarray, y: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The part of each vertical line within `radius` of the axis and between the two ends."""
    flat = x * axis[0] + y * axis[1]  # of the point at height 0, along the axis
    across = 1.0 - axis[2] ** 2
    apart = x**2 + y**2 - flat**2
    if across < _LEVEL:
        inside = apart <= radius**2
        low, high = np.where(inside, -half, np.nan), np.where(inside, half, np.nan)
        return low, high
    middle = flat * axis[2] / across
    root = np.sqrt(middle**2 - (apart - radius**2) / across)
    low, high = middle - root, middle + root
    if abs(axis[2]) > _LEVEL:
        ends = np.stack([(-half - flat) / axis[2], (half - flat) / axis[2]])
        low, high = np.maximum(low, ends.min(0)), np.minimum(high, ends.max(0))
    else:
        within = np.abs(flat) <= half
        low, high = np.where(within, low, np.nan), np.where(within, high, np.nan)
    return low, high


@dataclasses.dataclass(frozen=True)
class Level:
    """What a window of columns looks like from one height: the first surface below it, the first object above it.

    Attributes:
      surface: height of the surface, -inf where there is none. owner: object it belongs to, -1 none.
      ceiling: height of what is above, inf where there is nothing. blocked: the height is inside something.
    """

    window: ColumnWindow
    height: float
    surface: Float[np.ndarray, "R C"]
    owner: Int[np.ndarray, "R C"]
    ceiling: Float[np.ndarray, "R C"]
    blocked: Bool[np.ndarray, "R C"]


class ColumnMap:
    """The columns of a scene's pieces where they now are."""

    def __init__(self, tables: SceneTables):
        """Binds a scene; call `update` before anything else."""
        self.tables = tables
        self._pos = np.full((len(tables.piece_geom), 3), np.nan)
        self._rotation = np.zeros((len(tables.piece_geom), 3, 3))
        self._low = np.zeros((len(tables.piece_geom), 3))
        self._high = np.zeros((len(tables.piece_geom), 3))
        self._columns: dict[int, ConvexPieceColumns] = {}
        self._local = matrices_on_host(tables.piece_quat)

    def update(self, body_pos: Float[np.ndarray, "B 3"], body_rotation: Float[np.ndarray, "B 3 3"]) -> None:
        """Updates the poses of bodies, and discards the columns of pieces that moved."""
        body = self.tables.piece_body
        pos = body_pos[body] + np.einsum("kij,kj->ki", body_rotation[body], self.tables.piece_pos)
        rotation = body_rotation[body] @ self._local
        moved = np.flatnonzero((pos != self._pos).any(1) | (rotation != self._rotation).any((1, 2)))
        self._pos[moved], self._rotation[moved] = pos[moved], rotation[moved]
        corners = np.einsum("kij,kvj->kvi", rotation[moved], self.tables.piece_vertices[moved]) + pos[moved, None]
        self._low[moved], self._high[moved] = corners.min(1), corners.max(1)
        for piece in moved.tolist():
            self._columns.pop(piece, None)

    def box(self, object_index: int) -> tuple[Float[np.ndarray, "3"], Float[np.ndarray, "3"]]:
        """World box (low, high) of an object's pieces. Raises ValueError where it has none."""
        mine = self.tables.piece_object == object_index
        return self._low[mine].min(0), self._high[mine].max(0)

    def covered(self, object_index: int, window: ColumnWindow) -> Bool[np.ndarray, "R C"]:
        """Cells of a window that an object is above or below."""
        found = np.zeros((window.rows, window.cols), bool)
        for piece in np.flatnonzero(self.tables.piece_object == object_index).tolist():
            columns = self.of_piece(piece)
            overlap = columns.window.slices_in(window)
            if overlap is not None:
                rows, cols, own_rows, own_cols = overlap
                found[rows, cols] |= ~np.isnan(columns.low[own_rows, own_cols])
        return found

    def of_piece(self, piece: int) -> ConvexPieceColumns:
        """A piece's columns, computed at the first call after it moved."""
        found = self._columns.get(piece)
        if found is None:
            found = piece_columns(self.tables, piece, self._pos[piece], self._rotation[piece])
            self._columns[piece] = found
        return found

    def level(self, window: ColumnWindow, height: float, without: Collection[int] = ()) -> Level:
        """Looks up and down from a height in every column of a window.

        Args:
          window: cells. height: world z, metres. without: objects that are looked through.
        """
        shape = (window.rows, window.cols)
        surface, owner = np.full(shape, -np.inf), np.full(shape, -1)
        ceiling, blocked = np.full(shape, np.inf), np.zeros(shape, bool)
        for piece in self._near(window, without):
            columns = self.of_piece(piece)
            overlap = columns.window.slices_in(window)
            if overlap is None:
                continue
            rows, cols, own_rows, own_cols = overlap
            low, high = columns.low[own_rows, own_cols], columns.high[own_rows, own_cols]
            with np.errstate(invalid="ignore"):
                below, above = high <= height, low >= height
                blocked[rows, cols] |= (low < height) & (high > height)
                higher = below & (high > surface[rows, cols])
                surface[rows, cols] = np.where(higher, high, surface[rows, cols])
                owner[rows, cols] = np.where(higher, self.tables.piece_object[piece], owner[rows, cols])
                lower = above & (low < ceiling[rows, cols])
                ceiling[rows, cols] = np.where(lower, low, ceiling[rows, cols])
        return Level(window, height, surface, owner, ceiling, blocked)

    def _near(self, window: ColumnWindow, without: Collection[int]) -> list[int]:
        """Pieces whose boxes overlap a window."""
        low = np.array([window.col, window.row]) * CELL
        high = np.array([window.col + window.cols, window.row + window.rows]) * CELL
        near = ((self._low[:, :2] < high) & (self._high[:, :2] > low)).all(1)
        if without:
            near &= ~np.isin(self.tables.piece_object, list(without))
        return np.flatnonzero(near).tolist()
