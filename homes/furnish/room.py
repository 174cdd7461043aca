"""A home in the making, and one room of it: which models are taken, where its walls, windows and front door are."""

from __future__ import annotations

import dataclasses
import random
from collections.abc import Callable

import numpy as np

from ..objects.catalogue import find
from ..plans.plan import Edge, Opening, Plan, Rect, Room
from .arrangement import Arrangement
from .ground import Ground
from .placed import Placed, Shape, shape

SIDES = {"south": (0, 1), "east": (-1, 0), "north": (0, -1), "west": (1, 0)}
"""Side of a room -> the direction into the room."""
ROOMY = 40  # objects, doors and windows included


@dataclasses.dataclass
class HomeInProgress:
    """What all rooms of a home share.

    Attributes:
      models, small_models: at most so many models of a category are used, of fixed and of loose objects.
      limit: no more objects than that. seed: of the models.
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
        """No more objects are wanted."""
        return self.limit is not None and len(self.things.things) >= self.limit

    @property
    def roomy(self) -> bool:
        """So many objects are wanted that there is no need to save any."""
        return self.limit is None or self.limit >= ROOMY

    def index(self, category: str, requested: Callable[[Shape], bool] | None = None) -> int:
        """A model number; requested: only models that this says yes to, where there are any."""
        entry = find(category)
        numbers = list(range(entry.count))
        if requested is not None:
            numbers = [k for k in numbers if requested(shape(category, k, self.seed))] or numbers
        return numbers[self.rng.randrange(min(len(numbers), self.models if entry.fixed else self.small_models))]

    def now(self) -> tuple[Arrangement, np.ndarray]:
        """What `back_to` takes to undo all that was put since."""
        return self.things.copy(), self.ground.free

    def back_to(self, earlier: tuple[Arrangement, np.ndarray]) -> None:
        """Takes away what was put since `now` gave this."""
        things, free = earlier
        self.things, self.ground.free = things.copy(), free


class RoomBase:
    """One room being furnished.

    Attributes:
      rect: between its wall faces.
      problem: why the first place that was tried was no good, as the end of a sentence about the object; ''. Callers
        that report it clear it before.
    """

    problem = ""

    def __init__(self, home: HomeInProgress, room: Room):
        self.home, self.room = home, room
        self.rect: Rect = home.plan.inside(room)
        self.rng = home.rng

    @property
    def front_door(self) -> Opening | None:
        """The home's front door, where it leads into this room."""
        return next((o for o in self.openings("door") if o.edge.outer), None)

    def openings(self, kind: str) -> list[Opening]:
        """The room's doors, windows or passages, in the plan's order."""
        return [o for o in self.home.plan.openings if o.kind == kind and self.room.name in o.edge.rooms]

    def side_of(self, edge: Edge) -> str:
        """The side of the room that a wall is at."""
        if edge.axis == "x":
            return "south" if edge.after == self.room.name else "north"
        return "west" if edge.after == self.room.name else "east"

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

    def shape(self, category: str, index: int) -> Shape:
        return shape(category, index, self.home.seed)

    def thing(self, category: str, index: int, position, turn: np.ndarray, fixed: bool | None = None) -> Placed:
        """An object of this room that is not put yet."""
        fixed = find(category).fixed if fixed is None else fixed
        rooms, seed = (self.room.name,), self.home.seed
        return Placed(category, category, index, np.asarray(position, float), turn, fixed, rooms, seed=seed)

    def shuffled(self, values: list) -> list:
        values = list(values)
        self.rng.shuffle(values)
        return values


def degrees_of(thing: Placed) -> float:
    """Yaw of an object's front."""
    angle = float(np.degrees(np.arctan2(thing.rotation[1, 0], thing.rotation[0, 0])))
    return round(angle / 90) * 90 if abs(angle / 90 - round(angle / 90)) < 1e-6 else angle
