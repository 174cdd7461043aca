"""Living and television rooms, libraries, lobbies, corridors, balconies: where one sits, and where one passes."""

from __future__ import annotations

from collections.abc import Iterator

from .kit import RoomKit
from .placed import Placed
from .television_area import place_television_area, seats_around

LARGE = 20.0  # m2 of living room from which there is a piano or a second place to sit
READING = 0.5  # m of floor kept free before a reading chair
RUNNER = (0.9, 1.7)  # m, width and length of a corridor's carpet at most
RUNNER_EVERY = 3.2  # m of corridor


def living_room(kit: RoomKit) -> Iterator[Placed | None]:
    """A television at one wall, the sofa opposite, the coffee table between them; books, a sideboard, plants."""
    place = place_television_area(kit)
    if place is None:
        yield kit.at_wall("sofa", place="middle") or kit.at_wall("armchair", place="corner")
    else:
        yield place.television
        yield place.sofa
        yield from seats_around(kit, place, carpet=kit.home.roomy)
    yield kit.at_wall("shelf", under_window=False)
    if place is not None:
        yield kit.above(place.sofa, "painting", 1.35)
    yield kit.at_wall("pot_plant", place="corner")
    yield from entrance(kit)
    yield kit.under_window("heater")
    yield kit.at_wall("shelf", under_window=False, place="corner")
    yield kit.hang("painting", 1.4)
    if kit.room.area > LARGE:
        yield kit.at_wall("piano", under_window=False, room_before=0.5)
        yield from reading_corner(kit)
    if place is not None and place.table is not None:
        yield kit.beside(place.table, "loudspeaker", 1, gap=0.08)
        yield kit.beside(place.table, "loudspeaker", -1, gap=0.08)
    yield sideboard(kit)
    yield kit.hang("picture", 1.5)
    if kit.room.area > LARGE:
        yield kit.at_wall("grandfather_clock")
        yield kit.at_wall("chaise_longue", place="corner")
    yield kit.at_wall("pot_plant", place="corner")
    yield kit.at_wall("basket", place="corner")
    yield kit.hang("picture", 1.5)


def sideboard(kit: RoomKit) -> Placed | None:
    """A narrow table at a wall."""
    return kit.at_wall("console_table", under_window=False)


def reading_corner(kit: RoomKit) -> Iterator[Placed | None]:
    """A chair in a corner, a lamp and a small carpet by it."""
    category = kit.rng.choice(("armchair", "rocking_chair"))
    chair = kit.at_wall(category, place="corner", room_before=READING)
    yield chair
    if chair is not None:
        yield kit.beside(chair, "floor_lamp", 1) or kit.beside(chair, "floor_lamp", -1)


def entrance(kit: RoomKit) -> Iterator[Placed | None]:
    """Coats and shoes by the front door, where the room has it."""
    door = kit.front_door
    if door is None:
        return
    x, y = (float(v) for v in door.edge.point(door.centre))
    side = kit.side_of(door.edge)
    others = [name for name in ("west", "south", "east", "north") if name != side]
    yield kit.at_wall("coatrack", side=[side, *others], near=(x, y))
    yield from shoes(kit, (x, y))


def shoes(kit: RoomKit, near: tuple[float, float] | None = None, category: str = "gym_shoe") -> Iterator[Placed | None]:
    """A pair, side by side at a wall."""
    first = kit.at_wall(category, near=near)
    yield first
    if first is not None:
        yield kit.beside(first, category, 1, index=first.index, gap=0.02) or kit.beside(
            first, category, -1, index=first.index, gap=0.02
        )


def television_room(kit: RoomKit) -> Iterator[Placed | None]:
    """As a living room, with less in it."""
    place = place_television_area(kit)
    if place is not None:
        yield place.television
        yield place.sofa
        yield from seats_around(kit, place, armchairs=1)
    yield kit.at_wall("speaker_system", under_window=False)
    yield kit.at_wall("pot_plant", place="corner")
    yield kit.at_wall("shelf", under_window=False, place="corner")
    yield kit.hang("picture", 1.5)
    yield kit.under_window("heater")
    yield kit.hang("painting", 1.4)


def library(kit: RoomKit) -> Iterator[Placed | None]:
    """Bookshelves all around, a chair to read in, a desk."""
    for _ in range(3):
        yield kit.at_wall("shelf", under_window=False, place="corner")
    yield from reading_corner(kit)
    yield from kit.desk_with("straight_chair")
    yield kit.at_wall("shelf", under_window=False)
    yield kit.at_wall("grandfather_clock")
    yield middle_carpet(kit)
    yield kit.at_wall("shelf", under_window=False)
    yield kit.hang("painting", 1.4)
    yield kit.under_window("heater")
    yield kit.at_wall("pot_plant", place="corner")


def middle_carpet(kit: RoomKit) -> Placed | None:
    """A carpet on the free floor in the middle of a room."""
    x0, y0, x1, y1 = kit.rect
    cx, cy = (x0 + x1) / 2, (y0 + y1) / 2
    degrees = 90.0 if x1 - x0 > y1 - y0 else 0.0
    along, across = sorted((x1 - x0 - 1.0, y1 - y0 - 1.0))
    for dx, dy in (
        (0, 0),
        (0.3, 0),
        (-0.3, 0),
        (0, 0.3),
        (0, -0.3),
        (0.5, 0.5),
        (-0.5, 0.5),
        (0.5, -0.5),
        (-0.5, -0.5),
    ):
        carpet = kit.spread((cx + dx, cy + dy), degrees, (along, across))
        if carpet is not None:
            return carpet
    return None


def lobby(kit: RoomKit) -> Iterator[Placed | None]:
    """Coats, shoes, a mirror, a bench."""
    yield from entrance(kit)
    bench = kit.at_wall("bench", under_window=False)
    yield bench
    if bench is not None:
        yield kit.above(bench, "mirror", 0.95)
    yield middle_carpet(kit)
    yield kit.at_wall("console_table", under_window=False)
    yield kit.hang("painting", 1.4)
    yield kit.at_wall("pot_plant", place="corner")
    yield kit.hang("picture", 1.5)


def corridor(kit: RoomKit) -> Iterator[Placed | None]:
    """A narrow table with a mirror, pictures and a clock, carpets, plants, where the way stays free."""
    yield from entrance(kit)
    x0, y0, x1, y1 = kit.rect
    length, width = max(x1 - x0, y1 - y0), min(x1 - x0, y1 - y0)
    table = kit.at_wall("console_table", under_window=False)
    yield table
    count = max(1, int(length / RUNNER_EVERY))
    for k in range(count):
        share = (k + 0.5) / count
        if x1 - x0 > y1 - y0:
            spot, degrees = (x0 + share * (x1 - x0), (y0 + y1) / 2), 90.0
        else:
            spot, degrees = ((x0 + x1) / 2, y0 + share * (y1 - y0)), 0.0
        yield kit.spread(spot, degrees, (min(RUNNER[0], width - 0.3), RUNNER[1]))
        yield kit.hang("painting" if k % 2 else "picture", 1.45)
    if table is not None:
        yield kit.above(table, "mirror", 1.05)
    yield kit.at_wall("pot_plant", place="corner")
    yield kit.at_wall("shelf", under_window=False)
    yield kit.hang("wall_clock", 1.9)
    yield kit.at_wall("bench", under_window=False)
    yield kit.hang("picture", 1.5)
    yield kit.at_wall("pot_plant", place="corner")


def balcony(kit: RoomKit) -> Iterator[Placed | None]:
    """A small table, chairs that fold, plants."""
    table = kit.at_wall("pedestal_table", place="middle")
    yield table
    if table is not None:
        for side in (90.0, 270.0, 0.0):
            yield kit.before(table, "folding_chair", 0.02, side=side)
    else:
        yield kit.at_wall("folding_chair", place="corner")
    for _ in range(3):
        yield kit.at_wall("pot_plant", place="corner")


def staircase(kit: RoomKit) -> Iterator[Placed | None]:
    """Something at the foot of the stairs."""
    yield kit.hang("picture", 1.5)
    yield kit.at_wall("pot_plant", place="corner")
    yield kit.at_wall("console_table", under_window=False)
    yield from shoes(kit)
    yield kit.hang("painting", 1.4)
