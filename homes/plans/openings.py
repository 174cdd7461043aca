"""Where doors, passages and windows go: every room reachable, bathrooms off corridors, daylight in living rooms."""

from __future__ import annotations

import dataclasses
import random
from collections.abc import Collection, Iterator

from ..furnish.placed import Placed, shape, yaw
from ..objects.catalogue import find
from .plan import Edge, Opening, Plan, Room, make_edges

AIR = 0.004  # m, around a door's or window's frame in its opening
CORNER = 0.30  # m, least distance of an opening from a room's corner: a leaf that opens by 100 degrees needs it
PASSAGE_WIDTH, PASSAGE_TOP = 1.30, 2.10  # m
SILL, COUNTER_SILL = 0.90, 1.0  # m, height of window sills; in kitchens, where cupboards stand below
LONG = 4.0  # m of outer wall from which there are two windows in it
LARGE = 15.0  # m2 of room from which there are windows in two walls
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
) -> Plan:
    """A plan with openings.

    Args:
      open_plan: pairs of rooms with no wall between them. passages: pairs with a wide opening without a door.
      front: the room with the front door; None: the best hub at an outer wall.
      models: at most so many models of doors and windows are used. seed: of the models.
    """
    plan = Plan(name, rooms, make_edges(rooms))
    kinds = {room.name: room.kind for room in rooms}
    openings: list[Opening] = []
    joined: dict[str, str] = {room.name: room.name for room in rooms}
    for pairs, full in ((open_plan, True), (passages, False)):
        for a, b in pairs:
            edge = _shared(plan, a, b)
            width = edge.length if full else min(PASSAGE_WIDTH, edge.length - 2 * 0.15)
            top = 2.5 if full else PASSAGE_TOP
            openings.append(Opening("passage", edge, (edge.low + edge.high) / 2, width, 0.0, top))
            _join(joined, a, b)
    style = rng.randrange(min(find("door").count, models))
    candidates = [e for e in plan.edges if not e.outer and e.length >= 0.95 + 2 * CORNER]
    candidates.sort(key=lambda e: (_cost(e.before or "", e.after or "", kinds), -e.length, e.at, e.low))
    for edge in candidates:
        a, b = edge.rooms
        if _root(joined, a) != _root(joined, b):
            openings.append(_door(edge, style, _into(plan, edge), rng, seed))
            _join(joined, a, b)
    roots = {_root(joined, room.name) for room in rooms}
    assert len(roots) == 1, f"{name}: rooms without a way in: {sorted(roots)}"
    outer = [e for e in plan.edges if e.outer and e.length >= 0.95 + 2 * CORNER and kinds[e.rooms[0]] != "balcony"]
    entrances = [e for e in outer if e.rooms[0] == front] if front else sorted(
        outer, key=lambda e: (("lobby", "corridor", "living_room", "kitchen").index(kinds[e.rooms[0]])
                              if kinds[e.rooms[0]] in ("lobby", "corridor", "living_room", "kitchen") else 9,
                              e.length))  # fmt: skip
    entrance = entrances[0]
    openings.append(_door(entrance, (style + 1) % models, entrance.rooms[0], rng, seed))
    pane = rng.randrange(min(find("window").count, models))
    for room in rooms:
        openings += _windows(room, [e for e in outer if e.rooms[0] == room.name], pane, openings, seed)
    return dataclasses.replace(plan, openings=tuple(openings))


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


def _into(plan: Plan, edge: Edge) -> str:
    """The room that a door opens into: the private one of two, unless it is too narrow for the leaf."""
    a, b = (plan.room(name) for name in edge.rooms)

    def rank(room: Room) -> tuple[bool, bool, float]:
        x0, y0, x1, y1 = room.rect
        return (min(x1 - x0, y1 - y0) < 1.6, room.kind in HUBS, room.area)

    return min(a, b, key=rank).name


def _door(edge: Edge, index: int, into: str, rng: random.Random, seed: int) -> Opening:
    _, width, height = shape("door", index, seed).size
    width = float(width) + AIR
    low, high = edge.low + CORNER + width / 2, edge.high - CORNER - width / 2
    centre = rng.choice((low, high)) if high > low else (low + high) / 2
    return Opening("door", edge, centre, width, 0.0, float(height) + AIR, index, into)


def _windows(room: Room, edges: list[Edge], index: int, taken: list[Opening], seed: int) -> list[Opening]:
    """A room's windows: in its longest outer wall, and in the next one where the room is large."""
    if room.kind in DARK or room.kind == "balcony":
        return []
    _, width, height = shape("window", index, seed).size
    width, height = float(width) + AIR, float(height) + AIR
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
                sill = COUNTER_SILL if room.kind == "kitchen" else SILL
                found.append(Opening("window", edge, centre, width, sill, sill + height, index, room.name))
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
