"""Boxes of a home that nothing of the garden is in: rays that begin and end in one of them need not look for it.

Axes: N boxes, R rooms, F triangles.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float

from ig2mj.scene.rooms import Rooms

MOST = 4
"""Boxes of a home; each costs every ray a comparison."""

LOWEST, HIGHEST = 0.02, 2.0
"""m above the floor: a room's box before it grows."""

INSET = 1e-3
"""m by which boxes are smaller than the room that they have."""

_ORDERS = ((0, 1, 2), (1, 0, 2))
"""Axes along which a box grows, one after the other."""


def indoor_boxes(
    rooms: Rooms, still: Float[np.ndarray, "V 3"], garden: Float[np.ndarray, "F 3 3"]
) -> Float[np.ndarray, "N 2 3"]:
    """Low and high corners, m, world frame; none where the home has no rooms.

    A box begins as the rectangle around a room, and grows along the axes to the next triangle of the garden. Boxes with
    the most volume that no other box has are kept.

    Args:
      rooms: of the home. still: vertices of what never moves, whose extent no box leaves. garden: corners of triangles.
    """
    low, high = still.min(axis=0), still.max(axis=0)
    blocks = garden.min(axis=1), garden.max(axis=1)
    found: list[np.ndarray] = []
    for number in range(len(rooms.names)):
        rows, columns = np.nonzero(rooms.room_map == number + 1)
        if not len(rows):
            continue
        half = rooms.room_map.shape[0] / 2
        begin = np.array([(columns.min() - half) * rooms.resolution, (rows.min() - half) * rooms.resolution, LOWEST])
        end = np.array([(columns.max() + 1 - half), (rows.max() + 1 - half), 0.0]) * rooms.resolution
        end[2] = HIGHEST
        begin, end = np.maximum(begin, low), np.minimum(end, high)
        if (begin < end).all() and not _inside(blocks, begin, end).any():
            found += [_grown(begin, end, blocks, low, high, order) for order in _ORDERS]
    return _largest(found)


def _inside(
    blocks: tuple[np.ndarray, np.ndarray], begin: Float[np.ndarray, "3"], end: Float[np.ndarray, "3"]
) -> Bool[np.ndarray, "F"]:
    return np.all((blocks[0] < end) & (blocks[1] > begin), axis=1)


def _grown(
    begin: Float[np.ndarray, "3"],
    end: Float[np.ndarray, "3"],
    blocks: tuple[np.ndarray, np.ndarray],
    low: Float[np.ndarray, "3"],
    high: Float[np.ndarray, "3"],
    order: tuple[int, ...],
) -> Float[np.ndarray, "2 3"]:
    begin, end = begin.copy(), end.copy()
    for axis in order:
        wide_begin, wide_end = begin.copy(), end.copy()
        wide_begin[axis], wide_end[axis] = low[axis], high[axis]
        near = _inside(blocks, wide_begin, wide_end)
        ahead, behind = near & (blocks[0][:, axis] >= end[axis]), near & (blocks[1][:, axis] <= begin[axis])
        end[axis] = blocks[0][ahead, axis].min(initial=high[axis])
        begin[axis] = blocks[1][behind, axis].max(initial=low[axis])
    return np.stack([begin + INSET, end - INSET])


def _largest(found: list[np.ndarray]) -> Float[np.ndarray, "N 2 3"]:
    """Of boxes those whose points, sampled on a grid, are in no box that is kept before."""
    kept: list[np.ndarray] = []
    if found:
        low, high = np.min([b[0] for b in found], axis=0), np.max([b[1] for b in found], axis=0)
        axes = [np.linspace(low[k], high[k], count) for k, count in enumerate((80, 80, 3))]
        points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
        holds = np.array([((points > b[0]) & (points < b[1])).all(axis=1) for b in found])
        left = np.ones(len(points), bool)
        while len(kept) < MOST and (most := (holds & left).sum(axis=1)).max() > len(points) // 200:
            best = int(most.argmax())
            kept.append(found[best])
            left &= ~holds[best]
    return np.array(kept).reshape(-1, 2, 3)
