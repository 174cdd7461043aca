"""Under(a, b): the floor beneath b's box (paper, table A.5: "on top of the floor region beneath o2")."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ig2mj.sampling.footprint import Footprint
from ig2mj.sampling.placement import Areas, PlacementArea
from ig2mj.sampling.query import SceneQuery
from ig2mj.sampling.rules.on_floor import floor_supports


def areas(query: SceneQuery, _: int, cover: int) -> Areas:
    """The rule for putting something under `cover`."""
    supports = floor_supports(query, coverings=True)

    def under(shape: Footprint, rng: np.random.Generator) -> Iterator[PlacementArea]:
        low, high = query.box(cover)
        if supports.objects:
            yield PlacementArea(low[:2], high[:2], supports.height, supports.objects, holds_at_once=True)

    return under
