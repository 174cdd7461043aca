"""The plan of a home of one's own: its rooms checked, doors, windows and passages in their walls."""

from __future__ import annotations

import dataclasses
import itertools
import random
import re
from collections.abc import Sequence

from ..dataset.root import ROOM_TYPES
from ..objects.catalogue import find
from ..plans import openings
from ..plans.openings import CORNER, DOOR_WALL
from ..plans.plan import OUTER_WALL, Edge, Opening, Plan, Room, make_edges
from .description import LARGEST, OUTSIDE, HomeDescription

SMALLEST = 1.0
"""m: the shorter side of a room, at least."""
APART = 2 * OUTER_WALL
"""m: rooms that share no wall line are at least this far from each other."""
BETWEEN = 0.1
"""m of wall between two openings, at least."""
MODELS = 3
"""So many models of doors and windows are used where the file names none."""


def make_own_plan(home: HomeDescription) -> Plan:
    """Rooms and openings. Raises InputError: it names the table and the key."""
    rooms = _rooms(home)
    plan = Plan(home.name, rooms, make_edges(rooms))
    rng = random.Random(f"{home.seed}/{home.name}/plan")
    style, pane = (rng.randrange(min(find(kind).count, MODELS)) for kind in ("door", "window"))
    found: list[Opening] = []
    for number, spec in enumerate(home.passages):
        element = f"passages[{number}]"
        a, b = (_room(home, plan, name, f"{element}.between") for name in spec.between)
        edges = _shared(home, plan, a, b, None, element)
        edge = _edge_at(home, edges, spec.at, element)
        width = edge.length if spec.width is None else spec.width
        if not 0.7 <= width <= edge.length:
            raise home.error(f"{element}.width", f"is {width:g} m, and the wall allows 0.7 to {edge.length:.2f} m")
        margin = width / 2
        found.append(openings.passage(edge, width, _centre(home, edge, spec.at, margin, element)))
    if home.doors is None:
        found += openings.doors(plan, found, style, rng, home.seed)
        found += openings.front_doors(plan, None, style, MODELS, rng, home.seed)
    for number, spec in enumerate(home.doors or ()):
        element = f"doors[{number}]"
        a, b = (_room(home, plan, name, f"{element}.between", outside=True) for name in spec.between)
        if a is None:
            a, b = b, a
        edges = _shared(home, plan, a, b, spec.wall, element)
        _model(home, "door", spec.model, element)
        edge = _edge_at(home, edges, spec.at, element)
        into = openings.opens_into(plan, edge) if b is not None else edge.rooms[0]
        if spec.into is not None:
            into = _room(home, plan, spec.into, f"{element}.into") or ""
            if into not in edge.rooms:
                raise home.error(f"{element}.into", f"the door is between {' and '.join(spec.between)}, not of {into}")
        door = openings.door(edge, spec.model or style, into, None, home.seed)
        centre = _centre(home, edge, spec.at, CORNER + door.width / 2, element)
        found.append(dataclasses.replace(door, centre=centre))
    _check_ways(home, plan, found)
    if home.windows is None:
        found += openings.windows(plan, found, pane, home.seed)
    for number, spec in enumerate(home.windows or ()):
        element = f"windows[{number}]"
        room = _room(home, plan, spec.room, f"{element}.room")
        edges = [e for e in plan.edges if e.outer and e.rooms == (room,) and _side(e, room) == spec.wall]
        if not edges:
            fix = f"outer walls of {room}: {', '.join(_outer_sides(plan, room)) or 'none'}"
            raise home.error(f"{element}.wall", f"the {spec.wall} wall of {room} is no outer wall", fix)
        if plan.room(str(room)).kind == "balcony":
            raise home.error(f"{element}.room", "a balcony has a parapet and no windows")
        _model(home, "window", spec.model, element)
        edge = _edge_at(home, edges, spec.at, element)
        window = openings.window(plan, edge, spec.model or pane, None, home.seed)
        centre = _centre(home, edge, spec.at, window.width / 2 + BETWEEN, element)
        found.append(dataclasses.replace(window, centre=centre))
    _check_apart(home, found)
    return dataclasses.replace(plan, openings=tuple(found))


def _rooms(home: HomeDescription) -> tuple[Room, ...]:
    """The rooms, those of a type in the order of their numbers."""
    found: dict[tuple[str, int], Room] = {}
    for name, rect in home.rooms.items():
        kind, number = _kind(home, name)
        if (kind, number) in found:
            raise home.error(f"rooms.{name}", f"is {kind}_{number}, which is there already")
        x0, y0, x1, y1 = (round(v, 6) for v in rect)
        if not (x1 - x0 >= SMALLEST and y1 - y0 >= SMALLEST):
            problem = f"is {x1 - x0:g} m by {y1 - y0:g} m, and a room has at least {SMALLEST:g} m"
            raise home.error(f"rooms.{name}", problem, "x0, y0, x1, y1 with x0 < x1 and y0 < y1")
        if max(map(abs, rect)) > LARGEST:
            raise home.error(f"rooms.{name}", f"reaches farther than {LARGEST:g} m from the origin")
        found[kind, number] = Room(f"{kind}_{number}", kind, (x0, y0, x1, y1))
    for kind, number in found:
        if number > 0 and (kind, number - 1) not in found:
            problem = f"there is no {kind}_{number - 1}: rooms of a type are numbered from 0"
            raise home.error(f"rooms.{kind}_{number}", problem)
    names = {room.name: name for (name, room) in zip(home.rooms, found.values(), strict=True)}
    for a, b in itertools.combinations(found.values(), 2):
        wide, deep = (min(a.rect[k + 2], b.rect[k + 2]) - max(a.rect[k], b.rect[k]) for k in (0, 1))
        element = f"rooms.{names[b.name]}"
        if wide > 0 and deep > 0:
            problem = f"overlaps {names[a.name]} by {wide:g} m in x and {deep:g} m in y"
            raise home.error(element, problem, "rooms touch along their wall lines")
        if max(wide, deep) > 0 and -APART < min(wide, deep) < 0:
            problem = f"is {-min(wide, deep):.3g} m from {names[a.name]}, where both have outer walls"
            raise home.error(element, problem, f"let them touch, or keep {APART:g} m between them")
    return tuple(sorted(found.values(), key=lambda room: int(room.name.rpartition("_")[2])))


def _kind(home: HomeDescription, name: str) -> tuple[str, int]:
    match = re.fullmatch(r"(.+?)(?:_(\d{1,3}))?", name)
    assert match is not None
    kind, number = match[1], int(match[2] or 0)
    if kind not in ROOM_TYPES:
        raise home.unknown(f"rooms.{name}", "type of room", kind, [*ROOM_TYPES])
    return kind, number


def room_name(home: HomeDescription, plan: Plan, name: str) -> str | None:
    """The room that the file means: "kitchen" is kitchen_0. None: there is none."""
    names = [room.name for room in plan.rooms]
    return next((n for n in (name, f"{name}_0") if n in names), None)


def _room(home: HomeDescription, plan: Plan, name: str, element: str, outside: bool = False) -> str | None:
    """A room's name; None for "outside" where it may stand. Raises InputError."""
    if outside and name == OUTSIDE:
        return None
    found = room_name(home, plan, name)
    if found is None:
        known = [*home.rooms, *((OUTSIDE,) if outside else ())]
        raise home.unknown(element, "room", name, known)
    return found


def _shared(
    home: HomeDescription, plan: Plan, a: str | None, b: str | None, wall: str | None, element: str
) -> list[Edge]:
    """Pieces of wall between two rooms, or of a room and the outside. Raises InputError."""
    if a == b:
        raise home.error(f"{element}.between", "names one room twice")
    requested = {a, b} - {None}
    edges = [edge for edge in plan.edges if set(edge.rooms) == requested]
    if not edges:
        first, second = a, b if b is not None else "the outside"
        others = sorted({r for e in plan.edges if a in e.rooms for r in e.rooms if r != a})
        others += [OUTSIDE] if any(e.outer and a in e.rooms for e in plan.edges) else []
        problem = f"{first} and {second} share no wall"
        raise home.error(f"{element}.between", problem, f"{first} has walls to {', '.join(others)}")
    if wall is not None:
        chosen = [edge for edge in edges if _side(edge, a) == wall]
        if not chosen:
            sides = ", ".join(dict.fromkeys(_side(edge, a) for edge in edges))
            raise home.error(f"{element}.wall", f"the wall is in the {sides} of {a}, not in the {wall}")
        return chosen
    return edges


def _edge_at(home: HomeDescription, edges: Sequence[Edge], at: float | None, element: str) -> Edge:
    """The piece of wall that holds a coordinate; the longest, where none is given. Raises InputError."""
    if at is None:
        return max(edges, key=lambda edge: (edge.length, edge.axis, -edge.at, -edge.low))
    for edge in edges:
        if edge.low <= at <= edge.high:
            return edge
    spans = " and ".join(f"{edge.axis} = {edge.low:g} to {edge.high:g}" for edge in edges)
    raise home.error(f"{element}.at", f"is {at:g}, and the wall runs from {spans}")


def _centre(home: HomeDescription, edge: Edge, at: float | None, margin: float, element: str) -> float:
    """Where the middle of an opening is. margin: m from the ends of the wall, at least. Raises InputError."""
    low, high = edge.low + margin, edge.high - margin
    if low > high + 1e-6:
        needs = 2 * margin
        raise home.error(element, f"the wall is {edge.length:.2f} m long, and this needs {needs:.2f} m")
    if at is None:
        return (edge.low + edge.high) / 2
    if not low - 1e-6 <= at <= high + 1e-6:
        problem = f"is {edge.axis} = {at:g}, too near to a corner"
        raise home.error(f"{element}.at", problem, f"{low:.2f} to {high:.2f} are possible")
    return at


def _side(edge: Edge, room: str | None) -> str:
    """The side of a room that a wall is at."""
    if edge.axis == "x":
        return "south" if edge.after == room else "north"
    return "west" if edge.after == room else "east"


def _outer_sides(plan: Plan, room: str | None) -> list[str]:
    return list(dict.fromkeys(_side(edge, room) for edge in plan.edges if edge.outer and edge.rooms == (room,)))


def _model(home: HomeDescription, category: str, number: int, element: str) -> None:
    count = find(category).count
    if not 0 <= number < count:
        raise home.error(f"{element}.model", f"is {number}: models of a {category} are 0 to {count - 1}")


def _check_ways(home: HomeDescription, plan: Plan, found: Sequence[Opening]) -> None:
    apart = openings.unjoined(plan, found)
    if not apart:
        return
    first = plan.rooms[0].name
    if home.doors is not None:
        problem = f"no way leads from {first} to {', '.join(apart)}"
        raise home.error("doors", problem, f'add between = ["{apart[0]}", ...]')
    problem = f"there is no wall of {DOOR_WALL:.2f} m for a door between {apart[0]} and a room that {first} leads to"
    raise home.error(f"rooms.{apart[0]}", problem)


def _check_apart(home: HomeDescription, found: Sequence[Opening]) -> None:
    for a, b in itertools.combinations(found, 2):
        if a.edge == b.edge and a.low < b.high + BETWEEN and b.low < a.high + BETWEEN:
            rooms = " and ".join(b.edge.rooms) if not b.edge.outer else f"{b.edge.rooms[0]} and {OUTSIDE}"
            problem = f"a {a.kind} at {a.centre:g} and a {b.kind} at {b.centre:g} overlap in the wall between {rooms}"
            raise home.error(f"{b.kind}s", problem, "move one of them with at = ...")
