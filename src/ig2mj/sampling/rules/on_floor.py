"""OnFloor(a, room): the floor within a room of the segmentation map (paper, table A.5), or within any room."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator

import numpy as np

from ig2mj.predicates.base import ANY_ROOM
from ig2mj.sampling.columns import CELL
from ig2mj.sampling.footprint import Footprint
from ig2mj.sampling.placement import Areas, PlacementArea
from ig2mj.sampling.query import SceneQuery
from ig2mj.scene.tables import SceneTables

PATCH = 0.6
"""Metres. Half side of a patch of floor. Patches are looked at first, a whole room only where none will do."""

PATCHES = 6

LARGEST = 6.0
"""Metres. A floor that is larger is never looked at as a whole: patches will do."""

COVERING = 0.03
"""Metres. What is fixed to the floor and no higher is a covering, such as a carpet."""


@dataclasses.dataclass(frozen=True)
class FloorSupports:
    """What counts as the floor: the objects, and a height (world z) just above all of them."""

    objects: tuple[int, ...]
    height: float


def floor_supports(query: SceneQuery, coverings: bool) -> FloorSupports:
    """The floors, and, if asked for, what lies flat on them and is fixed."""
    tables = query.scene.tables
    floors = [int(f) for f in np.flatnonzero(tables.object_is_floor) if (tables.piece_object == f).any()]
    if not floors:
        return FloorSupports((), 0.0)
    top = max(float(query.box(f)[1][2]) for f in floors)
    flat = []
    if coverings:
        for o in np.flatnonzero(tables.object_fixed & ~tables.object_is_floor):
            if (tables.piece_object == o).any():
                low, high = query.box(int(o))
                if abs(low[2] - top) < COVERING and high[2] - top < COVERING:
                    flat.append(int(o))
    return FloorSupports((*floors, *flat), top + (COVERING if coverings else 0.002))


def areas(query: SceneQuery, _: int, room: int) -> Areas:
    """The rule for putting something on the floor of `room`, an index into the tables' rooms or `ANY_ROOM`."""
    tables = query.scene.tables
    supports = floor_supports(query, coverings=False)
    rows, cols = np.nonzero(tables.room_map > 0 if room == ANY_ROOM else tables.room_map == room + 1)
    half = np.array(tables.room_map.shape)[::-1] / 2
    points = (np.stack([cols, rows], 1) + 0.5 - half) * tables.room_resolution

    def allowed(row: np.ndarray, col: np.ndarray) -> np.ndarray:
        return _in_room(tables, row, col, room)

    def on_floor(shape: Footprint, rng: np.random.Generator) -> Iterator[PlacementArea]:
        if not len(points) or not supports.objects:
            return
        for centre in points[rng.choice(len(points), PATCHES)]:
            yield PlacementArea(centre - PATCH, centre + PATCH, supports.height, supports.objects, allowed)
        if (np.ptp(points, axis=0) <= LARGEST).all():
            yield PlacementArea(points.min(0), points.max(0), supports.height, supports.objects, allowed)

    return on_floor


def within(areas: Areas, query: SceneQuery, room: int) -> Areas:
    """Another rule's areas, but only where the object's origin is in `room` (an index, or `ANY_ROOM`)."""
    tables = query.scene.tables

    def narrowed(shape: Footprint, rng: np.random.Generator) -> Iterator[PlacementArea]:
        for area in areas(shape, rng):

            def allowed(row: np.ndarray, col: np.ndarray, area: PlacementArea = area) -> np.ndarray:
                here = _in_room(tables, row, col, room)
                return here if area.allowed is None else here & area.allowed(row, col)

            yield dataclasses.replace(area, allowed=allowed)

    return narrowed


def _in_room(tables: SceneTables, row: np.ndarray, col: np.ndarray, room: int) -> np.ndarray:
    """Whether the middles of cells are in the room."""
    size = np.array(tables.room_map.shape)
    place = (np.stack([row, col], -1) + 0.5) * CELL / tables.room_resolution + size / 2
    index = np.floor(place).astype(int)
    known = np.asarray(((index >= 0) & (index < size)).all(-1))
    inside = np.where(known[..., None], index, 0)
    found = np.where(known, tables.room_map[inside[..., 0], inside[..., 1]], 0)
    return found > 0 if room == ANY_ROOM else found == room + 1
