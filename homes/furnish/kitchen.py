"""Kitchens, pantries, dining rooms, utility rooms: the counter run, the table and its chairs, the machines."""

from __future__ import annotations

import itertools
from collections.abc import Iterator

from .kit import RoomKit
from .placed import Placed, Shape
from .room import SIDES

BEFORE = 0.55  # m, kept free before what has doors
RUN = ("sink", "bottom_cabinet", "stove", "bottom_cabinet", "dishwasher", "bottom_cabinet")
"""From the fridge on; what does not fit is tried at another wall."""
SHORT_RUN = ("sink", "stove", "bottom_cabinet", "bottom_cabinet", "dishwasher", "bottom_cabinet")
"""Where no wall is longer than SHORT m: the stove stays next to the sink, and a cupboard goes to another wall."""
SHORT = 3.3
ISLAND = 11.5  # m2 of kitchen from which a counter with stools stands in its middle
OVER = {"stove": ("range_hood", 1.62), "bottom_cabinet": ("top_cabinet", 1.45)}
"""What hangs over parts of the run, and the height (m) of its lower edge."""


def kitchen(kit: RoomKit) -> Iterator[Placed | None]:
    """The fridge in a corner, the run next to it, wall cupboards over it, a microwave, a table where there is room."""
    sides = sorted(SIDES, key=lambda side: (-_longest(kit, side), side))
    fridge = kit.at_wall("fridge", side=sides, place="corner", room_before=BEFORE)
    yield fridge
    run: list[Placed] = []
    style = kit.home.index("bottom_cabinet")  # all cupboards of a kitchen alike
    hanging = kit.home.index("top_cabinet")
    last, way = fridge, 0
    for category in RUN if _longest(kit, sides[0]) > SHORT else SHORT_RUN:
        thing = None
        same = style if category == "bottom_cabinet" else None
        same = kit.home.index("sink", with_doors) if category == "sink" else same
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
    for thing in sorted(run, key=lambda thing: thing.category != "stove"):
        if thing.category in OVER:
            over, height = OVER[thing.category]
            yield kit.above(thing, over, height, index=hanging if over == "top_cabinet" else None)
    counters = [thing for thing in run if thing.category == "bottom_cabinet"]
    if counters:
        yield kit.on(counters[-1], "microwave", degrees=0, at="middle")
        if kit.home.roomy:
            yield kit.on(counters[0], "paper_towel", degrees=0)
    if not any(room.kind == "dining_room" for room in kit.home.plan.rooms):
        yield from table_with_chairs(kit, "breakfast_table", 2)
    elif kit.room.area > ISLAND:
        yield from island(kit)
    yield kit.at_wall("trash_can", place="corner")
    yield kit.hang("wall_clock", 1.8)
    yield kit.at_wall("shelf", place="corner", under_window=False)
    yield kit.at_wall("pot_plant", place="corner")


NARROW = 0.006


def with_doors(form: Shape) -> bool:
    """A kitchen's sink stands over a cupboard, not on a pedestal."""
    return any(joint.openable for joint in form.model.joints)


def island(kit: RoomKit) -> Iterator[Placed | None]:
    """A counter free in the room, two stools at its long side."""
    counter = in_the_middle(kit, "countertop", 0.8)
    yield counter
    if counter is None:
        return
    index = kit.home.index("stool")
    for along in (0.4, -0.4):
        yield kit.before(counter, "stool", 0.03, index=index, along=along) or kit.before(
            counter, "stool", 0.03, index=index, along=along, side=180.0
        )


def _longest(kit: RoomKit, side: str) -> float:
    return max((high - low for low, high in kit.wall_spans(side)), default=0.0)


def table_with_chairs(kit: RoomKit, category: str, chairs: int) -> Iterator[Placed | None]:
    """A table as near the middle as it and its chairs can stand, the chairs at it and facing it."""
    start = kit.home.now()
    table_index, index = kit.home.index(category), kit.home.index("straight_chair")
    most, best = 0, None
    for place in itertools.islice(_middle_spots(kit), SPOTS):
        count = len(_seated(kit, category, table_index, index, place, chairs))
        kit.home.back_to(start)
        if count > most:
            most, best = count, place
        if count == chairs + 1:
            break
    if best is not None:
        yield from _seated(kit, category, table_index, index, best, chairs)


Place = tuple[tuple[float, float], float]
"""x, y, and yaw in degrees."""
SPOTS = 70
"""Places that are tried for a table with all its chairs."""


def _seated(kit: RoomKit, category: str, table_index: int, index: int, place: Place, chairs: int) -> list[Placed]:
    """The table, then its chairs; empty where the table does not fit."""
    spot, degrees = place
    table = kit.at(category, spot, degrees, index=table_index, gap=ROUND_TABLE)
    if table is None:
        return []
    found = [table]
    along = 0.25 * float(table.size[1])
    ends = [(90.0, 0.0), (270.0, 0.0)]
    places = [(0.0, along), (180.0, along), (0.0, -along), (180.0, -along), *ends]
    for side, shift in places if chairs > 2 else [(0.0, 0.0), (180.0, 0.0), *ends]:
        if len(found) <= chairs:
            chair = kit.before(table, "straight_chair", -0.14, index=index, along=shift, side=side)
            found += [chair] if chair is not None else []
    return found


ROUND_TABLE = 0.15  # m of free floor around a table


def _middle_spots(kit: RoomKit) -> Iterator[Place]:
    """Places and yaws for a table, the nearest to the room's middle first; its long side along the room's."""
    x0, y0, x1, y1 = kit.rect
    cx, cy = (x0 + x1) / 2, (y0 + y1) / 2
    spots = [(cx + 0.2 * i, cy + 0.2 * j) for i in range(-6, 7) for j in range(-6, 7)]
    spots.sort(key=lambda p: (p[0] - cx) ** 2 + (p[1] - cy) ** 2)
    for spot in spots:
        for degrees in (0.0, 90.0) if (x1 - x0) <= (y1 - y0) else (90.0, 0.0):
            yield spot, degrees


def in_the_middle(kit: RoomKit, category: str, room_around: float = 0.3) -> Placed | None:
    """Stands something where it has most space around, near the room's middle."""
    index = kit.home.index(category)
    for gap in (room_around, room_around / 2):
        for spot, degrees in _middle_spots(kit):
            thing = kit.at(category, spot, degrees, index=index, gap=gap)
            if thing is not None:
                return thing
    return None


def dining_room(kit: RoomKit) -> Iterator[Placed | None]:
    """A big table, four chairs, a sideboard, pictures, a plant."""
    yield from table_with_chairs(kit, "breakfast_table", 4)
    yield kit.at_wall("console_table", under_window=False)
    yield kit.hang("painting", 1.4)
    yield kit.at_wall("pot_plant", place="corner")
    yield kit.at_wall("shelf", place="corner", under_window=False)
    yield kit.hang("wall_clock", 1.8)
    yield kit.under_window("heater")
    yield kit.at_wall("bottom_cabinet", room_before=BEFORE, under_window=False)
    yield kit.hang("picture", 1.5)
    yield kit.at_wall("pot_plant", place="corner")


def pantry_room(kit: RoomKit) -> Iterator[Placed | None]:
    """Shelves along the walls."""
    for _ in range(3):
        yield kit.at_wall("shelf", place="corner")
    yield kit.at_wall("basket", place="corner")
    yield kit.at_wall("stool", place="corner")
    yield kit.at_wall("pop_case", place="corner")
    yield kit.at_wall("shelf", place="corner")


def utility_room(kit: RoomKit) -> Iterator[Placed | None]:
    """Washer, dryer, a cupboard, cleaning objects."""
    washer = kit.at_wall("washer", place="corner", room_before=BEFORE)
    yield washer
    if washer:
        yield kit.beside(washer, "dryer", 1, room_before=BEFORE) or kit.beside(washer, "dryer", -1, room_before=BEFORE)
    yield kit.at_wall("bottom_cabinet", place="corner", room_before=BEFORE)
    yield kit.at_wall("bucket", place="corner")
    yield kit.at_wall("vacuum", place="corner")
    yield kit.at_wall("shelf", place="corner", under_window=False)
    yield kit.at_wall("basket", place="corner")
    yield kit.at_wall("carpet_sweeper", place="corner")
