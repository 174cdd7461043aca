"""A rule's areas, but only on one object, within its box: next to a carrot and inside the fridge."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator

import numpy as np

from ig2mj.sampling.columns import CELL
from ig2mj.sampling.footprint import Footprint
from ig2mj.sampling.placement import Areas, PlacementArea
from ig2mj.sampling.query import SceneQuery


def borne_by(areas: Areas, query: SceneQuery, support: int, loose: bool) -> Areas:
    """Areas on `support` alone. `loose`: it is a container, in which physics may decide where the object comes to rest
    (`PlacementArea.loose`)."""

    def narrowed(shape: Footprint, rng: np.random.Generator) -> Iterator[PlacementArea]:
        low, high = query.box(support)
        for area in areas(shape, rng):

            def allowed(row: np.ndarray, col: np.ndarray, area: PlacementArea = area) -> np.ndarray:
                place = (np.stack([col, row], -1) + 0.5) * CELL
                here = np.asarray(((place >= low[:2]) & (place <= high[:2])).all(-1))
                return here if area.allowed is None else here & area.allowed(row, col)

            yield dataclasses.replace(area, supports=(support,), allowed=allowed, loose=loose)

    return narrowed
