"""NextTo(a, b): a strip around b, on whatever level surface is there. The paper does not sample this predicate."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ig2mj.sampling.columns import CELL
from ig2mj.sampling.footprint import Footprint
from ig2mj.sampling.placement import Areas, PlacementArea
from ig2mj.sampling.query import SceneQuery
from ig2mj.states.relations.nearness import SHARE_OF_SIZE

STEP = 0.01
"""Metres above and below b's lowest point from which surfaces are looked for."""


def areas(query: SceneQuery, _: int, neighbour: int) -> Areas:
    """The rule for putting something next to `neighbour`."""
    return beside(query, neighbour, None)


def beside(query: SceneQuery, neighbour: int, limit: float | None) -> Areas:
    """Places whose box is at most `limit` metres from the neighbour's; None: as near as NextTo asks."""
    tables = query.scene.tables
    supports = tuple(int(o) for o in np.flatnonzero(~tables.object_parked) if o != neighbour)

    def strip(shape: Footprint, rng: np.random.Generator) -> Iterator[PlacementArea]:
        low, high = query.box(neighbour)
        rows, cols = shape.underside.shape
        near = limit
        if near is None:
            edges = np.mean([cols * CELL, rows * CELL, shape.high - shape.low]) + np.mean(high - low)
            near = float(SHARE_OF_SIZE * edges)

        def allowed(row: np.ndarray, col: np.ndarray) -> np.ndarray:
            own_low = np.stack([col + shape.col, row + shape.row], -1) * CELL
            own_high = own_low + np.array([cols, rows]) * CELL
            gap = np.maximum(np.maximum(own_low - high[:2], low[:2] - own_high), 0.0)
            return (np.linalg.norm(gap, axis=-1) <= near) & (gap.max(-1) > 0)

        reach = near + max(rows, cols) * CELL
        for height in (low[2] + STEP, low[2] - STEP, high[2] + STEP):
            yield PlacementArea(low[:2] - reach, high[:2] + reach, float(height), supports, allowed)

    return strip
