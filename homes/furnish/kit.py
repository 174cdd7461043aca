"""The placing of things in one room: against a wall, beside something, on a surface, inside a cupboard.

A method gives the thing it put, or None where there was no room for it; it never makes two things overlap, never blocks
a way or what opens, and draws every choice from the home's random generator.
"""

from __future__ import annotations

import dataclasses
import random
from collections.abc import Iterable, Sequence

import numpy as np

from ..arrangement import AIR, Arrangement
from ..catalogue import find
from ..floor_plans.plan import Plan, Rect, Room
from ..surfaces import Surface, insides, tops
from ..things import Shape, Thing, lying, shape, yaw
from .ground import Ground

WALL_GAP = 0.006  # m, between a wall and what stands at it
NEIGHBOUR_GAP = 0.012  # m, between pieces of furniture side by side
STEP = 0.05  # m, between places that are tried along a wall
MOST_POSES = 8  # stable orientations of a model at most (poses.MOST)
FLAT_ON_WALL = 0.004  # m, air behind a picture
SIDES = {"south": (0, 1), "east": (-1, 0), "north": (0, -1), "west": (1, 0)}
"""Side of a room -> the direction into the room."""
DEGREES = {"south": 90, "east": 180, "north": 270, "west": 0}
"""Side of a room -> yaw of something whose back is to it."""


@dataclasses.dataclass
class HomeInProgress:
    """What all rooms of a home share.

    Attributes:
      models, small_models: at most so many models of a category are used, of fixed and of loose things.
      limit: no more things than that. seed: of the models.
    """

    plan: Plan
    things: Arrangement
    ground: Ground
    rng: random.Random
    models: int = 3
    small_models: int = 2
    limit: int | None = None
    seed: int = 0

    @property
    def full(self) -> bool:
        """No more things are wanted."""
        return self.limit is not None and len(self.things.things) >= self.limit

    def index(self, category: str) -> int:
        """A model number."""
        entry = find(category)
        return self.rng.randrange(min(entry.count, self.models if entry.fixed else self.small_models))


class RoomKit:
    """One room being furnished."""

    def __init__(self, home: HomeInProgress, room: Room):
        self.home, self.room = home, room
        self.rect: Rect = home.plan.inside(room)
        self.rng = home.rng

    # --- furniture ------------------------------------------------------------------------------------------------

    def at_wall(
        self,
        category: str,
        *,
        side: str | Sequence[str] | None = None,
        near: tuple[float, float] | None = None,
        place: str = "any",
        index: int | None = None,
        height: float = 0.0,
        room_before: float = 0.0,
        gap: float = NEIGHBOUR_GAP,
        wall_gap: float = WALL_GAP,
        fixed: bool | None = None,
        under_window: bool = True,
        most: int | None = None,
    ) -> Thing | None:
        """Stands (or hangs) something with its back to a wall.

        Args:
          side: "south", "east", ... or several to be tried in that order; None: all, in random order.
          near: x, y that it shall be close to; otherwise place: "corner", "middle" or "any".
          height: of its lower edge above the floor. room_before: metres of floor kept free before it.
          gap, wall_gap: metres of air to other furniture, and behind it.
          under_window: False for what may not stand before a window even where it is lower.
          most: places that are tried; None: all.
        """
        index = self.home.index(category) if index is None else index
        sides = [side] if isinstance(side, str) else list(side or self._shuffled(list(SIDES)))
        form = self._shape(category, index)
        for name in sides:
            for at in self._along(name, form.size[1], place, near)[:most]:
                turn = yaw(DEGREES[name])
                back = wall_gap if height == 0 else FLAT_ON_WALL
                position = self._against(name, at, -form.low[0] + back, -(form.low[1] + form.high[1]) / 2, turn)
                position[2] = height - form.low[2] + (0 if (height or find(category).fixed) else AIR)
                thing = self._thing(category, index, position, turn, fixed)
                if self._before_window(thing, name, under_window):
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
        height: float = 0.0,
        ways: bool = True,
    ) -> Thing | None:
        """Stands something with the middle of its box at a place, its front towards `degrees` about z."""
        index = self.home.index(category) if index is None else index
        form, turn = self._shape(category, index), yaw(degrees)
        middle = turn @ ((form.low + form.high) / 2)
        lift = height - form.low[2] + (0 if find(category).fixed else AIR)
        position = np.array([xy[0] - middle[0], xy[1] - middle[1], lift])
        thing = self._thing(category, index, position, turn, fixed)
        return thing if self._inside(thing) and self._stand(thing, gap, room_before, ways) else None

    def beside(self, anchor: Thing, category: str, which: int, *, index: int | None = None, gap: float = 0.03,
               height: float = 0.0, room_before: float = 0.0) -> Thing | None:  # fmt: skip
        """Stands something at the left (+1) or right (-1) of another, backs in one line, fronts the same way."""
        index = self.home.index(category) if index is None else index
        form = self._shape(category, index)
        away = which * (anchor.size[1] / 2 + form.size[1] / 2 + gap)
        back = -anchor.size[0] / 2 + form.size[0] / 2
        spot = anchor.centre[:2] + anchor.rotation[:2, :2] @ np.array([back, away])
        return self.at(category, (float(spot[0]), float(spot[1])), _degrees(anchor), index=index, gap=gap * 0.5,
                       height=height, room_before=room_before)  # fmt: skip

    def before(self, anchor: Thing, category: str, distance: float, *, index: int | None = None, along: float = 0.0,
               side: float = 0.0, turn: float = 180.0, gap: float = 0.005,
               ways: bool = False) -> Thing | None:  # fmt: skip
        """Stands something in front of another, `distance` metres between their boxes, looking back at it.

        Args:
          along: shifts it towards the anchor's left. side: degrees; 90 is at the anchor's left instead of its front.
          turn: its yaw relative to that side's outward direction.
        """
        index = self.home.index(category) if index is None else index
        size = self._shape(category, index).size
        depth = size[0] if turn % 180 == 0 else size[1]
        reach = anchor.size[0 if side % 180 == 0 else 1] / 2 + distance + depth / 2
        spot = anchor.centre[:2] + (anchor.rotation @ yaw(side))[:2, :2] @ np.array([reach, along])
        place = (float(spot[0]), float(spot[1]))
        return self.at(category, place, _degrees(anchor) + side + turn, index=index, gap=gap, ways=ways)

    def above(self, anchor: Thing, category: str, height: float, *, index: int | None = None) -> Thing | None:
        """Hangs something on the wall behind another thing, its lower edge at `height`."""
        index = self.home.index(category) if index is None else index
        side = next(name for name, way in SIDES.items() if np.allclose(way, anchor.front, atol=0.1))
        near = (float(anchor.centre[0]), float(anchor.centre[1]))
        size = self._shape(category, index).size
        for at in self._along(side, size[1], "any", near)[:3]:
            if abs(at - (near[0] if side in ("south", "north") else near[1])) < 0.1:
                return self.at_wall(category, side=side, near=near, index=index, height=height, gap=0.0, most=3)
        return None

    # --- small things ----------------------------------------------------------------------------------------------

    def on(self, host: Thing, category: str, *, index: int | None = None, at: tuple[float, float] | str | None = None,
           degrees: float | None = None, scale: float = 1.0, tries: int = 24, surface: Surface | None = None,
           highest: bool = False, stand: int | None = None) -> Thing | None:  # fmt: skip
        """Puts something on top of another.

        Args:
          at: x, y in the host's frame, or "middle" of the surface; None: anywhere it fits.
          degrees: its yaw against the host's front; None: any.
          surface: which; default: one of the host's tops, the largest first. highest: the highest first.
          stand: number of its stable orientation; default: as built where it is stable so.
        """
        index = self.home.index(category) if index is None else index
        found = [surface] if surface else tops(host.category, host.index, host.seed)
        if highest:
            found = sorted(found, key=lambda s: -s.z)
        return self._put(host, category, index, found[:4], at, degrees, scale, tries, stand)

    def inside(self, host: Thing, category: str, *, index: int | None = None, degrees: float | None = None,
               scale: float = 1.0, tries: int = 24, surface: Surface | None = None,
               stand: int | None = None) -> Thing | None:  # fmt: skip
        """Puts something into a cupboard, a fridge, a drawer, on a shelf: under something of the same object."""
        index = self.home.index(category) if index is None else index
        found = [surface] if surface else self._shuffled(list(insides(host.category, host.index, host.seed)))
        return self._put(host, category, index, found[:6], None, degrees, scale, tries, stand)

    def _put(self, host, category, index, found: Iterable[Surface], at, degrees, scale, tries, stand) -> Thing | None:
        for surface in found:
            for _ in range(1 if at is not None and degrees is not None else tries):
                angle = self.rng.uniform(-180, 180) if degrees is None else degrees
                turn = host.rotation @ yaw(angle) @ resting(category, index, stand, self.home.seed)
                x0, y0, x1, y1 = (v * host.scale for v in surface.rect)
                if isinstance(at, str):
                    x, y = (x0 + x1) / 2, (y0 + y1) / 2
                else:
                    x, y = at if at is not None else (self.rng.uniform(x0, x1), self.rng.uniform(y0, y1))
                thing = self._thing(category, index, np.zeros(3), turn, None)
                thing.scale, thing.host = scale, host.name
                local = thing.box()
                spot = host.world(np.array([x, y, surface.z * host.scale]) / host.scale)
                middle = local.mean(0)
                thing.position = np.array([spot[0] - middle[0], spot[1] - middle[1], spot[2] + AIR - local[0, 2]])
                if at is None and not _within(thing, host, surface):
                    continue
                if surface.inside and local[1, 2] - local[0, 2] > surface.room - 0.004:
                    break
                if self.home.things.fits(thing, ignore=(host.name, host.host or ""), ways=False):
                    thing.name = self.home.things.name(category)
                    return self.home.things.put(thing)
        return None

    # --- the parts of it -------------------------------------------------------------------------------------------

    def _thing(self, category, index, position, turn, fixed) -> Thing:
        fixed = find(category).fixed if fixed is None else fixed
        rooms, seed = (self.room.name,), self.home.seed
        return Thing(category, category, index, np.asarray(position, float), turn, fixed, rooms, seed=seed)

    def _shape(self, category: str, index: int) -> Shape:
        return shape(category, index, self.home.seed)

    def _stand(self, thing: Thing, gap: float, room_before: float, ways: bool = True) -> bool:
        """Puts furniture where it is if all is well; then its name is set."""
        things = self.home.things
        if not things.fits(thing, gap=gap if thing.position[2] < 0.05 else 0.0, ways=ways):
            return False
        zone = None
        if room_before > 0:
            zone = self._zone(thing, room_before)
            low, high = zone
            inside = low[0] > self.rect[0] - 0.01 and low[1] > self.rect[1] - 0.01
            inside = inside and high[0] < self.rect[2] + 0.01 and high[1] < self.rect[3] + 0.01
            if not inside or not things.free(zone):
                return False
        if not self.home.ground.allows(thing):
            return False
        thing.name = things.name(thing.category)
        things.put(thing)
        self.home.ground.occupy(thing)
        if zone is not None:
            things.keep_free(thing.name, zone[None])
        return True

    def _zone(self, thing: Thing, depth: float) -> np.ndarray:
        """[2, 3] box of floor before a thing."""
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

    def _inside(self, thing: Thing) -> bool:
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
        return self._shuffled(spots)

    def wall_spans(self, side: str) -> list[tuple[float, float]]:
        """Stretches of a side with a wall behind them."""
        x0, y0, x1, y1 = self.room.rect
        axis, at = ("x", y0 if side == "south" else y1) if side in ("south", "north") else (
            "y", x0 if side == "west" else x1)  # fmt: skip
        low, high = (self.rect[0], self.rect[2]) if axis == "x" else (self.rect[1], self.rect[3])
        spans: list[list[float]] = []
        for edge in sorted(self.home.plan.edges, key=lambda e: e.low):
            if edge.axis != axis or abs(edge.at - at) > 1e-6 or self.room.name not in edge.rooms:
                continue
            if self.home.plan.fully_open(edge):
                continue
            a, b = max(edge.low, low), min(edge.high, high)
            if spans and abs(spans[-1][1] - a) < 0.25:
                spans[-1][1] = b
            else:
                spans.append([a, b])
        return [(a, b) for a, b in spans]

    def _against(self, side: str, at: float, depth: float, middle: float, turn: np.ndarray) -> np.ndarray:
        """Base position of something whose back is `depth` behind its base, at the wall."""
        x0, y0, x1, y1 = self.rect
        foot = {"south": (at, y0), "north": (at, y1), "west": (x0, at), "east": (x1, at)}[side]
        return np.array([*foot, 0.0]) + turn @ np.array([depth, middle, 0.0])

    def _before_window(self, thing: Thing, side: str, allowed: bool) -> bool:
        """Whether it stands in a window's light."""
        low, high = thing.box()
        axis = "x" if side in ("south", "north") else "y"
        k = 0 if axis == "x" else 1
        for opening in self.home.plan.openings:
            if opening.kind != "window" or self.room.name not in opening.edge.rooms or opening.edge.axis != axis:
                continue
            at_wall = abs(opening.edge.at - (low[1 - k] if side in ("south", "west") else high[1 - k])) < 0.3
            overlaps = low[k] < opening.high and high[k] > opening.low
            if at_wall and overlaps and (high[2] > opening.bottom + 0.02 or not allowed):
                return True
        return False

    def _shuffled(self, values: list) -> list:
        values = list(values)
        self.rng.shuffle(values)
        return values


def resting(category: str, index: int, stand: int | None = None, seed: int = 0) -> np.ndarray:
    """Rotation [3, 3] in which a model is put down: as built where that is one of its stable orientations."""
    if stand is not None:
        return lying(category, index, stand, seed)
    if find(category).rest == "upright":
        return np.eye(3)
    for number in range(MOST_POSES):
        turn = lying(category, index, number, seed)
        if np.allclose(turn, np.eye(3), atol=0.02):
            return turn
    return lying(category, index, 0, seed)


def _degrees(thing: Thing) -> float:
    angle = float(np.degrees(np.arctan2(thing.rotation[1, 0], thing.rotation[0, 0])))
    return round(angle / 90) * 90 if abs(angle / 90 - round(angle / 90)) < 1e-6 else angle


def _within(thing: Thing, host: Thing, surface: Surface) -> bool:
    """Whether a thing's box, seen from the host, stays on the surface."""
    points = np.concatenate(thing.hulls())
    local = (points - host.position) @ host.rotation / host.scale
    low, high = local[:, :2].min(0), local[:, :2].max(0)
    x0, y0, x1, y1 = surface.rect
    over = 0.0 if surface.inside else 0.006
    return bool(low[0] >= x0 - over and low[1] >= y0 - over and high[0] <= x1 + over and high[1] <= y1 + over)
