"""Living and television rooms, libraries, lobbies: sofas that face the television, shelves, plants, pictures."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..things import Thing
from .kit import SIDES, RoomKit

OPPOSITE = {"south": "north", "north": "south", "east": "west", "west": "east"}
TV_HEIGHT = 0.95  # m, of a wall-mounted television's lower edge


def living_room(kit: RoomKit) -> Iterator[Thing | None]:
    """A television at one wall, the sofa opposite, the coffee table between them."""
    sofa, television = yield from _sofa_and_television(kit)
    if sofa is not None:
        table = kit.before(sofa, "coffee_table", 0.38)
        yield table
        for which in (1, -1):
            yield kit.beside(sofa, "stand", which) if which > 0 else kit.beside(sofa, "floor_lamp", which)
        if table is not None:
            yield kit.before(table, "armchair", 0.35, side=90.0) or kit.before(table, "armchair", 0.35, side=270.0)
    yield kit.at_wall("shelf", under_window=False)
    yield kit.at_wall("painting", height=1.4)
    yield kit.at_wall("pot_plant", place="corner")
    yield kit.at_wall("shelf", under_window=False, place="corner")
    yield kit.at_wall("painting", height=1.45)
    if television is not None:
        yield kit.beside(television, "loudspeaker", 1, gap=0.1)
    yield kit.at_wall("console_table", under_window=False)
    yield kit.at_wall("armchair", place="corner")


def _sofa_and_television(kit: RoomKit):
    """Tries walls until the television finds a place at one and the sofa at the one opposite; gives (sofa, what the
    television stands on)."""
    sides = list(SIDES)
    kit.rng.shuffle(sides)
    television = table = sofa = None
    for side in sorted(sides, key=lambda s: not 2.6 < _distance(kit, s) < 4.8):
        if not kit.wall_spans(side) or not kit.wall_spans(OPPOSITE[side]):
            continue
        if television is None:
            table = kit.at_wall("console_table", side=side, place="middle", under_window=False)
            if table is not None:
                yield table
                television = kit.on(table, "standing_tv", at="middle", degrees=0)
            television = television or kit.at_wall("wall_mounted_tv", side=side, place="middle", height=TV_HEIGHT)
            if television is None:
                continue
            yield television
        near = (float(television.centre[0]), float(television.centre[1]))
        sofa = kit.at_wall("sofa", side=OPPOSITE[side], near=near)
        if sofa is not None:
            yield sofa
            return sofa, table
    if television is None:  # no two walls face each other: an open plan
        television = kit.at_wall("wall_mounted_tv", place="middle", height=TV_HEIGHT)
        yield television
    if television is not None:
        for distance in (2.4, 2.0, 1.6, 1.3):
            sofa = sofa or kit.before(television, "sofa", distance, ways=True)
    sofa = sofa or kit.at_wall("sofa", place="middle") or kit.at_wall("armchair", place="corner")
    yield sofa
    return sofa, table


def _distance(kit: RoomKit, side: str) -> float:
    x0, y0, x1, y1 = kit.rect
    return (y1 - y0) if side in ("south", "north") else (x1 - x0)


def television_room(kit: RoomKit) -> Iterator[Thing | None]:
    """As a living room, with less in it."""
    sofa, _ = yield from _sofa_and_television(kit)
    if sofa is not None:
        yield kit.before(sofa, "coffee_table", 0.38)
    yield kit.at_wall("speaker_system", under_window=False)
    yield kit.at_wall("pot_plant", place="corner")
    yield kit.at_wall("picture", height=1.5)


def library(kit: RoomKit) -> Iterator[Thing | None]:
    """Bookshelves all around, an armchair, a globe's place taken by a plant."""
    for _ in range(4):
        yield kit.at_wall("shelf", under_window=False, place="corner")
    chair = kit.at_wall("armchair", place="corner")
    yield chair
    if chair is not None:
        yield kit.beside(chair, "floor_lamp", 1) or kit.beside(chair, "floor_lamp", -1)
        yield kit.before(chair, "stool", 0.1)
    yield kit.at_wall("desk", room_before=0.6)
    yield kit.at_wall("grandfather_clock")


def lobby(kit: RoomKit) -> Iterator[Thing | None]:
    """Coats, shoes, a mirror, a bench."""
    yield kit.at_wall("coatrack", place="corner")
    bench = kit.at_wall("bench", under_window=False)
    yield bench
    if bench is not None:
        yield kit.above(bench, "mirror", 1.0)
    for _ in range(2):
        yield kit.at_wall("gym_shoe")
    yield kit.at_wall("mat", place="middle")
    yield kit.at_wall("umbrella", place="corner")
    yield kit.at_wall("picture", height=1.5)


def corridor(kit: RoomKit) -> Iterator[Thing | None]:
    """Pictures and a clock on the walls, a stool where the way stays free."""
    yield kit.at_wall("picture", height=1.5)
    yield kit.at_wall("wall_clock", height=1.9)
    yield kit.at_wall("stool", place="corner")
    yield kit.at_wall("picture", height=1.5)


def balcony(kit: RoomKit) -> Iterator[Thing | None]:
    """Plants, a folding chair."""
    yield kit.at_wall("pot_plant", place="corner")
    yield kit.at_wall("folding_chair", place="corner")
    yield kit.at_wall("pot_plant", place="corner")


def staircase(kit: RoomKit) -> Iterator[Thing | None]:
    """Something at the foot of the stairs."""
    yield kit.at_wall("picture", height=1.5)
    yield kit.at_wall("pot_plant", place="corner")
    yield kit.at_wall("stool", place="corner")


def carpet_before(kit: RoomKit, thing: Thing, distance: float = 0.05) -> Thing | None:
    """A mat on the free floor before something."""
    front = np.round(thing.front)
    return kit.before(thing, "mat", distance, turn=180.0 if front.any() else 0.0)
