"""The TOML of a home: rooms, doors, windows, passages, furniture, loose objects. Its schema, and how it is read.

seed = 0                                           # of models and places that the file leaves open

[rooms]                                            # between the centre lines of the walls: x0, y0, x1, y1 (m)
kitchen = [0.0, 0.0, 3.0, 4.0]                     # a type of room, with or without a number: kitchen_0
living_room = [3.0, 0.0, 7.5, 4.0]

[[doors]]                                          # left out: found, with a front door
between = ["kitchen", "living_room"]               # or "outside"
at = 1.0                                           # x or y of its middle; default: the middle of the wall

[[windows]]                                        # left out: found
room = "kitchen"
wall = "west"

[[passages]]                                       # no door; without a width: no wall
between = ["living_room", "dining_room"]
width = 1.2

[furniture]                                        # its name in the scene = how it is placed
fridge = { room = "kitchen", wall = "north", at = 0.5 }
table = { model = "breakfast_table", room = "living_room", position = [5.0, 2.0], yaw = 90.0 }
chair = { model = "straight_chair", in_front_of = "table" }

[objects]                                          # loose objects, sampled when the home has been built
mug = "(on_top mug table)"
plate = { model = "plate/plate_01", count = 2, where = "(on_top plate table)" }

conditions = ["(open fridge)"]                     # at the top of the file: what holds at the start, too
"""

from __future__ import annotations

import difflib
import math
import os
import pathlib
import re
import tomllib
import typing
from collections.abc import Collection, Mapping
from typing import Any, Literal, TypeVar

import msgspec

from ig2mj.errors import InputError
from ig2mj.files.content import read_text

Side = Literal["north", "south", "east", "west"]
Point = tuple[float, float]

NAME = re.compile(r"[A-Za-z][A-Za-z0-9_-]{0,62}")
"""Of furniture and objects."""
LARGEST = 50.0
"""m: no coordinate of a home is farther from the origin, so that its maps fit into memory."""
MOST_COPIES = 50
"""Of one object."""
OUTSIDE = "outside"
WORDS = {
    "Invalid enum value": "it cannot be",
    "`": "'",
    "Object": "It",
    "array": "list",
    " | null": "",
    "Expected": "expected",
}
"""Words of msgspec's errors, and those for a reader of TOML."""


class DoorSpec(msgspec.Struct, forbid_unknown_fields=True):
    """between: two rooms, or a room and "outside". wall: of the first room, where several would do. at: x or y of its
    middle, m. model: number of the model of the catalogue. into: the room that it opens into."""

    between: tuple[str, str]
    wall: Side | None = None
    at: float | None = None
    model: int = 0
    into: str | None = None


class WindowSpec(msgspec.Struct, forbid_unknown_fields=True):
    """wall: an outer one of the room. at: x or y of its middle, m; default: the middle of the wall's longest piece."""

    room: str
    wall: Side
    at: float | None = None
    model: int = 0


class PassageSpec(msgspec.Struct, forbid_unknown_fields=True):
    """width: m; None: no wall stands between the two rooms."""

    between: tuple[str, str]
    at: float | None = None
    width: float | None = None


class PieceSpec(msgspec.Struct, forbid_unknown_fields=True):
    """One piece of furniture.

    Attributes:
      model: a category, "category/model" of the catalogue, or a folder that `ig2mj convert object` wrote; None: the
        piece's name without its number.
      room: where it stands; needed unless it stands at or on another piece.
      wall: its back is to it. at: x or y of its middle along the wall, m. height: of its lower edge, m, where it hangs.
      position: x, y of its middle, m. yaw: degrees of its front against the x axis.
      left_of, right_of: a piece that it stands next to, seen by who looks at that piece's front. in_front_of: a piece
        whose front it faces, `distance` m away and `along` m to the left of that front's middle. side: another side of
        that piece than its front. on: a piece that it stands on.
      fixed: to the house; None: as the catalogue or the folder says.
    """

    model: str | None = None
    room: str | None = None
    wall: Side | None = None
    at: float | None = None
    height: float = 0.0
    position: Point | None = None
    yaw: float | None = None
    left_of: str | None = None
    right_of: str | None = None
    in_front_of: str | None = None
    side: Literal["front", "left", "right", "back"] = "front"
    distance: float = 0.05
    along: float = 0.0
    on: str | None = None
    fixed: bool | None = None


class LooseSpec(msgspec.Struct, forbid_unknown_fields=True):
    """A loose object. model: as of a piece; also of the object library. where: conditions as of `ig2mj sample`, in
    which the object's own name stands for each of its `count` copies."""

    where: str | list[str]
    model: str | None = None
    count: int = 1


class HomeDescription(msgspec.Struct, forbid_unknown_fields=True):
    """A home. file: where it was read. doors, windows: None: found as for the homes that ship."""

    file: str
    name: str
    rooms: dict[str, tuple[float, float, float, float]]
    seed: int = 0
    doors: list[DoorSpec] | None = None
    windows: list[WindowSpec] | None = None
    passages: list[PassageSpec] = []
    furniture: dict[str, PieceSpec] = {}
    objects: dict[str, LooseSpec] = {}
    conditions: list[str] = []

    @property
    def folder(self) -> pathlib.Path:
        """Folders of the file's models are below it, or absolute."""
        return pathlib.Path(self.file).parent

    def error(self, element: str, problem: str, fix: str = "") -> InputError:
        """An error of an element of the file, such as "furniture.table.at"."""
        return InputError(self.file, problem, element=element, fix=fix)

    def unknown(self, element: str, kind: str, name: str, known: Collection[str]) -> InputError:
        """The error of a name that does not exist, with near matches."""
        return InputError(self.file, f"no {kind} is named '{name}'{near(name, known)}", element=element)


def near(name: str, known: Collection[str], few: int = 20) -> str:
    """The end of an error: names that are like a wrong one, else all where they are few."""
    parts = [other for other in known if len(name) > 2 and name in other.split("_")]
    found = list(dict.fromkeys([*parts[:3], *difflib.get_close_matches(name, list(known), n=3, cutoff=0.5)]))
    if found:
        return f"; near matches: {', '.join(found)}"
    return f" (there is {', '.join(known)})" if known and len(known) <= few else ""


def read_home(file: str | os.PathLike) -> HomeDescription:
    """Reads the TOML of a home.

    Raises:
      InputError: it names the file, the table and the key: no TOML, an unknown key, a value of another kind.
    """
    path = pathlib.Path(file)
    text = read_text(path, fix="name the TOML of a home; `ig2mj homes make --help` shows one")
    try:
        given = tomllib.loads(text)
    except (ValueError, RecursionError) as e:
        raise InputError(path, f"is not TOML: {e}") from e
    return home_of(given, path)


def home_of(given: Mapping[str, Any], file: str | os.PathLike) -> HomeDescription:
    """A home from the tables of its file. Raises InputError."""
    known = [field for field in HomeDescription.__struct_fields__ if field != "file"]
    for key in given:
        if key not in known:
            raise InputError(file, f"no table or key of a home is named '{key}'{near(key, known)}", element=key)
    if not isinstance(given.get("rooms"), dict) or not given["rooms"]:
        raise InputError(file, "a home needs rooms", element="rooms", fix="kitchen = [0, 0, 3, 4]: x0, y0, x1, y1 in m")
    home = HomeDescription(
        file=str(file),
        name=_converted(given.get("name", pathlib.Path(file).stem), str, file, "name"),
        seed=_converted(given.get("seed", 0), int, file, "seed"),
        rooms={
            name: _converted(rect, tuple[float, float, float, float], file, f"rooms.{name}")
            for name, rect in given["rooms"].items()
        },
        doors=_list(given, "doors", DoorSpec, file),
        windows=_list(given, "windows", WindowSpec, file),
        passages=_list(given, "passages", PassageSpec, file) or [],
        furniture=_tables(given, "furniture", PieceSpec, file),
        objects=_tables(given, "objects", LooseSpec, file, short="where"),
        conditions=_converted(given.get("conditions", []), list[str], file, "conditions"),
    )
    _check(home)
    return home


Kind = TypeVar("Kind")


def _converted(value: Any, kind: type[Kind], file: object, element: str) -> Kind:
    """A value of a type of msgspec. Raises InputError."""
    fields = getattr(kind, "__struct_fields__", None)
    if fields is not None and isinstance(value, dict):
        for key in value:
            if key not in fields:
                problem = f"no key of it is named '{key}'{near(key, fields)}"
                raise InputError(file, problem, element=f"{element}.{key}")
    try:
        found = msgspec.convert(value, kind)
    except msgspec.ValidationError as e:
        text, _, at = str(e).partition(" - at `$")
        inner = at.removesuffix("`").replace("[...]", "")
        for word, plain in WORDS.items():
            text = text.replace(word, plain)
        options = _options(kind, inner.removeprefix("."))
        fix = f"use {', '.join(options[:-1])} or {options[-1]}" if options else ""
        raise InputError(file, text, element=f"{element}{inner}", fix=fix) from e
    _check_finite(found, file, element)
    return found


def _options(kind: Any, field: str) -> list[str]:
    """The words that a key can be, if it is a choice of words."""
    if not hasattr(kind, "__struct_fields__"):
        return []
    types = [f.type for f in msgspec.structs.fields(kind) if f.name == field]
    parts = [part for type_ in types for part in (type_, *typing.get_args(type_))]
    return [str(word) for part in parts if typing.get_origin(part) is Literal for word in typing.get_args(part)]


def _check_finite(value: Any, file: object, element: str) -> None:
    """Refuses numbers that are not finite, or no place in a home."""
    if isinstance(value, msgspec.Struct):
        for name in value.__struct_fields__:
            _check_finite(getattr(value, name), file, f"{element}.{name}")
    elif isinstance(value, tuple):
        for number in value:
            _check_finite(number, file, element)
    elif isinstance(value, float) and not (math.isfinite(value) and abs(value) <= 720.0):
        raise InputError(file, f"{value} is no number that can stand here", element=element)


def _list(given: Mapping[str, Any], key: str, kind: type[Kind], file: object) -> list[Kind] | None:
    if key not in given:
        return None
    if not isinstance(given[key], list):
        raise InputError(file, f"write [[{key}]] for each, or {key} = []", element=key)
    return [_converted(value, kind, file, f"{key}[{number}]") for number, value in enumerate(given[key])]


def _tables(given: Mapping[str, Any], key: str, kind: type[Kind], file: object, short: str = "") -> dict[str, Kind]:
    """Tables by name. short: the key that a plain text stands for."""
    tables = given.get(key, {})
    if not isinstance(tables, dict):
        raise InputError(file, f"must be a table: [{key}]", element=key)
    found = {}
    for name, value in tables.items():
        if not NAME.fullmatch(name):
            problem = f"'{name[:60]}' is no name: letters, digits, _ and -, a letter first"
            raise InputError(file, problem, element=key)
        if short and isinstance(value, str | list):
            value = {short: value}
        found[name] = _converted(value, kind, file, f"{key}.{name}")
    return found


def _check(home: HomeDescription) -> None:
    """What holds between keys. Raises InputError."""
    if not NAME.fullmatch(home.name):
        problem = f"'{home.name[:60]}' is no name: letters, digits, _ and -, a letter first"
        raise home.error("name", problem, fix='name = "my_home"')
    for name in home.objects:
        if name in home.furniture:
            raise home.error(f"objects.{name}", "is also the name of furniture", fix="names of a home differ")
    for name, loose in home.objects.items():
        if not 1 <= loose.count <= MOST_COPIES:
            raise home.error(f"objects.{name}.count", f"is {loose.count}; 1 to {MOST_COPIES} are possible")
        if not loose.where:
            raise home.error(f"objects.{name}.where", "says nothing", fix=f'"(on_top {name} table)", for example')


def copies(name: str, loose: LooseSpec) -> list[str]:
    """The names in the scene of an object's copies."""
    return [name] if loose.count == 1 else [f"{name}_{k}" for k in range(loose.count)]


def category_of(name: str, spec: PieceSpec | LooseSpec) -> str:
    """What the file says a piece or an object is: its `model`, else its name without a number at the end."""
    return spec.model if spec.model is not None else re.sub(r"_\d+$", "", name)
