"""Exact boxes of a solid whose faces are all square to three axes: walls with doors, shelves, cabinets, frames.

The coordinates of the vertices cut space into cells; a cell is filled or empty as its middle is; filled cells are
joined to boxes, greedily. Much faster than a general convex decomposition, and without its error.
"""

from __future__ import annotations

import itertools

import numpy as np

from .convex import Hull, hull_of
from .mesh_parts import winding

SQUARE_SHARE = 0.97
"""This much of the area must be square to the axes."""
SQUARE_COSINE = 0.9998
"""|cos| from which on a face counts as square (about 1 degree)."""
SNAP = 5e-3
"""Coordinates nearer than this, metres, are one (or 0.5 % of the extent along the axis, whichever is less)."""
MOST_CELLS = 100_000
MOST_BOXES = 200
VOLUME = 0.03
"""The boxes must enclose the solid's volume within this, relative."""


def boxes_of(vertices: np.ndarray, faces: np.ndarray, volume: float) -> list[Hull] | None:
    """The boxes, along the mesh's axes, or None if the solid is not made of boxes.

    Args:
      vertices, faces: a closed mesh, wound outward. volume: m3 that it encloses.
    """
    triangles = vertices[faces]
    across = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    area = np.linalg.norm(across, axis=1)
    square = np.abs(across).max(axis=1) >= SQUARE_COSINE * np.maximum(area, 1e-300)
    if float(area[square].sum()) < SQUARE_SHARE * float(area.sum()):
        return None
    lines = [_coordinates(vertices[:, k]) for k in range(3)]
    shape = tuple(len(line) - 1 for line in lines)
    if min(shape) < 1 or np.prod(shape) > MOST_CELLS:
        return None
    middles = np.stack(np.meshgrid(*[(x[1:] + x[:-1]) / 2 for x in lines], indexing="ij"), axis=-1).reshape(-1, 3)
    around = _winding_all(middles, triangles)
    if around is None:
        return None
    filled = (around > 0.5).reshape(shape)
    blocks = min((_join(filled, order) for order in itertools.permutations(range(3))), key=len)
    if not 0 < len(blocks) <= MOST_BOXES:
        return None
    sides = [[(lines[k][lo], lines[k][hi]) for k, (lo, hi) in enumerate(block)] for block in blocks]
    total = sum(float(np.prod([b - a for a, b in side])) for side in sides)
    if abs(total - volume) > VOLUME * volume:
        return None
    corners = [np.stack(np.meshgrid(*side, indexing="ij"), axis=-1).reshape(8, 3) for side in sides]
    return [h for h in map(hull_of, corners) if h is not None]


def _coordinates(values: np.ndarray) -> np.ndarray:
    """Distinct values, ascending; near ones are joined to their mean, but the outermost stay exact."""
    values = np.unique(values)
    near = min(SNAP, 0.005 * float(np.ptp(values)))
    groups = np.split(values, np.flatnonzero(np.diff(values) > near) + 1)
    joined = np.array([g.mean() for g in groups])
    joined[0], joined[-1] = values[0], values[-1]
    return joined


def _winding_all(points: np.ndarray, triangles: np.ndarray) -> np.ndarray | None:
    """Winding numbers of all points, or None where that would take too long."""
    if len(points) * len(triangles) > 60_000_000:
        return None
    rows = max(64, 5_000_000 // len(triangles))
    return np.concatenate([winding(points[i : i + rows], triangles) for i in range(0, len(points), rows)])


def _join(filled: np.ndarray, order: tuple[int, ...]) -> list[list[tuple[int, int]]]:
    """Boxes that cover the filled cells once: each grown along the axes in `order`, as far as it goes.

    Each is a list of three half-open ranges of cells (low, high).
    """
    left = filled.copy()
    blocks = []
    while left.any():
        low = [int(i) for i in np.unravel_index(int(left.argmax()), left.shape)]
        high = [i + 1 for i in low]
        for axis in order:
            while high[axis] < left.shape[axis]:
                index = tuple(slice(high[k], high[k] + 1) if k == axis else slice(low[k], high[k]) for k in range(3))
                if not left[index].all():
                    break
                high[axis] += 1
        left[tuple(slice(a, b) for a, b in zip(low, high, strict=True))] = False
        blocks.append(list(zip(low, high, strict=True)))
    return blocks
