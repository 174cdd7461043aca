"""Substances: what fills containers and covers objects. A table in a data file, which a project's own file may extend.

A file has up to three kinds, each with a colour and names:

    {"liquid": {"names": {"elderberry_syrup": {"freeze": -4, "colour": [0.4, 0, 0.3], "cleaned_by": ["water"]}}}}

"liquid" and "granular" ones have volumes and cover; "visual" ones only cover. `cleaned_by` names what a cleaning tool
must be saturated with to remove it, any of them; "dry" means every tool. What is left out: a liquid and a visual one go
with water or soap, an oil (`"oil": true`) with soap, a granular one with every tool. `freeze` is in Celsius: 0 of a
liquid.
"""

from __future__ import annotations

import dataclasses
import functools
import os
import pathlib
import re
from collections.abc import Mapping
from typing import Any, Literal

from ig2mj.errors import InputError, UnknownNameError
from ig2mj.files.content import read_json

Kind = Literal["liquid", "granular", "visual"]
KINDS: tuple[Kind, ...] = ("liquid", "granular", "visual")

DERIVED = ("cooked__", "diced__", "melted__")
"""Beginnings of names of what a known substance, or a kind of food, becomes. A derived one has the look of its base."""

WATER, DUST, STAIN = "water", "dust", "stain"

DRY = "dry"
"""Of `Substance.cleaned_by`: no solvent is needed."""

SOAPS = ("liquid_soap", "detergent", "shampoo", "saddle_soap")

FILL = 0.6
"""Share of a container's litres that it holds when it is filled at the start."""

COOKED_DARKER = 0.75
"""Factor of a base's colour."""

_NAME = re.compile(r"[A-Za-z][\w-]*")


@dataclasses.dataclass(frozen=True)
class Substance:
    """One substance.

    Attributes:
      name: snake_case. kind: see the module's text. colour: red, green, blue, 0 to 1.
      freeze: Celsius at and below which it is solid and does not flow; None: never.
      cleaned_by: any of these in a tool removes it from objects; `DRY`: every tool does.
    """

    name: str
    kind: Kind
    colour: tuple[float, float, float]
    freeze: float | None
    cleaned_by: tuple[str, ...]

    @property
    def has_volume(self) -> bool:
        """Whether it can be in containers."""
        return self.kind != "visual"


_added: dict[str, Substance] = {}


def substances() -> dict[str, Substance]:
    """All by name, shipped ones and those of `load_substances`, without derived ones."""
    return {**_shipped(), **_added}


def substance(name: str) -> Substance:
    """The substance of a name, or one derived from a known one ("cooked__white_rice", "diced__apple").

    Raises:
      UnknownNameError: there is none.
    """
    known = substances()
    if name in known:
        return known[name]
    for prefix in DERIVED:
        if name.startswith(prefix) and _NAME.fullmatch(base := name.removeprefix(prefix)):
            inner = known.get(base) or (substance(base) if base.startswith(DERIVED) else None)
            if inner is None:  # of food that is an object until it is cut
                return Substance(name, "granular", (0.75, 0.55, 0.35), None, (DRY,))
            red, green, blue = (COOKED_DARKER * c if prefix == "cooked__" else c for c in inner.colour)
            kind: Kind = "liquid" if prefix == "melted__" else inner.kind
            return dataclasses.replace(inner, name=name, kind=kind, colour=(red, green, blue))
    raise UnknownNameError("substance", name, known)


def load_substances(file: str | os.PathLike) -> tuple[str, ...]:
    """Adds a file's substances for the rest of this process; their names.

    Raises:
      InputError: the file cannot be read, or an entry is wrong; it names the entry.
    """
    found = _read(read_json(file, fix="name a JSON file of substances"), file)
    for name, made in found.items():
        if substances().get(name, made) != made:
            raise InputError(file, "says otherwise than the substance that is known", element=name, fix="rename it")
    _added.update(found)
    return tuple(found)


@functools.cache
def _shipped() -> dict[str, Substance]:
    file = pathlib.Path(__file__).with_name("substances.json")
    return _read(read_json(file), file)


def _read(said: Any, file: str | os.PathLike) -> dict[str, Substance]:
    if not isinstance(said, Mapping) or not set(said) <= set(KINDS):
        raise InputError(file, f"must have the keys {', '.join(KINDS)} and no others")
    found: dict[str, Substance] = {}
    for kind in KINDS:
        entries = said.get(kind, {})
        if not isinstance(entries, Mapping) or not isinstance(entries.get("names", {}), Mapping):
            raise InputError(file, "needs 'names', a mapping", element=kind)
        usual = entries.get("colour", [0.6, 0.6, 0.6])
        for name, entry in entries.get("names", {}).items():
            found[name] = _substance(name, kind, entry, usual, file)
    return found


def _substance(name: str, kind: Kind, entry: Any, usual: Any, file: str | os.PathLike) -> Substance:
    known = {"colour", "freeze", "cleaned_by", "oil"}
    if not _NAME.fullmatch(name) or not isinstance(entry, Mapping) or not set(entry) <= known:
        raise InputError(file, f"must be a name with any of {', '.join(sorted(known))}", element=str(name)[:60])
    colour, freeze = entry.get("colour", usual), entry.get("freeze", 0.0 if kind == "liquid" else None)
    if not isinstance(colour, list) or len(colour) != 3 or not all(_is_number(c) and 0 <= c <= 1 for c in colour):
        raise InputError(file, "has a colour that is not three numbers from 0 to 1", element=name)
    if freeze is not None and not _is_number(freeze):
        raise InputError(file, "has a freezing point that is not a number", element=name)
    by = entry.get("cleaned_by", _usual_cleaners(kind, bool(entry.get("oil"))))
    if not isinstance(by, list | tuple) or not by or not all(isinstance(b, str) for b in by):
        raise InputError(file, "has a 'cleaned_by' that is not a list of names", element=name)
    red, green, blue = map(float, colour)
    return Substance(name, kind, (red, green, blue), None if freeze is None else float(freeze), tuple(by))


def _usual_cleaners(kind: Kind, oil: bool) -> tuple[str, ...]:
    if oil:
        return SOAPS
    return (DRY,) if kind == "granular" else (WATER, *SOAPS)


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < 1e6
