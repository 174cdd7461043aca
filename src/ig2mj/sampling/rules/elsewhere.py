"""The negation of a placement: the object is moved away, onto a piece of furniture or the floor of some room."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ig2mj.predicates.base import ANY_ROOM
from ig2mj.sampling.footprint import Footprint
from ig2mj.sampling.placement import Areas, PlacementArea
from ig2mj.sampling.query import SceneQuery
from ig2mj.sampling.rules import on_floor, on_top

FURNITURE = 4
"""Pieces of furniture that are tried for one orientation before the floor."""


def areas(query: SceneQuery, placed: int, avoided: int) -> Areas:
    """The rule for putting something anywhere but at `avoided`."""
    tables = query.scene.tables
    fixed = tables.object_fixed & ~tables.object_is_floor & ~tables.object_parked
    fixed &= ~np.isin(tables.object_categories, ("walls", "ceilings", "door", "window"))
    furniture = [int(o) for o in np.flatnonzero(fixed) if o != avoided and (tables.piece_object == o).any()]
    floor = on_floor.areas(query, placed, ANY_ROOM)

    def elsewhere(shape: Footprint, rng: np.random.Generator) -> Iterator[PlacementArea]:
        for support in rng.permutation(furniture)[:FURNITURE]:
            yield from on_top.areas(query, placed, int(support))(shape, rng)
        yield from floor(shape, rng)

    return elsewhere
