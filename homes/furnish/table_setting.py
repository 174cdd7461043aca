"""A laid table: a bowl in the middle, and a plate, a glass, a fork and a knife before each chair."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from .kit import RoomKit
from .placed import Placed

CENTREPIECES = ("bowl", "carafe", "pot_plant", "candle")
COVER = (("plate", 0.18, 0.0), ("glass", 0.30, -0.17), ("tablefork", 0.18, 0.17), ("table_knife", 0.18, -0.16))
"""Piece, metres in from the table's edge, metres to the left of who sits there."""
PLACE_DISTANCE = 0.75  # m, from the table's edge to the middle of a chair that belongs to it


def lay_table(kit: RoomKit, table: Placed) -> Iterator[Placed]:
    """Gives one object after the other; first what stands in the middle, then all plates, all glasses, ..."""
    middle = kit.on(table, kit.rng.choice(CENTREPIECES), at="middle", degrees=0.0)
    if middle is not None:
        yield middle
    models: dict[str, int] = {}
    for piece, inwards, left in COVER:
        for seat in _seats(kit, table):
            index = models.setdefault(piece, kit.home.index(piece))
            put = _before_seat(kit, table, seat, piece, index, inwards, left)
            if put is not None:
                yield put


def _seats(kit: RoomKit, table: Placed) -> list[np.ndarray]:
    """Places [2] of the chairs that look at a table, in its frame."""
    seats = []
    for thing in kit.home.things.things.values():
        if thing.category != "straight_chair" or thing.rooms != table.rooms:
            continue
        local = table.rotation[:2, :2].T @ (thing.centre - table.centre)[:2]
        over = np.abs(local) - table.size[:2] / 2
        if over.max() < PLACE_DISTANCE and float(thing.front @ (table.centre - thing.centre)[:2]) > 0:
            seats.append(local)
    return seats


def _before_seat(
    kit: RoomKit, table: Placed, seat, piece: str, index: int, inwards: float, left: float
) -> Placed | None:
    half = table.size[:2] / 2
    axis = int(np.argmax(np.abs(seat) - half))
    way = np.zeros(2)
    way[axis] = -np.sign(seat[axis])  # as the sitting one looks
    spot = np.array(seat, float)
    spot[axis] = -way[axis] * (half[axis] - inwards)
    spot += left * np.array([-way[1], way[0]])
    middle = table.rotation.T @ (table.centre - table.position)
    degrees = float(np.degrees(np.arctan2(way[1], way[0])))
    return kit.on(
        table, piece, index=index, at=(float(spot[0] + middle[0]), float(spot[1] + middle[1])), degrees=degrees
    )
