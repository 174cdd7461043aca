"""A floor plan: rooms as rectangles on wall centre lines, and the openings in the walls between them.

Metres; x to the right, y up; the plan's middle is the world's origin, the floor is z = 0. One storey.
"""

from __future__ import annotations

import dataclasses
import itertools

import numpy as np

INNER_WALL, OUTER_WALL = 0.12, 0.20
"""Thickness, m. Both stand centred on the rooms' edges."""
HEIGHT = 2.5
"""Of walls, m."""

Rect = tuple[float, float, float, float]
"""x0, y0, x1, y1."""


@dataclasses.dataclass(frozen=True)
class Room:
    """name: "kitchen_0". kind: a line of room_categories.txt. rect: between the centre lines of its walls."""

    name: str
    kind: str
    rect: Rect

    @property
    def centre(self) -> np.ndarray:
        x0, y0, x1, y1 = self.rect
        return np.array([(x0 + x1) / 2, (y0 + y1) / 2])

    @property
    def area(self) -> float:
        x0, y0, x1, y1 = self.rect
        return (x1 - x0) * (y1 - y0)


@dataclasses.dataclass(frozen=True)
class Edge:
    """A straight piece of wall line that one or two rooms share.

    Attributes:
      axis: "x": it runs along x at y = `at`; "y": along y at x = `at`. low, high: its ends.
      before, after: the room on the side of smaller and of larger `at` coordinate; None: outside.
    """

    axis: str
    at: float
    low: float
    high: float
    before: str | None
    after: str | None

    @property
    def outer(self) -> bool:
        return self.before is None or self.after is None

    @property
    def thickness(self) -> float:
        return OUTER_WALL if self.outer else INNER_WALL

    @property
    def length(self) -> float:
        return self.high - self.low

    @property
    def rooms(self) -> tuple[str, ...]:
        return tuple(room for room in (self.before, self.after) if room)

    def point(self, along: float, across: float = 0.0) -> np.ndarray:
        """World x, y of a place on the edge: `along` its axis (world coordinate), `across` it from its line."""
        return np.array([along, self.at + across] if self.axis == "x" else [self.at + across, along])

    def box(self, low: float, high: float, z0: float, z1: float, across: float | None = None) -> np.ndarray:
        """[2, 3] corners of a block of this wall from `low` to `high`; across: half its thickness."""
        half = self.thickness / 2 if across is None else across
        a, b = self.point(low, -half), self.point(high, half)
        return np.array([[a[0], a[1], z0], [b[0], b[1], z1]])


@dataclasses.dataclass(frozen=True)
class Opening:
    """A hole in an edge.

    Attributes:
      kind: "door", "window", or "passage" (no wall at all up to its height).
      centre, width: along the edge's axis; bottom, top: heights.
      category, index: the model of the catalogue that stands in it (doors and windows).
      into: the room that the leaf opens into.
    """

    kind: str
    edge: Edge
    centre: float
    width: float
    bottom: float
    top: float
    index: int = 0
    into: str | None = None

    @property
    def low(self) -> float:
        return self.centre - self.width / 2

    @property
    def high(self) -> float:
        return self.centre + self.width / 2

    @property
    def walkable(self) -> bool:
        return self.kind != "window"


@dataclasses.dataclass(frozen=True)
class Plan:
    """A home's rooms, wall edges and openings. name: of the home.

    Attributes:
      leaves_at_walls: doors are hinged near corners, and furniture leaves ways past doors that stand open.
    """

    name: str
    rooms: tuple[Room, ...]
    edges: tuple[Edge, ...]
    openings: tuple[Opening, ...] = ()
    leaves_at_walls: bool = False

    def room(self, name: str) -> Room:
        return next(room for room in self.rooms if room.name == name)

    def room_at(self, x: float, y: float) -> Room | None:
        for room in self.rooms:
            x0, y0, x1, y1 = room.rect
            if x0 <= x <= x1 and y0 <= y <= y1:
                return room
        return None

    def openings_of(self, edge: Edge) -> list[Opening]:
        """In order along the edge."""
        return sorted((o for o in self.openings if o.edge == edge), key=lambda o: o.low)

    def inside(self, room: Room) -> Rect:
        """The free rectangle between a room's wall faces; where a wall is wholly open, up to its centre line."""
        x0, y0, x1, y1 = room.rect
        shrink = {"x0": 0.0, "y0": 0.0, "x1": 0.0, "y1": 0.0}
        for edge in self.edges:
            if room.name not in edge.rooms or self.fully_open(edge):
                continue
            side = ("y" if edge.axis == "x" else "x") + ("0" if edge.after == room.name else "1")
            shrink[side] = max(shrink[side], edge.thickness / 2)
        return (x0 + shrink["x0"], y0 + shrink["y0"], x1 - shrink["x1"], y1 - shrink["y1"])

    def fully_open(self, edge: Edge) -> bool:
        """No wall stands on it: two parts of one open-plan room."""
        return any(o.kind == "passage" and o.width >= edge.length - 1e-6 for o in self.openings_of(edge))

    def extent(self) -> Rect:
        rects = np.array([room.rect for room in self.rooms])
        return (*rects[:, :2].min(0).tolist(), *rects[:, 2:].max(0).tolist())


def make_edges(rooms: tuple[Room, ...]) -> tuple[Edge, ...]:
    """All wall pieces around rooms that tile without overlap, cut wherever a neighbour begins or ends."""
    edges = []
    for axis in ("x", "y"):
        across, along = (1, 0) if axis == "x" else (0, 1)
        lines = sorted({round(room.rect[k], 6) for room in rooms for k in (across, across + 2)})
        for line in lines:
            touching = [r for r in rooms if line in (round(r.rect[across], 6), round(r.rect[across + 2], 6))]
            cuts = sorted({round(r.rect[k], 6) for r in touching for k in (along, along + 2)})
            for low, high in itertools.pairwise(cuts):
                before = _covering(touching, across + 2, line, along, low, high)
                after = _covering(touching, across, line, along, low, high)
                if before or after:
                    edges.append(Edge(axis, line, low, high, before, after))
    return tuple(edges)


def _covering(rooms, side: int, line: float, along: int, low: float, high: float) -> str | None:
    for room in rooms:
        if round(room.rect[side], 6) == line and room.rect[along] < high - 1e-6 and room.rect[along + 2] > low + 1e-6:
            return room.name
    return None


def grid_rooms(
    kinds: dict[str, str], columns: tuple[float, ...], rows: tuple[float, ...], map_: str
) -> tuple[Room, ...]:
    """Rooms out of a drawing: one letter per cell, the top line is the northern (largest y) row.

    Args:
      kinds: letter -> room kind; rooms of a kind are numbered in this order.
      columns, rows: widths from the left and heights from the top of the drawing, metres.
      map_: lines of letters; each letter fills a rectangle; "." is outside.
    """
    lines = [line.split() for line in map_.strip().splitlines()]
    assert len(lines) == len(rows) and all(len(line) == len(columns) for line in lines), "drawing and sizes differ"
    xs = np.concatenate([[0.0], np.cumsum(columns)])
    ys = np.concatenate([[0.0], np.cumsum(rows)])
    ys = ys[-1] - ys
    cells: dict[str, list[tuple[int, int]]] = {}
    for i, line in enumerate(lines):
        for j, letter in enumerate(line):
            if letter != ".":
                cells.setdefault(letter, []).append((i, j))
    assert set(cells) == set(kinds), f"drawing has {sorted(cells)}, kinds has {sorted(kinds)}"
    counts: dict[str, int] = {}
    rooms = []
    middle = np.array([xs[-1] / 2, ys[0] / 2])
    for letter, kind in kinds.items():
        ii, jj = np.array(cells[letter]).T
        height, width = np.ptp(ii) + 1, np.ptp(jj) + 1
        assert len(ii) == height * width, f"room {letter} is not a rectangle"
        x0, x1, y0, y1 = xs[jj.min()], xs[jj.max() + 1], ys[ii.max() + 1], ys[ii.min()]
        rect = (x0 - middle[0], y0 - middle[1], x1 - middle[0], y1 - middle[1])
        number = counts.setdefault(kind, 0)
        counts[kind] += 1
        rooms.append(Room(f"{kind}_{number}", kind, tuple(round(float(v), 6) for v in rect)))  # pyright: ignore
    return tuple(rooms)
