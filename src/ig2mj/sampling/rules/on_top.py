"""OnTop(a, b): the surfaces that are met going down from just above b's box (paper, pose sampling algorithm)."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ig2mj.sampling.footprint import Footprint
from ig2mj.sampling.placement import Areas, PlacementArea
from ig2mj.sampling.query import SceneQuery

ABOVE = 0.01
"""Metres above b's box at which the way down begins."""


def areas(query: SceneQuery, _: int, support: int) -> Areas:
    """The rule for putting something on `support`."""

    def on_top(shape: Footprint, rng: np.random.Generator) -> Iterator[PlacementArea]:
        low, high = query.box(support)
        yield PlacementArea(low[:2], high[:2], high[2] + ABOVE, (support,))

    return on_top
