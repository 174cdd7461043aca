"""Kitchens, pantries, dining rooms, utility rooms: the counter run, the table and its chairs, the machines."""

from __future__ import annotations

from collections.abc import Iterator

from ..things import Thing
from .kit import SIDES, RoomKit

BEFORE = 0.55  # m, kept free before what has doors
RUN = ("sink", "bottom_cabinet", "stove", "bottom_cabinet", "dishwasher", "bottom_cabinet")
"""From the fridge on; what does not fit is tried at another wall."""
OVER = {"stove": ("range_hood", 1.62), "bottom_cabinet": ("top_cabinet", 1.45)}
"""What hangs over parts of the run, and the height (m) of its lower edge."""


def kitchen(kit: RoomKit) -> Iterator[Thing | None]:
    """The fridge in a corner, the run beside it, wall cupboards over it, a microwave, a table where there is room."""
    sides = sorted(SIDES, key=lambda side: (-_longest(kit, side), side))
    fridge = kit.at_wall("fridge", side=sides, place="corner", room_before=BEFORE)
    yield fridge
    run: list[Thing] = []
    style = kit.home.index("bottom_cabinet")  # all cupboards of a kitchen alike
    hanging = kit.home.index("top_cabinet")
    last, way = fridge, 0
    for category in RUN:
        thing = None
        same = style if category == "bottom_cabinet" else None
        if last is not None:
            for which in (way,) if way else (1, -1):
                thing = kit.beside(last, category, which, index=same, gap=NARROW, room_before=BEFORE)
                if thing is not None:
                    way = which
                    break
        if thing is None:
            thing = kit.at_wall(category, side=sides, index=same, place="corner", room_before=BEFORE)
        if thing is not None:
            run.append(thing)
            last = thing
        yield thing
        if thing is not None and category in OVER:
            over, height = OVER[category]
            yield kit.above(thing, over, height, index=hanging if over == "top_cabinet" else None)
    counters = [thing for thing in run if thing.category == "bottom_cabinet"]
    if counters:
        yield kit.on(counters[-1], "microwave", degrees=0, at="middle")
    if not any(room.kind == "dining_room" for room in kit.home.plan.rooms):
        yield from table_with_chairs(kit, "breakfast_table", 2)
    yield kit.at_wall("trash_can", place="corner")


NARROW = 0.006


def _longest(kit: RoomKit, side: str) -> float:
    return max((high - low for low, high in kit.wall_spans(side)), default=0.0)


def table_with_chairs(kit: RoomKit, category: str, chairs: int) -> Iterator[Thing | None]:
    """A table as near the middle as it can stand, chairs at it and facing it."""
    table = in_the_middle(kit, category)
    yield table
    if table is None:
        return
    index = kit.home.index("straight_chair")
    along = 0.27 * table.size[1] if chairs > 2 else 0.0
    places = [(0.0, along), (180.0, along), (0.0, -along), (180.0, -along), (90.0, 0.0), (270.0, 0.0)]
    placed = 0
    for side, shift in places if chairs > 2 else (places[0], places[1], places[4], places[5]):
        if placed < chairs:
            chair = kit.before(table, "straight_chair", -0.14, index=index, along=shift, side=side)
            placed += chair is not None
            yield chair


def in_the_middle(kit: RoomKit, category: str, room_around: float = 0.3) -> Thing | None:
    """Stands something where it has most space around, near the room's middle."""
    x0, y0, x1, y1 = kit.rect
    cx, cy = (x0 + x1) / 2, (y0 + y1) / 2
    index = kit.home.index(category)
    spots = [(cx + 0.2 * i, cy + 0.2 * j) for i in range(-6, 7) for j in range(-6, 7)]
    spots.sort(key=lambda p: (p[0] - cx) ** 2 + (p[1] - cy) ** 2)
    for gap in (room_around, room_around / 2):
        for spot in spots:
            for degrees in (0, 90) if (x1 - x0) <= (y1 - y0) else (90, 0):
                thing = kit.at(category, spot, degrees, index=index, gap=gap)
                if thing is not None:
                    return thing
    return None


def dining_room(kit: RoomKit) -> Iterator[Thing | None]:
    """A big table, four chairs, a sideboard, pictures, a plant."""
    yield from table_with_chairs(kit, "breakfast_table", 4)
    yield kit.at_wall("console_table", under_window=False)
    yield kit.at_wall("painting", height=1.4)
    yield kit.at_wall("pot_plant", place="corner")
    yield kit.at_wall("shelf", place="corner")
    yield kit.at_wall("wall_clock", height=1.8)


def pantry_room(kit: RoomKit) -> Iterator[Thing | None]:
    """Shelves along the walls."""
    for _ in range(3):
        yield kit.at_wall("shelf", place="corner")
    yield kit.at_wall("basket", place="corner")
    yield kit.at_wall("stool")


def utility_room(kit: RoomKit) -> Iterator[Thing | None]:
    """Washer, dryer, a cupboard, cleaning things."""
    washer = kit.at_wall("washer", place="corner", room_before=BEFORE)
    yield washer
    if washer:
        yield kit.beside(washer, "dryer", 1, room_before=BEFORE) or kit.beside(washer, "dryer", -1, room_before=BEFORE)
    yield kit.at_wall("bottom_cabinet", place="corner", room_before=BEFORE)
    yield kit.at_wall("bucket", place="corner")
    yield kit.at_wall("vacuum", place="corner")
    yield kit.at_wall("shelf", place="corner")
