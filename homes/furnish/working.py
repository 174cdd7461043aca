"""Home offices, garages, storage and exercise rooms."""

from __future__ import annotations

from collections.abc import Iterator

from ..things import Thing
from .kit import RoomKit


def home_office(kit: RoomKit) -> Iterator[Thing | None]:
    """A desk with a monitor and a keyboard, a swivel chair before it, shelves, a printer."""
    desk = kit.at_wall("desk", room_before=0.75)
    yield desk
    if desk is not None:
        yield kit.before(desk, "swivel_chair", -0.1)
        yield kit.on(desk, "monitor", at=(-0.22 * float(desk.size[0]), 0.0), degrees=0, highest=True)
        yield kit.on(desk, "keyboard", at=(0.15 * float(desk.size[0]), 0.0), degrees=0, highest=True)
        yield kit.on(desk, "mouse", at=(0.17 * float(desk.size[0]), -0.3), degrees=0, highest=True)
    yield kit.at_wall("shelf", under_window=False, place="corner")
    table = kit.at_wall("console_table", under_window=False)
    yield table
    if table is not None:
        yield kit.on(table, "printer", degrees=0)
    yield kit.at_wall("bulletin_board", height=1.2)
    yield kit.at_wall("shelf", under_window=False)
    yield kit.at_wall("trash_can", place="corner")
    yield kit.at_wall("pot_plant", place="corner")
    yield kit.at_wall("armchair", place="corner")


def garage(kit: RoomKit) -> Iterator[Thing | None]:
    """A car where it fits, shelves with tools, a ladder, boxes."""
    x0, y0, x1, y1 = kit.rect
    for degrees in (90.0, 0.0):
        long_enough = (y1 - y0 if degrees == 90.0 else x1 - x0) > 4.0
        car = kit.at("car", (x0 + 1.05, (y0 + y1) / 2 + 0.1), degrees) if long_enough else None
        if car is not None:
            yield car
            break
    yield kit.at_wall("shelf", place="corner")
    yield kit.at_wall("ladder", place="corner")
    yield kit.at_wall("carton", place="corner")
    yield kit.at_wall("pegboard", height=1.1)
    yield kit.at_wall("lawn_mower", place="corner")
    yield kit.at_wall("carton")
    yield kit.at_wall("bucket")


def storage_room(kit: RoomKit) -> Iterator[Thing | None]:
    """Shelves, boxes, cleaning things."""
    for _ in range(2):
        yield kit.at_wall("shelf", place="corner")
    for category in ("carton", "vacuum", "carton", "bucket", "ladder", "basket"):
        yield kit.at_wall(category, place="corner")


def exercise_room(kit: RoomKit) -> Iterator[Thing | None]:
    """A treadmill, a bench, a mat, balls."""
    yield kit.at_wall("treadmill", place="corner", room_before=0.4)
    yield kit.at_wall("bench")
    yield kit.at_wall("mirror", height=0.8)
    yield kit.at_wall("mat", place="middle")
    yield kit.at_wall("shelf", under_window=False, place="corner")
    yield kit.at_wall("duffel_bag")
    yield kit.at_wall("loudspeaker", place="corner")
