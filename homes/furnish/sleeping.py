"""Bedrooms, children's rooms, closets, bathrooms."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from .kit import RoomKit
from .kitchen import with_doors
from .living import middle_carpet, shoes
from .placed import Placed, yaw
from .room import degrees_of

LID = 0.2
"""m, behind a chest: its lid tips backwards."""
ATTEMPTS = 12
"""At the three fittings of a bathroom."""


def bedroom(kit: RoomKit) -> Iterator[Placed | None]:
    """The bed's head at a wall, a stand with a lamp on each side, a chest of drawers, shelves, a desk, a carpet."""
    bed = kit.at_wall("bed", place="middle", under_window=False) or kit.at_wall("bed")
    yield bed
    if bed is not None:
        index = kit.home.index("stand")
        for which in (1, -1):
            stand = kit.beside(bed, "stand", which, index=index)
            yield stand
            if stand is not None:
                yield kit.on(stand, "table_lamp", at="middle", degrees=0)
        yield kit.on(bed, "pillow", degrees=0, at=_head(bed, 0.22))
        yield kit.on(bed, "pillow", degrees=0, at=_head(bed, -0.22))
    yield kit.at_wall("bottom_cabinet", room_before=0.5, place="corner", under_window=False)
    if bed is not None:
        yield _beside_bed(kit, bed)
        yield kit.above(bed, "painting", 1.4)
    yield kit.at_wall("shelf", under_window=False, place="corner")
    yield from kit.desk_with("straight_chair")
    yield kit.hang("mirror", 0.95)
    yield kit.under_window("heater")
    yield kit.at_wall("pot_plant", place="corner")
    yield kit.hang("picture", 1.45)
    yield kit.at_wall("armchair", place="corner")
    yield kit.at_wall("basket", place="corner")
    yield from shoes(kit, category="sandal")


def _beside_bed(kit: RoomKit, bed: Placed) -> Placed | None:
    """A carpet at the bed's foot or along one of its sides."""
    places = ((0.0, 0), (90.0, 1), (270.0, 1))
    for side, axis in places:
        turned = degrees_of(bed) + side
        way = np.round(yaw(turned)[:2, 0])
        for depth in (1.2, 0.9, 0.7):
            middle = bed.centre[:2] + way * (float(bed.size[axis]) / 2 + 0.04 + depth / 2)
            carpet = kit.spread((float(middle[0]), float(middle[1])), turned, (depth, float(bed.size[1 - axis])))
            if carpet is not None:
                return carpet
    return None


def _head(bed: Placed, side: float) -> tuple[float, float]:
    """Where a pillow lies: near the head, to one side; in the bed's frame."""
    return (-0.30 * float(bed.size[0]), side * float(bed.size[1]))


def childs_room(kit: RoomKit) -> Iterator[Placed | None]:
    """A bed, a shelf and a chest for toys, toys on the floor."""
    bed = kit.at_wall("bed", place="corner") or kit.at_wall("crib", place="corner")
    yield bed
    yield kit.at_wall("shelf", under_window=False, place="corner")
    yield kit.at_wall("backpack", place="corner")
    if bed is not None:
        yield kit.on(bed, "pillow", degrees=0, at=_head(bed, 0.0))
    yield kit.at_wall("chest", room_before=0.4, wall_gap=LID)
    yield from kit.desk_with("straight_chair")
    yield middle_carpet(kit)
    yield kit.hang("picture", 1.4)
    yield kit.at_wall("toy", place="corner")
    yield kit.under_window("heater")
    yield kit.at_wall("stand", place="corner")
    yield kit.hang("picture", 1.4)
    yield kit.at_wall("basket", place="corner")


def playroom(kit: RoomKit) -> Iterator[Placed | None]:
    """Toys, a game table, a shelf, a board."""
    yield kit.at_wall("shelf", under_window=False, place="corner")
    yield kit.at_wall("chest", room_before=0.4, wall_gap=LID)
    table = kit.at_wall("gaming_table", room_before=0.6)
    yield table
    if table is not None:
        yield kit.before(table, "stool", -0.1)
    yield middle_carpet(kit)
    yield kit.hang("whiteboard", 0.9)
    yield kit.at_wall("shelf", under_window=False, place="corner")
    yield kit.at_wall("armchair", place="corner")
    yield kit.hang("picture", 1.4)
    yield kit.at_wall("basket", place="corner")
    yield kit.under_window("heater")
    yield kit.at_wall("toy", place="corner")


def closet(kit: RoomKit) -> Iterator[Placed | None]:
    """Shelves and drawers for clothes."""
    for _ in range(2):
        yield kit.at_wall("shelf", place="corner")
    yield kit.at_wall("bottom_cabinet", room_before=0.5, place="corner")
    yield kit.hang("mirror", 0.6)
    yield from shoes(kit)
    yield kit.at_wall("duffel_bag", place="corner")
    yield kit.at_wall("stool", place="corner")


def bathroom(kit: RoomKit) -> Iterator[Placed | None]:
    """Bathtub or shower, toilet, washbasin with a mirror, towels."""
    tub, toilet, sink = _fittings(kit)
    yield tub
    yield toilet
    yield sink
    if sink is not None:
        yield kit.above(sink, "mirror", 1.25)
    yield kit.hang("towel_rack", 1.2)
    if tub is not None:
        sides = (90.0, 270.0) if tub.size[0] > 1.2 * tub.size[1] else (0.0,)
        yield next((mat for side in sides if (mat := kit.before(tub, "mat", 0.05, side=side)) is not None), None)
    yield kit.at_wall("trash_can", place="corner")
    yield kit.at_wall("shelf", place="corner", under_window=False)
    yield kit.at_wall("stool", place="corner")
    yield kit.at_wall("basket", place="corner")


def _fittings(kit: RoomKit) -> list[Placed | None]:
    """Bathtub or shower, toilet and washbasin, tried until all three have found a place."""
    large = kit.room.area > 5.5
    start, found = kit.home.now(), []
    for attempt in range(ATTEMPTS):
        kit.home.back_to(start)
        tub = kit.at_wall("bathtub", place="corner") if large and attempt < ATTEMPTS / 2 else None
        tub = tub or kit.at_wall("shower", place="corner", under_window=False)
        toilet = kit.at_wall("toilet", room_before=0.35, place="corner" if attempt % 2 else "any")
        index = kit.home.index("sink", with_doors if large else None)
        sink = kit.at_wall("sink", room_before=0.45, under_window=False, index=index)
        found = [tub, toilet, sink]
        if all(found):
            break
    return found
