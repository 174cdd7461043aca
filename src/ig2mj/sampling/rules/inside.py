"""Inside(a, b): the surfaces that are met going down from points inside b's box (paper, pose sampling algorithm)."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ig2mj.sampling.footprint import Footprint
from ig2mj.sampling.placement import Areas, PlacementArea
from ig2mj.sampling.query import SceneQuery

HEIGHTS = 6
"""Heights that are tried for one orientation, spread evenly over b's box: every shelf and drawer is a level."""


def areas(query: SceneQuery, placed: int, container: int) -> Areas:
    """The rule for putting something into `container`."""

    tables = query.scene.tables
    loose = ~tables.object_fixed & ~tables.object_parked
    loose[[container, placed]] = False

    def inside(shape: Footprint, rng: np.random.Generator) -> Iterator[PlacementArea]:
        low, high = query.box(container)
        com = np.asarray(query.view.object_com[0])
        held = loose & ((com > low) & (com < high)).all(-1)
        layer = (np.arange(HEIGHTS) + rng.uniform(size=HEIGHTS)) / HEIGHTS
        for part in rng.permutation(layer):
            yield PlacementArea(
                low[:2],
                high[:2],
                float(low[2] + part * (high[2] - low[2])),
                (container,),
                loose=True,
                holds_at_once=True,
                contents=tuple(np.flatnonzero(held).tolist()),
            )

    return inside
