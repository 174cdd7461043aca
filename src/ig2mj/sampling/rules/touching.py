"""InContactWith(a, b): on b, or pushed against its side. The paper does not sample this predicate."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ig2mj.sampling.footprint import Footprint
from ig2mj.sampling.placement import Areas, PlacementArea
from ig2mj.sampling.query import SceneQuery
from ig2mj.sampling.rules import inside, next_to, on_top

GAP = 0.02
"""Metres between the boxes before the object is pushed against the other one."""


def areas(query: SceneQuery, placed: int, other: int) -> Areas:
    """The rule for putting something against `other`."""
    above, within, beside = on_top.areas(query, placed, other), inside.areas(query, placed, other), next_to.beside

    def against(shape: Footprint, rng: np.random.Generator) -> Iterator[PlacementArea]:
        yield from above(shape, rng)
        for area in beside(query, other, GAP)(shape, rng):
            yield PlacementArea(area.low, area.high, area.height, area.supports, area.allowed, push_towards=other)
        yield from within(shape, rng)

    return against
