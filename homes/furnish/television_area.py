"""A television and the sofa that looks at it: chosen together, so that neither ever stands without the other."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator

import numpy as np

from .kit import RoomKit
from .placed import Placed
from .room import SIDES

OPPOSITE = {"south": "north", "north": "south", "east": "west", "west": "east"}
NEAREST, FARTHEST = 1.4, 3.4
"""m of floor between a sofa's front and what the television stands on."""
ASIDE = 0.45
"""m by which the middle of the sofa may be off the middle of the television, sideways."""
FREE_STANDING = (2.2, 1.95, 2.45, 1.7, 2.7, 1.5, 3.0)
"""m: distances that are tried for a sofa that has no wall behind it."""
TV_HEIGHT = 0.95  # m, of a wall-mounted television's lower edge
ALONG_WALL = (0.5, 0.38, 0.62, 0.26, 0.74, 0.15, 0.85)
"""Shares of a wall's length where a television is tried."""
SIDE_PASSAGE = 0.06  # m of bare floor between furniture and the carpet's edge


@dataclasses.dataclass
class TelevisionArea:
    """What was put. table: what the television stands on, None where it hangs."""

    sofa: Placed
    television: Placed
    table: Placed | None

    @property
    def distance(self) -> float:
        """m of floor between sofa and television."""
        return floor_between(self.sofa, self.table or self.television)


def floor_between(sofa: Placed, other: Placed) -> float:
    """m between a sofa's front and the side of another object that is turned to it."""
    across = abs(float(sofa.front @ (other.centre - sofa.centre)[:2]))
    return across - (sofa.size[0] + other.size[0]) / 2


def aside(sofa: Placed, other: Placed) -> float:
    """m by which another object is off the line that a sofa looks along."""
    x, y = (other.centre - sofa.centre)[:2]
    return abs(float(sofa.front[0] * y - sofa.front[1] * x))


def place_television_area(kit: RoomKit) -> TelevisionArea | None:
    """Puts a television at a wall and a sofa that faces it: with its back to the wall opposite where that is at a
    good distance, else free in the room."""
    start = kit.home.now()
    sides = sorted(kit.shuffled(list(SIDES)), key=lambda side: not 2.8 < _depth(kit, side) < 5.0)
    for free_standing in (False, True):
        for side in sides:
            for share in ALONG_WALL:
                put = _television(kit, side, share)
                if put is not None:
                    table, television = put
                    sofa = (_freely if free_standing else _at_the_wall)(kit, side, table or television)
                    if sofa is not None:
                        return TelevisionArea(sofa, television, table)
                kit.home.back_to(start)
    return None


def _television(kit: RoomKit, side: str, share: float) -> tuple[Placed | None, Placed] | None:
    x0, y0, x1, y1 = kit.rect
    near = (x0 + share * (x1 - x0), y0 + share * (y1 - y0))
    table = kit.at_wall("console_table", side=side, near=near, under_window=False, most=3)
    if table is not None:
        television = kit.on(table, "standing_tv", at="middle", degrees=0)
        if television is not None:
            return table, television
    television = kit.at_wall("wall_mounted_tv", side=side, near=near, height=TV_HEIGHT, most=3)
    return None if television is None else (table, television)


def _at_the_wall(kit: RoomKit, side: str, screen: Placed) -> Placed | None:
    near = (float(screen.centre[0]), float(screen.centre[1]))
    sofa = kit.at_wall("sofa", side=OPPOSITE[side], near=near, most=16)
    if sofa is None or aside(sofa, screen) > ASIDE or not NEAREST < floor_between(sofa, screen) < FARTHEST:
        return None
    return sofa


def _freely(kit: RoomKit, side: str, screen: Placed) -> Placed | None:
    index = kit.home.index("sofa")
    for along in (0.0, 0.2, -0.2, 0.4, -0.4):
        for distance in FREE_STANDING:
            sofa = kit.before(screen, "sofa", distance, index=index, along=along, ways=True)
            if sofa is not None:
                return sofa
    return None


def _depth(kit: RoomKit, side: str) -> float:
    x0, y0, x1, y1 = kit.rect
    return (y1 - y0) if side in ("south", "north") else (x1 - x0)


def seats_around(
    kit: RoomKit, place: TelevisionArea, armchairs: int = 2, carpet: bool = True
) -> Iterator[Placed | None]:
    """A carpet before the sofa, the coffee table on it, a lamp and a side table at the sofa's ends, armchairs at the
    coffee table's ends. carpet: False leaves it out."""
    sofa = place.sofa
    index = kit.home.index("coffee_table")
    depth = float(kit.shape("coffee_table", index).size[0])
    reach = place.distance - 2 * SIDE_PASSAGE
    middle = sofa.size[0] / 2 + SIDE_PASSAGE + min(reach, max(1.4, depth + 0.5)) / 2
    spot = sofa.centre[:2] + sofa.front * middle
    degrees = float(np.degrees(np.arctan2(sofa.front[1], sofa.front[0])))
    rug = None
    if carpet:
        rug = kit.spread((float(spot[0]), float(spot[1])), degrees, (reach, float(sofa.size[1]) + 0.6))
        yield rug
    gap = 0.36 if rug is None else max(0.3, middle - (sofa.size[0] + depth) / 2 - 0.1)
    table = kit.before(sofa, "coffee_table", float(gap), index=index, carpet=rug)
    table = table or kit.before(sofa, "coffee_table", 0.36, index=index)
    yield table
    yield kit.beside(sofa, "floor_lamp", -1) or kit.beside(sofa, "floor_lamp", 1)
    yield kit.beside(sofa, "stand", 1) or kit.beside(sofa, "stand", -1)
    if table is None:
        return
    beyond = 0.35 if rug is None else (rug.size[0] - table.size[1]) / 2 + 0.03
    index = kit.home.index("armchair")
    for _ in range(armchairs):
        yield next(
            (
                chair
                for side in (90.0, 270.0)
                for distance in (0.35, float(beyond), float(beyond) + 0.2)
                if (chair := kit.before(table, "armchair", distance, index=index, side=side)) is not None
            ),
            None,
        )
