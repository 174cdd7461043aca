"""Where doors, passages and windows go: every room reachable, bathrooms off corridors, daylight in living rooms."""

from __future__ import annotations

import dataclasses
import random
from collections.abc import Collection, Iterator

from ..furnish.placed import Placed, shape, yaw
from ..objects.catalogue import find
from .plan import HEIGHT, Edge, Opening, Plan, Room, make_edges

AIR = 0.004  # m, around a door's or window's frame in its opening
CORNER = 0.30  # m, least distance of an opening from a room's corner: a leaf that opens by 100 degrees needs it
PASSAGE_WIDTH, PASSAGE_TOP = 1.30, 2.10  # m
SILL, COUNTER_SILL = 0.90, 1.0  # m, height of window sills; in kitchens, where cupboards stand below
LONG = 4.0  # m of outer wall from which there are two windows in it
LARGE = 15.0  # m2 of room from which there are windows in two walls
DOOR_WALL = 0.95 + 2 * CORNER  # m of wall that a door needs, at least
KNOB = 0.053  # m, by which a door's box is deeper than its frame (objects/doors_windows.py)

HUBS = ("corridor", "lobby", "living_room", "dining_room", "staircase")
"""Rooms that others are reached through."""
PRIVATE = ("bathroom", "closet", "storage_room", "pantry_room", "utility_room", "bedroom", "garage", "balcony")
"""Rooms that no way should lead through."""
DARK = ("closet", "storage_room", "pantry_room", "staircase", "garage", "auditorium")
"""Rooms without windows."""


def make_plan(
    name: str,
    rooms: tuple[Room, ...],
    rng: random.Random,
    *,
    open_plan: Collection[tuple[str, str]] = (),
    passages: Collection[tuple[str, str]] = (),
    front: str | None = None,
    models: int = 3,
    seed: int = 0,
    leaves_at_walls: bool = False,
) -> Plan:
    """A plan with openings.

    Args:
      open_plan: pairs of rooms with no wall between them. passages: pairs with a wide opening without a door.
      front: the room with the front door; None: the best hub at an outer wall.
      models: at most so many models of doors and windows are used. seed: of the models.
      leaves_at_walls: see `Plan`.
    """
    plan = Plan(name, rooms, make_edges(rooms), leaves_at_walls=leaves_at_walls)
    openings: list[Opening] = []
    for pairs, full in ((open_plan, True), (passages, False)):
        for a, b in pairs:
            edge = _shared(plan, a, b)
            openings.append(passage(edge, edge.length if full else min(PASSAGE_WIDTH, edge.length - 2 * 0.15)))
    style = rng.randrange(min(find("door").count, models))
    openings += doors(plan, openings, style, rng, seed)
    apart = unjoined(plan, openings)
    assert not apart, f"{name}: rooms without a way in: {apart}"
    openings += front_doors(plan, front, style, models, rng, seed)
    pane = rng.randrange(min(find("window").count, models))
    openings += windows(plan, openings, pane, seed)
    return dataclasses.replace(plan, openings=tuple(openings))


def passage(edge: Edge, width: float, centre: float | None = None) -> Opening:
    """A way without a door, or with no wall at all where it is as wide as the edge. centre: default, the edge's."""
    top = HEIGHT if width >= edge.length - 1e-6 else PASSAGE_TOP
    return Opening("passage", edge, (edge.low + edge.high) / 2 if centre is None else centre, width, 0.0, top)


def door(edge: Edge, index: int, into: str, centre: float | None = None, seed: int = 0) -> Opening:
    """A door of the catalogue. into: the room that it opens into. centre: default, the edge's."""
    _, width, height = shape("door", index, seed).size
    width = float(width) + AIR
    middle = (edge.low + edge.high) / 2 if centre is None else centre
    return Opening("door", edge, middle, width, 0.0, float(height) + AIR, index, into)


def window(plan: Plan, edge: Edge, index: int, centre: float | None = None, seed: int = 0) -> Opening:
    """A window of the catalogue. centre: default, the edge's."""
    room = plan.room(edge.rooms[0])
    _, width, height = shape("window", index, seed).size
    width, height = float(width) + AIR, float(height) + AIR
    sill = COUNTER_SILL if room.kind == "kitchen" else SILL
    middle = (edge.low + edge.high) / 2 if centre is None else centre
    return Opening("window", edge, middle, width, sill, sill + height, index, room.name)


def unjoined(plan: Plan, openings: Collection[Opening]) -> list[str]:
    """Rooms that no way through openings joins to the first room."""
    joined: dict[str, str] = {room.name: room.name for room in plan.rooms}
    for opening in openings:
        if opening.walkable and not opening.edge.outer:
            _join(joined, *opening.edge.rooms)
    first = _root(joined, plan.rooms[0].name)
    return [room.name for room in plan.rooms if _root(joined, room.name) != first]


def doors(plan: Plan, openings: Collection[Opening], style: int, rng: random.Random, seed: int) -> list[Opening]:
    """Doors between rooms that no opening joins."""
    kinds = {room.name: room.kind for room in plan.rooms}
    joined: dict[str, str] = {room.name: room.name for room in plan.rooms}
    for opening in openings:
        _join(joined, *opening.edge.rooms)
    found = []
    candidates = [e for e in plan.edges if not e.outer and e.length >= DOOR_WALL]
    candidates.sort(key=lambda e: (_cost(e.before or "", e.after or "", kinds), -e.length, e.at, e.low))
    for edge in candidates:
        a, b = edge.rooms
        if _root(joined, a) != _root(joined, b):
            found.append(_door(plan, edge, style, opens_into(plan, edge), rng, seed))
            _join(joined, a, b)
    return found


def front_doors(
    plan: Plan, front: str | None, style: int, models: int, rng: random.Random, seed: int = 0
) -> list[Opening]:
    """The front door; empty where no outer wall is long enough. front: its room; None: the best hub."""
    kinds = {room.name: room.kind for room in plan.rooms}
    outer = _outer_walls(plan)
    entrances = [e for e in outer if e.rooms[0] == front] if front else sorted(
        outer, key=lambda e: (("lobby", "corridor", "living_room", "kitchen").index(kinds[e.rooms[0]])
                              if kinds[e.rooms[0]] in ("lobby", "corridor", "living_room", "kitchen") else 9,
                              e.length))  # fmt: skip
    return [_door(plan, edge, (style + 1) % models, edge.rooms[0], rng, seed) for edge in entrances[:1]]


def windows(plan: Plan, openings: Collection[Opening], pane: int, seed: int = 0) -> list[Opening]:
    """Windows of all rooms that have daylight, where no other opening is. pane: number of the model."""
    found, outer = list(openings), _outer_walls(plan)
    for room in plan.rooms:
        found += _windows(plan, room, [e for e in outer if e.rooms[0] == room.name], pane, found, seed)
    return found[len(openings) :]


def _outer_walls(plan: Plan) -> list[Edge]:
    """Outer walls of rooms with a roof that are long enough for a door."""
    return [e for e in plan.edges if e.outer and e.length >= DOOR_WALL and plan.room(e.rooms[0]).kind != "balcony"]


def opening_things(plan: Plan, seed: int = 0) -> Iterator[tuple[Opening, Placed]]:
    """The doors and windows that stand in the openings; both rooms in `rooms`."""
    for opening in plan.openings:
        if opening.kind == "passage":
            continue
        edge, form = opening.edge, shape(opening.kind, opening.index, seed)
        inward = 1 if opening.into == edge.after else -1
        if edge.axis == "x":
            turn = yaw(90 if inward > 0 else 270)
        else:
            turn = yaw(0 if inward > 0 else 180)
        shift = KNOB / 2 if opening.kind == "door" else 0.0
        x, y = edge.point(opening.centre)
        position = turn @ [shift, -(form.low[1] + form.high[1]) / 2, 0.0] + [x, y, opening.bottom + AIR / 2]
        yield (
            opening,
            Placed(opening.kind, opening.kind, opening.index, position, turn, True, edge.rooms, seed=seed),
        )


def _cost(first: str, second: str, kinds: dict[str, str]) -> int:
    """How little one would like a door between two rooms."""
    a, b = kinds[first], kinds[second]
    hubs = (a in HUBS) + (b in HUBS)
    private = (a in PRIVATE) + (b in PRIVATE)
    if {a, b} == {"bathroom", "bedroom"}:  # the first bathroom is everybody's
        return 9 if "bathroom_0" in (first, second) else 0
    if {a, b} == {"closet", "bedroom"} or {a, b} == {"pantry_room", "kitchen"}:
        return 0
    if {a, b} == {"balcony", "living_room"} or {a, b} == {"balcony", "bedroom"}:
        return 0
    if "corridor" in (a, b) or "lobby" in (a, b):
        return 1 if private < 2 else 3
    return 6 - 2 * hubs + 3 * private


def opens_into(plan: Plan, edge: Edge) -> str:
    """The room that a door opens into: the private one of two, unless it is too narrow for the leaf."""
    a, b = (plan.room(name) for name in edge.rooms)

    def rank(room: Room) -> tuple[bool, bool, float]:
        x0, y0, x1, y1 = room.rect
        return (min(x1 - x0, y1 - y0) < 1.6, room.kind in HUBS, room.area)

    return min(a, b, key=rank).name


def _door(plan: Plan, edge: Edge, index: int, into: str, rng: random.Random, seed: int) -> Opening:
    width = float(shape("door", index, seed).size[1]) + AIR
    low, high = edge.low + CORNER + width / 2, edge.high - CORNER - width / 2
    centre = rng.choice((low, high)) if high > low else (low + high) / 2
    if plan.leaves_at_walls and high > low:
        centre = high if _hinged_at_high_end(edge, index, into, seed) else low
    return door(edge, index, into, centre, seed)


def _hinged_at_high_end(edge: Edge, index: int, into: str, seed: int) -> bool:
    """Whether a door's hinge is on the side of larger coordinates along the edge."""
    left = next(joint.axis[2] for joint in shape("door", index, seed).model.joints) > 0  # the hinge is at its +y edge
    return left == ((into == edge.after) == (edge.axis == "y"))


def _windows(plan: Plan, room: Room, edges: list[Edge], index: int, taken: list[Opening], seed: int) -> list[Opening]:
    """A room's windows: in its longest outer wall, and in the next one where the room is large."""
    if room.kind in DARK or room.kind == "balcony":
        return []
    width = float(shape("window", index, seed).size[1]) + AIR
    found = []
    walls = 2 if room.area > LARGE and room.kind != "kitchen" else 1
    order = 1 if room.kind == "kitchen" else -1  # a kitchen's longest wall is for its counter
    for edge in sorted(edges, key=lambda e: (order * e.length, e.axis, e.at))[:walls]:
        count = 2 if edge.length > LONG and room.kind not in ("kitchen", "bathroom") else 1
        if edge.length / count < width + 2 * CORNER:
            continue
        for k in range(count):
            centre = edge.low + edge.length * (k + 0.5) / count
            low, high = centre - width / 2 - 0.25, centre + width / 2 + 0.25
            if all(o.edge != edge or o.high < low or o.low > high for o in taken):
                found.append(window(plan, edge, index, centre, seed))
    return found


def _shared(plan: Plan, a: str, b: str) -> Edge:
    found = [edge for edge in plan.edges if set(edge.rooms) == {a, b}]
    assert found, f"{plan.name}: {a} and {b} share no wall"
    return max(found, key=lambda edge: edge.length)


def _root(joined: dict[str, str], name: str) -> str:
    while joined[name] != name:
        name = joined[name]
    return name


def _join(joined: dict[str, str], a: str, b: str) -> None:
    joined[_root(joined, a)] = _root(joined, b)
