"""Bedrooms, children's rooms, closets, bathrooms."""

from __future__ import annotations

from collections.abc import Iterator

from ..things import Thing
from .kit import RoomKit

LID = 0.2
"""m, behind a chest: its lid tips backwards."""


def bedroom(kit: RoomKit) -> Iterator[Thing | None]:
    """The bed's head at a wall, a stand with a lamp on each side, a chest of drawers, a wardrobe shelf, a desk."""
    bed = kit.at_wall("bed", place="middle", under_window=False) or kit.at_wall("bed")
    yield bed
    if bed is not None:
        for which in (1, -1):
            stand = kit.beside(bed, "stand", which)
            yield stand
            if stand is not None:
                yield kit.on(stand, "table_lamp", at="middle", degrees=0)
        yield kit.on(bed, "pillow", degrees=0, at=_head(bed, 0.22))
        yield kit.on(bed, "pillow", degrees=0, at=_head(bed, -0.22))
    yield kit.at_wall("bottom_cabinet", room_before=0.5, place="corner", under_window=False)
    yield kit.at_wall("shelf", under_window=False, place="corner")
    yield kit.at_wall("painting", height=1.4)
    desk = kit.at_wall("desk", room_before=0.6)
    yield desk
    if desk is not None:
        yield kit.before(desk, "straight_chair", -0.12)
    yield kit.at_wall("mirror", height=1.0)
    yield kit.at_wall("pot_plant", place="corner")
    yield kit.at_wall("basket", place="corner")


def _head(bed: Thing, side: float) -> tuple[float, float]:
    """Where a pillow lies: near the head, to one side; in the bed's frame."""
    return (-0.30 * float(bed.size[0]), side * float(bed.size[1]))


def childs_room(kit: RoomKit) -> Iterator[Thing | None]:
    """A bed, a shelf and a chest for toys, toys on the floor."""
    bed = kit.at_wall("bed", place="corner") or kit.at_wall("crib", place="corner")
    yield bed
    yield kit.at_wall("shelf", under_window=False, place="corner")
    if bed is not None:
        yield kit.on(bed, "pillow", degrees=0, at=_head(bed, 0.0))
    yield kit.at_wall("chest", room_before=0.4, wall_gap=LID)
    desk = kit.at_wall("desk", room_before=0.6)
    yield desk
    if desk is not None:
        yield kit.before(desk, "straight_chair", -0.12)
    yield kit.at_wall("toy")
    yield kit.at_wall("picture", height=1.4)
    yield kit.at_wall("duffel_bag")
    yield kit.at_wall("toy")


def playroom(kit: RoomKit) -> Iterator[Thing | None]:
    """Toys, a game table, a shelf, a board."""
    yield kit.at_wall("shelf", under_window=False, place="corner")
    yield kit.at_wall("chest", room_before=0.4, wall_gap=LID)
    for _ in range(2):
        yield kit.at_wall("toy")
    table = kit.at_wall("gaming_table", room_before=0.6)
    yield table
    if table is not None:
        yield kit.before(table, "stool", -0.1)
    yield kit.at_wall("whiteboard", height=0.9)
    yield kit.at_wall("toy", place="corner")
    yield kit.at_wall("basket", place="corner")


def closet(kit: RoomKit) -> Iterator[Thing | None]:
    """Shelves and drawers for clothes."""
    for _ in range(2):
        yield kit.at_wall("shelf", place="corner")
    yield kit.at_wall("bottom_cabinet", room_before=0.5, place="corner")
    yield kit.at_wall("duffel_bag", place="corner")
    yield kit.at_wall("gym_shoe")


def bathroom(kit: RoomKit) -> Iterator[Thing | None]:
    """Bathtub or shower, toilet, washbasin with a mirror, towels."""
    big = "bathtub" if kit.room.area > 5.5 else "shower"
    yield kit.at_wall(big, place="corner", under_window=big == "bathtub") or kit.at_wall("shower", place="corner")
    yield kit.at_wall("toilet", room_before=0.35)
    sink = kit.at_wall("sink", room_before=0.45, under_window=False)
    yield sink
    if sink is not None:
        yield kit.above(sink, "mirror", 1.25)
    yield kit.at_wall("towel_rack", height=1.2)
    yield kit.at_wall("mat", place="middle")
    yield kit.at_wall("trash_can", place="corner")
    yield kit.at_wall("stool", place="corner")
