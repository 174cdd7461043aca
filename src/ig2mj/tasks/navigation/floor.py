"""`FloorMap`: where a robot can stand, and how far it is from there to a goal along the floor.

Maps are made on the host once for each robot and household: a cell of the home's map is free where the robot, put
there, touches nothing but the ground. Distance fields come from SciPy's Dijkstra over a graph of 16 neighbours, whose
ways are at most 2.7 % longer than the shortest; batches of worlds look them up.

Axes: W worlds, N cells, G goals, P rows of a pool, h and w cells of the map along y and x.
"""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float, Int

from ig2mj.engine.view import Array

if TYPE_CHECKING:
    import scipy.sparse

AHEAD = 5
"""Cells around the robot in which the next point of the way is looked for."""

STRAIGHT = 0.9
"""Weight of the straight part of a way: with 1 all points of a straight way would be equally good, so it is less."""

SHORTCUT = 0.1
"""m by which the straight line to a cell may be shorter than the way on the map: rounding to cells."""

CLEAR_AT = (0.35, 0.55, 0.75)
"""Shares of the straight line to the next point of the way at which the floor must be free: at a corner the nearest
point in sight would lead into it."""

REACH = 1.0
"""m from free floor within which an object is in reach of a robot that stands there."""

_STEPS = np.array([(0, 1), (1, 0), (1, 1), (1, -1), (1, 2), (2, 1), (1, -2), (2, -1)])
"""Rows and columns; the opposite ones are the same edges."""


@dataclasses.dataclass(frozen=True, eq=False)
class FloorMap:
    """See the module's text.

    Attributes:
      free: [h, w] cells where the robot can stand, all connected with each other; row is y, column is x.
      origin: [2] m, world x and y of the corner of cell (0, 0). resolution: m of a cell.
    """

    free: Bool[np.ndarray, "h w"]
    origin: Float[np.ndarray, "2"]
    resolution: float

    @classmethod
    def of_cells(
        cls, free: Bool[np.ndarray, "n n"], resolution: float, near: Float[np.ndarray, "k 2"] | None = None
    ) -> FloorMap:
        """The largest connected part of a map whose centre is the world's origin, without the empty margin.

        Args:
          near: points, m; the part from which most of them are in reach, the largest of several such.

        Raises:
          ValueError: nothing is free.
        """
        import scipy.ndimage

        labels = np.asarray(scipy.ndimage.label(free, np.ones((3, 3)))[0])  # pyright: ignore[reportIndexIssue]
        if not labels.any():
            raise ValueError("no cell is free")
        size = np.bincount(labels.ravel()).astype(float)
        score = size / size.sum()
        if near is not None:
            spots = (np.argwhere(free)[:, ::-1] + 0.5 - len(free) / 2) * resolution
            for point in near:
                score[np.unique(labels[free][np.linalg.norm(spots - point, axis=1) < REACH])] += 1
        score[0] = -1.0
        part = labels == np.argmax(score)
        rows, columns = np.flatnonzero(part.any(1)), np.flatnonzero(part.any(0))
        first = np.array([columns[0], rows[0]])
        part = part[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
        return cls(part, (first - len(free) / 2) * resolution, resolution)

    @property
    def cells(self) -> Int[np.ndarray, "N 2"]:
        """Row and column of each free cell."""
        return np.argwhere(self.free)

    def centres(self, cells: Int[np.ndarray, "N 2"]) -> Float[np.ndarray, "N 2"]:
        """World x and y, m, of the middles of cells."""
        return self.origin + (cells[:, ::-1] + 0.5) * self.resolution

    def distances(self, goals: Int[np.ndarray, "G 2"]) -> Float[np.ndarray, "G h w"]:
        """Metres from every cell to the goals' cells along free ones; infinite where there is no way."""
        from scipy.sparse import csgraph

        number = np.full(self.free.shape, -1)
        number[self.free] = np.arange(int(self.free.sum()))
        graph = self.graph(number)
        found = csgraph.dijkstra(graph, directed=False, indices=number[tuple(goals.T)])
        fields = np.full((len(goals), *self.free.shape), np.inf, np.float32)
        fields[:, self.free] = found
        return fields

    def graph(self, number: Int[np.ndarray, "h w"]) -> scipy.sparse.csr_matrix:
        """Steps between free cells with their lengths, m, each once; `number` is a cell's row of the matrix."""
        import scipy.sparse

        starts, ends, lengths = [], [], []
        padded = np.pad(self.free, 2)
        cells = self.cells + 2
        for step in _STEPS:
            # a long step passes between two cells, a diagonal one by two: both must be free
            between = {tuple(np.floor(step / 2).astype(int)), tuple(np.ceil(step / 2).astype(int))}
            if abs(step).max() == 1:
                between = {(int(step[0]), 0), (0, int(step[1]))}
            there = padded[tuple((cells + step).T)]
            for by in between:
                there = there & padded[tuple((cells + np.array(by)).T)]
            start = cells[there] - 2
            starts.append(number[tuple(start.T)])
            ends.append(number[tuple((start + step).T)])
            lengths.append(np.full(len(start), np.hypot(*step) * self.resolution))
        count = int(self.free.sum())
        entries = np.concatenate(lengths), (np.concatenate(starts), np.concatenate(ends))
        return scipy.sparse.csr_matrix(entries, shape=(count, count))


def look_up(
    fields: Float[Array, "P h w"],
    row: Int[Array, "W"],
    pos: Float[Array, "W 2"],
    origin: Float[np.ndarray, "2"],
    resolution: float,
) -> tuple[Float[Array, "W"], Float[Array, "W 2"]]:
    """How far each world's robot is from its goal along the floor, and the next point of the way. Pure.

    Args:
      fields: `FloorMap.distances` of each row of the pool. row: of each world. pos: of the robot, world x and y, m.

    Returns:
      Metres: to the middle of the best cell next to the robot, and on from there; infinite where all nine cells are
      taken. A point at most `AHEAD` cells away, world frame; the robot's own place where there is no way.
    """
    height, width = fields.shape[1:]
    reach = np.arange(-AHEAD, AHEAD + 1)
    rows, columns = np.meshgrid(reach, reach, indexing="ij")
    offsets = np.stack([rows.ravel(), columns.ravel()], axis=1)
    at = (jnp.asarray(pos) - origin) / resolution
    cell = jnp.floor(at[:, ::-1]).astype(jnp.int32)[:, None] + offsets  # [W, N, 2]
    inside = ((cell >= 0) & (cell < np.array([height, width]))).all(-1)
    middle = origin + (cell[..., ::-1] + 0.5) * resolution
    apart = jnp.linalg.norm(middle - pos[:, None], axis=-1)
    held = jnp.clip(cell, 0, np.array([height - 1, width - 1]))
    ahead = jnp.where(inside, jnp.asarray(fields)[row[:, None], held[..., 0], held[..., 1]], jnp.inf)
    near = np.flatnonzero(np.abs(offsets).max(1) <= 1)
    distance = (ahead + apart)[:, near].min(1)
    in_sight = ahead + apart >= distance[:, None] - SHORTCUT  # what is nearer to the goal than that is behind a wall
    in_sight &= jnp.isfinite(ahead)
    clear = in_sight
    for share in CLEAR_AT:
        between = jnp.floor((pos[:, None] + share * (middle - pos[:, None]) - origin) / resolution)
        on = jnp.clip(between[..., ::-1].astype(jnp.int32), 0, np.array([height - 1, width - 1]))
        clear &= jnp.isfinite(jnp.asarray(fields)[row[:, None], on[..., 0], on[..., 1]])
    in_sight = jnp.where(clear.any(1, keepdims=True), clear, in_sight)  # a robot that touches something may see none
    best = jnp.argmin(jnp.where(in_sight, ahead + STRAIGHT * apart, jnp.inf), axis=1)
    point = jnp.take_along_axis(middle, best[:, None, None], axis=1)[:, 0]
    return distance, jnp.where(jnp.isfinite(ahead.min(1))[:, None], point, pos)
