"""The placing of furniture in one room: against a wall, next to something, before it, on a carpet.

A method gives the object it put, or None where there was no room for it; it never makes two overlap, never blocks
a way or what opens, and draws every choice from the home's random generator.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..objects.catalogue import find
from .arrangement import AIR, FLAT
from .loose import LooseKit
from .placed import Placed, yaw
from .room import SIDES, HomeInProgress, degrees_of

__all__ = ["SIDES", "HomeInProgress", "RoomKit"]

WALL_GAP = 0.006  # m, between a wall and what stands at it
NEIGHBOUR_GAP = 0.012  # m, between pieces of furniture side by side
STEP = 0.05  # m, between places that are tried along a wall
FLAT_ON_WALL = 0.004  # m, air behind a picture
BARE_WALL = 0.18  # m, around a picture
SMALLEST_CARPET = 0.5  # of its full size
DEGREES = {"south": 90, "east": 180, "north": 270, "west": 0}
"""Side of a room -> yaw of something whose back is to it."""


class RoomKit(LooseKit):
    """Furnishes one room."""

    def at_wall(
        self,
        category: str,
        *,
        side: str | Sequence[str] | None = None,
        near: tuple[float, float] | None = None,
        at: float | None = None,
        place: str = "any",
        index: int | None = None,
        height: float = 0.0,
        room_before: float = 0.0,
        gap: float | None = None,
        wall_gap: float = WALL_GAP,
        fixed: bool | None = None,
        under_window: bool = True,
        most: int | None = None,
    ) -> Placed | None:
        """Stands (or hangs) something with its back to a wall.

        Args:
          side: "south", "east", ... or several to be tried in that order; None: all, in random order.
          near: x, y that it shall be close to; at: x or y of its middle, exactly; otherwise place: "corner", "middle"
            or "any".
          height: of its lower edge above the floor. room_before: metres of floor kept free before it.
          gap, wall_gap: metres of air to other furniture (default: little, none for what hangs), and behind it.
          under_window: False for what may not stand before a window even where it is lower.
          most: places that are tried; None: all.
        """
        index = self.home.index(category) if index is None else index
        gap = (0.0 if height else NEIGHBOUR_GAP) if gap is None else gap
        sides = [side] if isinstance(side, str) else list(side or self.shuffled(list(SIDES)))
        form = self.shape(category, index)
        for name in sides:
            for spot in [at] if at is not None else self._along(name, form.size[1], place, near)[:most]:
                turn = yaw(DEGREES[name])
                back = wall_gap if height == 0 else FLAT_ON_WALL
                position = self._against(name, spot, -form.low[0] + back, -(form.low[1] + form.high[1]) / 2, turn)
                position[2] = height - form.low[2] + (0 if (height or find(category).fixed) else AIR)
                thing = self.thing(category, index, position, turn, fixed)
                if window := self._before_window(thing, name, under_window):
                    self.problem = self.problem or f"stands before {window}"
                    continue
                if self._stand(thing, gap, room_before):
                    return thing
        return None

    def at(
        self,
        category: str,
        xy: tuple[float, float],
        degrees: float,
        *,
        index: int | None = None,
        room_before: float = 0.0,
        gap: float = NEIGHBOUR_GAP,
        fixed: bool | None = None,
        scale: float = 1.0,
        ways: bool = True,
        carpet: Placed | None = None,
    ) -> Placed | None:
        """Stands something with the middle of its box at a place, its front towards `degrees` about z.

        Args:
          ways: mind what is kept free before doors and cupboards. carpet: it stands on this one, wholly.
        """
        index = self.home.index(category) if index is None else index
        form, turn = self.shape(category, index), yaw(degrees)
        middle = turn @ ((form.low + form.high) / 2) * scale
        height = 0.0 if carpet is None else float(carpet.box()[1, 2])
        lift = height - form.low[2] * scale + (0 if find(category).fixed else AIR)
        position = np.array([xy[0] - middle[0], xy[1] - middle[1], lift])
        thing = self.thing(category, index, position, turn, fixed)
        thing.scale = scale
        if carpet is not None:
            thing.host = carpet.name
            (low, high), (least, most) = thing.box(), carpet.box()
            if np.any(low[:2] < least[:2]) or np.any(high[:2] > most[:2]):
                return None
        if not self._inside(thing):
            self.problem = self.problem or f"reaches beyond the walls of {self.room.name}"
            return None
        return thing if self._stand(thing, gap, room_before, ways) else None

    def spread(
        self, middle: tuple[float, float], degrees: float, most: tuple[float, float], category: str = "carpet"
    ) -> Placed | None:
        """Spreads a carpet with its middle at a place, its short side along `degrees`, as large as it may be.

        Args:
          most: metres along `degrees` and across that it may cover; None is given where it would be a mere rag.
        """
        index = self.home.index(category)
        long, short = sorted(self.shape(category, index).size[:2], reverse=True)
        largest = min(1.0, most[0] / short, most[1] / long)
        for scale in (largest, 0.9 * largest, 0.8 * largest):
            if scale > SMALLEST_CARPET:
                scale = round(float(scale), 2)
                thing = self.at(category, middle, degrees + 90, index=index, gap=0.0, scale=scale, ways=False)
                if thing is not None:
                    return thing
        return None

    def beside(self, anchor: Placed, category: str, which: int, *, index: int | None = None, gap: float = 0.03,
               room_before: float = 0.0) -> Placed | None:  # fmt: skip
        """Stands something at the left (+1) or right (-1) of another, backs in one line, fronts the same way."""
        index = self.home.index(category) if index is None else index
        form = self.shape(category, index)
        away = which * (anchor.size[1] / 2 + form.size[1] / 2 + gap)
        back = -anchor.size[0] / 2 + form.size[0] / 2
        spot = anchor.centre[:2] + anchor.rotation[:2, :2] @ np.array([back, away])
        return self.at(category, (float(spot[0]), float(spot[1])), degrees_of(anchor), index=index, gap=gap * 0.5,
                       room_before=room_before)  # fmt: skip

    def before(self, anchor: Placed, category: str, distance: float, *, index: int | None = None, along: float = 0.0,
               side: float = 0.0, turn: float = 180.0, gap: float = 0.005, carpet: Placed | None = None,
               ways: bool = False) -> Placed | None:  # fmt: skip
        """Stands something in front of another, `distance` metres between their boxes, looking back at it.

        Args:
          along: shifts it towards the anchor's left. side: degrees; 90 is at the anchor's left instead of its front.
          turn: its yaw relative to that side's outward direction. carpet, ways: see `at`.
        """
        index = self.home.index(category) if index is None else index
        size = self.shape(category, index).size
        depth = size[0] if turn % 180 == 0 else size[1]
        reach = anchor.size[0 if side % 180 == 0 else 1] / 2 + distance + depth / 2
        spot = anchor.centre[:2] + (anchor.rotation @ yaw(side))[:2, :2] @ np.array([reach, along])
        place = (float(spot[0]), float(spot[1]))
        return self.at(
            category, place, degrees_of(anchor) + side + turn, index=index, gap=gap, ways=ways, carpet=carpet
        )

    def desk_with(self, chair: str) -> list[Placed]:
        """Stands a desk at a wall and a chair before it; empty where there is no place for both."""
        start = self.home.now()
        for side in self.shuffled(list(SIDES)):
            for place in ("any", "middle", "corner"):
                desk = self.at_wall("desk", side=side, place=place, room_before=0.6)
                if desk is None:
                    continue
                seat = self._seat_at(desk, chair)
                if seat is not None:
                    return [desk, seat]
                self.home.back_to(start)
        return []

    def _seat_at(self, desk: Placed, category: str) -> Placed | None:
        """Stands a chair before a desk, as far under it as it goes."""
        index = self.home.index(category)
        for distance in (-0.15, -0.05, 0.04, 0.12):
            for along in (0.0, 0.15, -0.15, 0.3, -0.3):
                chair = self.before(desk, category, distance, index=index, along=along)
                if chair is not None:
                    return chair
        return None

    def under_window(self, category: str) -> Placed | None:
        """Stands something low below one of the room's windows."""
        for window in self.shuffled(self.openings("window")):
            x, y = (float(v) for v in window.edge.point(window.centre))
            thing = self.at_wall(category, side=self.side_of(window.edge), near=(x, y), most=5)
            if thing is not None:
                return thing
        return None

    def hang(self, category: str, height: float, near: tuple[float, float] | None = None) -> Placed | None:
        """Hangs something on a wall, its lower edge at `height` and with some bare wall around it."""
        return self.at_wall(category, height=height, gap=BARE_WALL, near=near)

    def above(self, anchor: Placed, category: str, height: float, *, index: int | None = None) -> Placed | None:
        """Hangs something on the wall behind another object, its lower edge at `height`."""
        index = self.home.index(category) if index is None else index
        side = next(name for name, way in SIDES.items() if np.allclose(way, anchor.front, atol=0.1))
        near = (float(anchor.centre[0]), float(anchor.centre[1]))
        size = self.shape(category, index).size
        for at in self._along(side, size[1], "any", near)[:3]:
            if abs(at - (near[0] if side in ("south", "north") else near[1])) < 0.1:
                return self.at_wall(category, side=side, near=near, index=index, height=height, gap=0.0, most=3)
        return None

    # --- the parts of it -------------------------------------------------------------------------------------------

    def _stand(self, thing: Placed, gap: float, room_before: float, ways: bool = True) -> bool:
        """Puts furniture where it is if all is well; then its name is set."""
        things = self.home.things
        if problem := things.obstacle(thing, gap=gap, ways=ways and thing.category not in FLAT):
            self.problem = self.problem or problem
            return False
        zone = None
        if room_before > 0:
            zone = self._zone(thing, room_before)
            low, high = zone
            inside = low[0] > self.rect[0] - 0.01 and low[1] > self.rect[1] - 0.01
            inside = inside and high[0] < self.rect[2] + 0.01 and high[1] < self.rect[3] + 0.01
            if not inside or not things.free(zone):
                self.problem = self.problem or f"has less than {room_before:g} m of free floor before it"
                return False
        if lost := self.home.ground.cut_off(thing):
            self.problem = self.problem or f"leaves a robot no way to {lost}"
            return False
        thing.name = things.name(thing.category)
        things.put(thing)
        self.home.ground.occupy(thing)
        if zone is not None:
            things.keep_free(thing.name, zone[None])
        return True

    def _zone(self, thing: Placed, depth: float) -> np.ndarray:
        """[2, 3] box of floor before an object."""
        box = thing.box()
        front = thing.front
        zone = box.copy()
        zone[:, 2] = (0.02, 1.6)
        axis = int(abs(front[1]) > abs(front[0]))
        if front[axis] > 0:
            zone[:, axis] = (box[1, axis] + 0.002, box[1, axis] + depth)
        else:
            zone[:, axis] = (box[0, axis] - depth, box[0, axis] - 0.002)
        return zone

    def _inside(self, thing: Placed) -> bool:
        (low, high), (x0, y0, x1, y1) = thing.box(), self.rect
        return bool(low[0] >= x0 - 1e-6 and low[1] >= y0 - 1e-6 and high[0] <= x1 + 1e-6 and high[1] <= y1 + 1e-6)

    def _along(self, side: str, width: float, place: str, near) -> list[float]:
        """Places along a wall (world coordinate) to try for something so wide."""
        spans = self.wall_spans(side)
        spots: list[float] = []
        for low, high in spans:
            a, b = low + width / 2 + 0.002, high - width / 2 - 0.002
            if b < a:
                continue
            count = max(1, round((b - a) / STEP))
            spots += [a + (b - a) * k / count for k in range(count + 1)]
        if near is not None:
            target = near[0] if side in ("south", "north") else near[1]
            return sorted(spots, key=lambda v: abs(v - target))
        if place == "corner":
            ends = [v for span in spans for v in span]
            return sorted(spots, key=lambda v: min(abs(v - e) for e in ends))
        if place == "middle":
            return sorted(spots, key=lambda v: abs(v - sum(map(sum, spans)) / 2 / len(spans)))
        return self.shuffled(spots)

    def _against(self, side: str, at: float, depth: float, middle: float, turn: np.ndarray) -> np.ndarray:
        """Base position of something whose back is `depth` behind its base, at the wall."""
        x0, y0, x1, y1 = self.rect
        foot = {"south": (at, y0), "north": (at, y1), "west": (x0, at), "east": (x1, at)}[side]
        return np.array([*foot, 0.0]) + turn @ np.array([depth, middle, 0.0])

    def _before_window(self, thing: Placed, side: str, allowed: bool) -> str:
        """The window in whose light it stands, or ''."""
        low, high = thing.box()
        axis = "x" if side in ("south", "north") else "y"
        k = 0 if axis == "x" else 1
        windows = [opening for opening in self.home.plan.openings if opening.kind == "window"]
        for number, opening in enumerate(windows):
            if self.room.name not in opening.edge.rooms or opening.edge.axis != axis:
                continue
            at_wall = abs(opening.edge.at - (low[1 - k] if side in ("south", "west") else high[1 - k])) < 0.3
            overlaps = low[k] < opening.high and high[k] > opening.low
            if at_wall and overlaps and (high[2] > opening.bottom + 0.02 or not allowed):
                return f"window_{number}"
        return ""
