"""A whole home: the rooms furnished turn by turn, then filled with small objects up to the wanted number."""

from __future__ import annotations

import itertools
import random
from collections.abc import Callable, Iterator, Mapping, Sequence

from ..plans.plan import Plan, Room
from . import kitchen, living, sleeping, working
from .clutter import fill
from .kit import RoomKit
from .kitchen import with_doors
from .placed import Placed
from .room import ROOMY, HomeInProgress
from .start import lay_doormat, start_home

Rule = Callable[[RoomKit], Iterator[Placed | None]]

RULES: dict[str, Rule] = {
    "balcony": living.balcony,
    "bathroom": sleeping.bathroom,
    "bedroom": sleeping.bedroom,
    "childs_room": sleeping.childs_room,
    "closet": sleeping.closet,
    "corridor": living.corridor,
    "dining_room": kitchen.dining_room,
    "exercise_room": working.exercise_room,
    "garage": working.garage,
    "home_office": working.home_office,
    "kitchen": kitchen.kitchen,
    "library": living.library,
    "living_room": living.living_room,
    "lobby": living.lobby,
    "pantry_room": kitchen.pantry_room,
    "playroom": sleeping.playroom,
    "staircase": living.staircase,
    "storage_room": working.storage_room,
    "television_room": living.television_room,
    "utility_room": kitchen.utility_room,
}
"""Room kind -> a generator that gives after each object it put (or None where there was no room for one)."""

FURNITURE_SHARE = 0.64
"""Of the objects that are neither doors nor windows: furniture comes first, small objects take what is left."""
SMALL_SHARE = 0.8
"""The same in homes of less than ROOMY objects: a kitchen without a stove is none."""


def furnish_home(
    plan: Plan, objects: int, seed: int = 0, pieces: Mapping[str, Sequence[str]] | None = None
) -> HomeInProgress:
    """Furnishes a plan.

    Args:
      objects: how many objects in all, doors and windows included; fewer where nothing more fits.
      pieces: room kind -> furniture in addition to that of the room kind.
    """
    home = start_home(plan, random.Random(f"{seed}/{plan.name}/things"), seed=seed, limit=objects)
    openings = len(home.things.things)
    if home.roomy:
        lay_doormat(home)
    share = FURNITURE_SHARE if home.roomy else SMALL_SHARE
    limit = openings + round(share * (objects - openings))
    rooms = sorted(plan.rooms, key=lambda room: ORDER.get(room.kind, 2))
    running = [(room, _rule(home, room, pieces or {})) for room in rooms]
    turn = 0
    while running and len(home.things.things) < limit:
        for room, rule in list(running):
            if len(home.things.things) >= limit:
                break
            if turn >= START.get(room.kind, 0) and not any([_advance(rule) for _ in range(_steps(room, objects))]):
                running.remove((room, rule))
        turn += 1
    small = fill(home)
    while not home.full and next(small, None) is not None:
        pass
    return home


FIRST = {"kitchen": 8, "bedroom": 1, "living_room": 2, "utility_room": 3}
"""Pieces that a room of this kind gets by its rule before its extra ones; others: 0."""


def _rule(home: HomeInProgress, room: Room, pieces: Mapping[str, Sequence[str]]) -> Iterator[Placed | None]:
    kit = RoomKit(home, room)
    rule = RULES[room.kind](kit)
    yield from itertools.islice(rule, FIRST.get(room.kind, 0))
    for category in pieces.get(room.kind, ()):
        if category == "breakfast_table":
            yield from kitchen.table_with_chairs(kit, category, 1)
        else:
            index = home.index(category, with_doors) if category == "sink" else None
            yield kit.at_wall(
                category, index=index, place="corner", room_before=kitchen.BEFORE, under_window=False
            ) or kit.at_wall(category, index=index, room_before=kitchen.BEFORE)
    yield from rule


ORDER = {"kitchen": 0, "living_room": 1, "bathroom": 1, "bedroom": 1, "corridor": 4}
"""Rooms of these kinds get their pieces first in a turn."""
START = {"corridor": 1, "lobby": 1, "balcony": 2, "staircase": 2}
"""Turn in which a room of this kind gets its first piece; others: 0."""
PLAIN = ("balcony", "bathroom", "closet", "corridor", "garage", "lobby", "pantry_room", "staircase", "storage_room",
         "utility_room")  # fmt: skip
"""Rooms that get one piece in a turn; others two, or more by their area."""
PIECE_AREA = 6.0  # m2 for each


def _steps(room: Room, objects: int) -> int:
    """Pieces that a room gets in a turn."""
    if objects < ROOMY:
        return 1
    return 1 if room.kind in PLAIN else min(3, max(2, round(room.area / PIECE_AREA)))


def _advance(rule: Iterator[Placed | None]) -> bool:
    """Lets a rule go on until it has put one object; False when it is through."""
    return any(thing is not None for thing in rule)
