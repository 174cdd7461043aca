"""Home offices, garages, storage and exercise rooms."""

from __future__ import annotations

from collections.abc import Iterator

from .kit import RoomKit
from .kitchen import in_the_middle
from .living import middle_carpet, shoes
from .placed import Placed


def home_office(kit: RoomKit) -> Iterator[Placed | None]:
    """A desk with a monitor and a keyboard, a swivel chair before it, shelves, a printer."""
    workplace = kit.desk_with("swivel_chair")
    yield from workplace
    if workplace:
        desk = workplace[0]
        yield kit.on(desk, "monitor", at=(-0.22 * float(desk.size[0]), 0.0), degrees=0, highest=True)
        yield kit.on(desk, "keyboard", at=(0.15 * float(desk.size[0]), 0.0), degrees=0, highest=True)
        yield kit.on(desk, "mouse", at=(0.17 * float(desk.size[0]), -0.3), degrees=0, highest=True)
    yield kit.at_wall("shelf", under_window=False, place="corner")
    table = kit.at_wall("console_table", under_window=False)
    yield table
    if table is not None:
        yield kit.on(table, "printer", degrees=0)
    yield kit.hang("bulletin_board", 1.2)
    yield kit.at_wall("shelf", under_window=False)
    yield middle_carpet(kit)
    yield kit.at_wall("trash_can", place="corner")
    yield kit.under_window("heater")
    yield kit.at_wall("pot_plant", place="corner")
    yield kit.at_wall("armchair", place="corner")
    yield kit.hang("painting", 1.4)
    yield kit.at_wall("briefcase", place="corner")


LONG_GARAGE = 5.8  # m
TO_END = (1.2, -1.2, 1.1, -1.1, 1.0, -1.0, 0.9, -0.9)  # m, of the car from the middle of a long garage


def garage(kit: RoomKit) -> Iterator[Placed | None]:
    """A car where it fits, shelves with tools, a ladder, boxes."""
    yield _car(kit)
    yield kit.at_wall("shelf", place="corner")
    yield kit.at_wall("ladder", place="corner")
    yield kit.at_wall("carton", place="corner")
    yield kit.at_wall("pegboard", height=1.1)
    yield kit.at_wall("lawn_mower", place="corner")
    yield kit.at_wall("shelf", place="corner")
    yield kit.at_wall("carton", place="corner")
    yield kit.at_wall("bucket", place="corner")
    yield kit.at_wall("hose", place="corner")


def _car(kit: RoomKit) -> Placed | None:
    """A car along the room's long side, where its doors can open; in a long garage at one end of it."""
    x0, y0, x1, y1 = kit.rect
    cx, cy = (x0 + x1) / 2, (y0 + y1) / 2
    along_y = y1 - y0 > x1 - x0
    to_end = TO_END if max(x1 - x0, y1 - y0) >= LONG_GARAGE else ()
    for index in range(kit.home.models):
        for aside in (0.0, 0.1, -0.1, 0.2, -0.2, 0.3, -0.3):
            for shift in (*to_end, 0.0, 0.2, -0.2, 0.3, -0.3):
                spot = (cx + aside, cy + shift) if along_y else (cx + shift, cy + aside)
                car = kit.at("car", spot, 90.0 if along_y else 0.0, index=index)
                if car is not None:
                    return car
    return None


def storage_room(kit: RoomKit) -> Iterator[Placed | None]:
    """Shelves, boxes, cleaning objects."""
    for _ in range(2):
        yield kit.at_wall("shelf", place="corner")
    for category in ("carton", "vacuum", "carton", "bucket", "ladder", "basket"):
        yield kit.at_wall(category, place="corner")


def exercise_room(kit: RoomKit) -> Iterator[Placed | None]:
    """A treadmill, a bench, a mat, balls."""
    yield kit.at_wall("treadmill", place="corner", room_before=0.4)
    yield in_the_middle(kit, "mat", 0.2)
    yield kit.hang("mirror", 0.6)
    yield kit.at_wall("bench", under_window=False)
    yield kit.at_wall("shelf", under_window=False, place="corner")
    yield kit.at_wall("ball", place="corner")
    yield kit.at_wall("duffel_bag", place="corner")
    yield kit.at_wall("loudspeaker", place="corner")
    yield kit.under_window("heater")
    yield kit.hang("wall_clock", 1.8)
    yield from shoes(kit)
