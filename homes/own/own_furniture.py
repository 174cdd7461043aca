"""Furniture of a home of one's own: each piece where the file says, or an error that says why it cannot stand there."""

from __future__ import annotations

import dataclasses
import pathlib
import random
import re

import msgspec

from ig2mj.errors import UnknownNameError

from ..furnish.arrangement import FLAT
from ..furnish.clearances import blocked
from ..furnish.kit import DEGREES, RoomKit
from ..furnish.kitchen import in_the_middle
from ..furnish.placed import Placed
from ..furnish.room import HomeInProgress
from ..furnish.start import NoRoomToOpen, lay_doormat, start_home
from ..objects.catalogue import IN_WALLS, catalogue, find, model_number
from ..objects.folder_model import is_folder
from ..plans.plan import Plan
from .description import HomeDescription, PieceSpec, category_of, near
from .own_plan import room_name

MANIFEST = "manifest.json"
SIDES = {"front": 0.0, "left": 90.0, "back": 180.0, "right": 270.0}
"""Side of a piece -> degrees, as `RoomKit.before` takes them."""
PLACES = ("wall", "position", "left_of", "right_of", "in_front_of", "on")
"""Keys that say where a piece stands; at most one of them is given."""
AROUND = [(0.1 * i, 0.1 * j) for i in range(-10, 11) for j in range(-10, 11)]
AROUND.sort(key=lambda p: (p[0] ** 2 + p[1] ** 2, p))
"""m from a wanted place, the nearest first: where a place is looked for that an error can name."""


class _WindowInTheWay(Exception):
    """A piece has no room because of a window that the file does not ask for. number: of the window."""

    def __init__(self, number: int):
        self.number = number


def furnish_own(home: HomeDescription, plan: Plan) -> HomeInProgress:
    """The plan with doors, windows and all pieces. Raises InputError: it names the piece and what is in its way.

    Where the file leaves windows open, those that are in the way of a piece whose place it gives are left out.
    """
    while True:
        try:
            return _furnished(home, plan)
        except _WindowInTheWay as e:
            window = [opening for opening in plan.openings if opening.kind == "window"][e.number]
            plan = dataclasses.replace(plan, openings=tuple(o for o in plan.openings if o is not window))


def _furnished(home: HomeDescription, plan: Plan) -> HomeInProgress:
    rng = random.Random(f"{home.seed}/{home.name}/things")
    try:
        made = start_home(plan, rng, seed=home.seed)
    except NoRoomToOpen as e:
        rooms = " and ".join(e.opening.edge.rooms)
        raise home.error(
            f"{e.opening.kind}s", f"the {e.opening.kind} of {rooms} at {e.opening.centre:g} {e.problem}"
        ) from e
    lay_doormat(made)
    named: dict[str, Placed] = {}
    for name, spec in home.furniture.items():
        if name in made.things.things:
            raise home.error(f"furniture.{name}", "is the name of a door, a window or the doormat")
        named[name] = _place(home, made, name, spec, named)
        made.things.rename(named[name], name)
    for name, what in blocked(plan, made.things.things.values()):
        raise home.error(f"furniture.{name}" if name in named else "doors", f"{name} cannot open: {what} is in the way")
    return made


def resolve(home: HomeDescription, model: str, element: str) -> tuple[str, int | None]:
    """What a model is: a category of the catalogue, or the path of a folder; and its number, None: any.

    A value is a folder if that contains manifest.json. Raises InputError, which names both readings.
    """
    folder = home.folder / model
    if (folder / MANIFEST).is_file():
        return str(folder.resolve()), 0
    category, mark, number = model.partition("/")
    known = catalogue()
    if category not in known or category in IN_WALLS:
        hint = near(category, [name for name in known if name not in IN_WALLS], few=0)
        problem = f"no category is named '{category}'{hint}, and there is no {folder / MANIFEST}"
        raise home.error(element, problem, "`ig2mj homes list --objects` lists categories")
    if not mark:
        return category, None
    try:
        return category, model_number(known[category], number, home.seed)
    except UnknownNameError as e:
        raise home.error(element, str(e)) from e


def is_own(thing: Placed) -> bool:
    """Whether an object comes from a folder."""
    return is_folder(thing.category)


def folder_of(thing: Placed) -> pathlib.Path:
    """The folder of an object that comes from one."""
    return pathlib.Path(thing.category)


def _place(home: HomeDescription, made: HomeInProgress, name: str, spec: PieceSpec, named: dict[str, Placed]) -> Placed:
    element = f"furniture.{name}"
    model = category_of(name, spec)
    category, number = resolve(home, model, f"{element}.model" if spec.model is not None else element)
    if not is_folder(category) and category in FLAT and spec.wall is not None:
        raise home.error(f"{element}.wall", f"a {category} lies on the floor: give its position")
    index = made.index(category) if number is None else number
    given = [key for key in PLACES if getattr(spec, key) is not None]
    if len(given) > 1:
        raise home.error(element, f"has {' and '.join(given)}: one of them says where it stands")
    for key, needs in (("at", "wall"), ("yaw", "position")):
        if getattr(spec, key) is not None and needs not in given:
            raise home.error(f"{element}.{key}", f"needs '{needs}'")
    anchor = None
    if given and given[0] in ("left_of", "right_of", "in_front_of", "on"):
        other = getattr(spec, given[0])
        if other not in named:
            later = "; it comes later in the file" if other in home.furniture else near(other, named)
            raise home.error(f"{element}.{given[0]}", f"no piece before this one is named '{other}'{later}")
        anchor = named[other]
    kit = RoomKit(made, plan_room(home, made, spec, element, anchor))
    kit.problem = ""
    found = _tried(kit, spec, category, index, anchor)
    carpets = [t for t in made.things.things.values() if t.category in FLAT and t.rooms == (kit.room.name,)]
    for carpet in carpets if found is None and (spec.position or spec.in_front_of) else ():
        found = found or _tried(kit, spec, category, index, anchor, carpet)
    if found is None:
        if home.windows is None and given:
            windows = [o for o in made.plan.openings if o.kind == "window"]
            own = [o for o in kit.openings("window") if kit.side_of(o.edge) == spec.wall]
            in_wall = [number for number, window in enumerate(windows) if window in own]
            if match := re.search(r"\bwindow_(\d+)", kit.problem):
                raise _WindowInTheWay(int(match[1]))
            if spec.at is None and in_wall:
                raise _WindowInTheWay(in_wall[0])
        anywhere = not given or (spec.wall is not None and spec.at is None)
        where = f"the {spec.wall} wall of {kit.room.name}" if spec.wall else kit.room.name
        problem = f"{model} does not fit: it {kit.problem or 'finds no place'}"
        if anywhere:
            problem = f"{model} finds no place {'at' if spec.wall else 'in'} {where}"
            problem += f": at the first that was tried it {kit.problem}" if kit.problem else ""
        raise home.error(element, problem, _hint(kit, spec, category, index, anchor))
    if spec.fixed is not None:
        found.fixed = spec.fixed
    return found


def plan_room(home: HomeDescription, made: HomeInProgress, spec: PieceSpec, element: str, anchor: Placed | None):
    """The room that a piece stands in. Raises InputError."""
    plan = made.plan
    if spec.room is not None:
        found = room_name(home, plan, spec.room)
        if found is None:
            raise home.unknown(f"{element}.room", "room", spec.room, home.rooms)
        return plan.room(found)
    if anchor is not None:
        return plan.room(anchor.rooms[0])
    if spec.position is not None:
        at = plan.room_at(*spec.position)
        if at is None:
            raise home.error(f"{element}.position", f"{spec.position[0]:g}, {spec.position[1]:g} is in no room")
        return at
    raise home.error(element, "needs a room", 'room = "kitchen", or next to another piece: left_of = "fridge"')


def _tried(
    kit: RoomKit, spec: PieceSpec, category: str, index: int, anchor: Placed | None, carpet: Placed | None = None
) -> Placed | None:
    """The piece in its place, or None. carpet: it stands on this one, wholly."""
    if spec.wall is not None:
        if spec.at is not None and not _on_wall(kit, spec.wall, spec.at, category, index):
            return None
        return kit.at_wall(category, side=spec.wall, at=spec.at, place="corner", index=index, height=spec.height)
    if spec.position is not None:
        return kit.at(category, spec.position, spec.yaw or 0.0, index=index, gap=0.0, carpet=carpet)
    if anchor is None:
        kind = "any" if find(category).fixed or spec.height else "corner"
        found = kit.at_wall(category, place=kind, index=index, height=spec.height)
        return found or in_the_middle(kit, category)
    if spec.left_of is not None or spec.right_of is not None:  # seen by who looks at its front
        which = -1 if spec.left_of is not None else 1
        return kit.beside(anchor, category, which, index=index, gap=0.012)
    if spec.on is not None:
        return kit.on(anchor, category, index=index, at="middle", degrees=0.0)
    side = SIDES[spec.side]
    return kit.before(anchor, category, spec.distance, index=index, along=spec.along, side=side, carpet=carpet)


def _on_wall(kit: RoomKit, side: str, at: float, category: str, index: int) -> bool:
    half = float(kit.shape(category, index).size[1]) / 2
    spans = kit.wall_spans(side)
    if any(low <= at - half + 1e-6 and at + half - 1e-6 <= high for low, high in spans):
        return True
    axis = "x" if side in ("north", "south") else "y"
    free = " and ".join(f"{axis} = {low:.2f} to {high:.2f}" for low, high in spans) or "nowhere"
    kit.problem = f"is {2 * half:.2f} m wide, and the {side} wall of {kit.room.name} runs from {free}"
    return False


def _hint(kit: RoomKit, spec: PieceSpec, category: str, index: int, anchor: Placed | None) -> str:
    """Where the piece would fit, near to where it was to stand; ''."""
    start = kit.home.now()
    found: Placed | None = None
    if spec.wall is not None and spec.at is not None:
        along = spec.wall in ("north", "south")
        near_to = (spec.at, spec.at)
        found = kit.at_wall(category, side=spec.wall, near=near_to, index=index, height=spec.height)
        if found is not None:
            kit.home.back_to(start)
            return f"at = {found.centre[0 if along else 1]:.3f} is free"
    elif spec.position is not None:
        x, y = spec.position
        for dx, dy in AROUND:
            found = kit.at(category, (x + dx, y + dy), spec.yaw or 0.0, index=index, gap=0.0)
            if found is not None:
                kit.home.back_to(start)
                return f"position = [{x + dx:.2f}, {y + dy:.2f}] is free"
    elif spec.wall is not None:
        sides = [side for side in DEGREES if side != spec.wall]
        for side in sides:
            if kit.at_wall(category, side=side, place="corner", index=index, height=spec.height) is not None:
                kit.home.back_to(start)
                return f'wall = "{side}" has room'
    elif spec.in_front_of is not None:
        for more in range(1, 20):
            distance = round(spec.distance + 0.05 * more, 3)
            if _tried(kit, msgspec.structs.replace(spec, distance=distance), category, index, anchor) is not None:
                kit.home.back_to(start)
                return f"distance = {distance:g} is free"
    return ""
