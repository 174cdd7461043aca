"""`--annotations FILE`: a TOML file that says what an object can do, and where its functional parts are.

[abilities]
heatSource = { temperature = 180.0, requires_toggled_on = true }
toggleable = true
dustyable = false              # taken away from what the category has

[links.heat_source]            # a point: metres in the frame of the URDF's base link
pos = [0.0, 0.1, 0.05]

[links.cleaning_tool_area]     # a box: its centre and its size, turned by roll, pitch and yaw in degrees
pos = [0.0, 0.0, 0.01]
size = [0.1, 0.06, 0.02]
rpy = [0.0, 0.0, 90.0]
"""

from __future__ import annotations

import dataclasses
import math
import pathlib
import tomllib
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from ig2mj.errors import InputError, UnknownNameError
from ig2mj.knowledge import ABILITIES, required_links
from ig2mj.knowledge.overrides import Changes, Parameters, check_parameters

from ..base.description import MetaLink, ObjectModel
from ..base.text import without_mark
from ..base.xml_reader import read_bytes
from .json_reader import vector

POINTS = ("heat_source", "toggle_button", "water_source", "water_sink")
BOXES = ("slicer", "cleaning_tool_area")
"""Kinds of links: a point, or a box that collides with what it cuts or cleans."""

MAX_BYTES = 2**20
FAR = 0.5
"""m outside of an object's box from which on an annotated link is probably not meant to be there."""

_FIX = "docs/guide/objects.md shows such a file"


@dataclasses.dataclass(frozen=True)
class Annotations:
    """Contents of a file. Attributes: abilities: changes of what the category has. links: by kind."""

    abilities: Changes
    links: dict[str, MetaLink]


def read_annotations(file: pathlib.Path) -> Annotations:
    """Raises InputError: no such file, no TOML, an unknown ability, parameter or kind of link, or a wrong value."""
    try:
        found = tomllib.loads(without_mark(read_bytes(file, MAX_BYTES)).decode("utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as e:
        raise InputError(file, f"is not TOML ({e})", fix=_FIX) from e
    _check_names("table", found, ("abilities", "links"), file, "")
    return Annotations(
        {name: _ability(name, value, file) for name, value in _table(found, "abilities", file).items()},
        {kind: _link(kind, value, file) for kind, value in _table(found, "links", file).items()},
    )


def annotate(model: ObjectModel, annotations: Annotations) -> None:
    """Gives a model its annotations; they replace links of metadata.json of the same kind."""
    model.abilities = dict(annotations.abilities)
    model.metadata.links |= annotations.links


def annotation_warnings(model: ObjectModel, low: np.ndarray, high: np.ndarray) -> list[str]:
    """What is probably not meant, of a model with annotations, in words.

    Args:
      low, high: corners [3] of the object's box in the frame of its base link, in its source's units.
    """
    found = []
    for kind, link in model.metadata.links.items():
        away = float(np.max(np.maximum(low - link.xyz, link.xyz - high)))
        if away > FAR:
            box = f"{_numbers(low)} to {_numbers(high)}"
            found.append(f"link '{kind}' is {away:.2f} m outside of the object, whose box is {box}")
    for ability, parameters in model.abilities.items():
        if parameters is None:
            continue
        for kind in required_links(ability, parameters):
            if kind not in model.metadata.links:
                found.append(f"ability '{ability}' has no effect without the link '{kind}': annotate it")
    return found


def _ability(name: str, value: Any, file: pathlib.Path) -> Parameters | None:
    element = f"abilities.{name}"
    if name not in ABILITIES:
        raise _unknown("ability", name, ABILITIES, file, element)
    if not isinstance(value, bool | dict):
        raise InputError(file, f"is {value!r}", element=element, fix="true, false, or a table of its parameters")
    if isinstance(value, bool):
        return {} if value else None
    parameters: Parameters = {}
    for key, given in value.items():
        if not isinstance(given, bool | int | float) or not math.isfinite(given):
            raise InputError(file, f"is {given!r}", element=f"{element}.{key}", fix="a finite number, or true or false")
        parameters[key] = given if isinstance(given, bool) else float(given)
    check_parameters(file, element, name, parameters)
    return parameters


def _link(kind: str, value: Any, file: pathlib.Path) -> MetaLink:
    element = f"links.{kind}"
    if kind not in (*POINTS, *BOXES):
        raise _unknown("kind of link", kind, (*POINTS, *BOXES), file, element)
    if not isinstance(value, dict):
        raise InputError(file, f"is {value!r}", element=element, fix="a table with pos, and of a box size and rpy")
    box = kind in BOXES
    _check_names("key", value, ("pos", "size", "rpy") if box else ("pos",), file, element)
    for key in ("pos", "size") if box else ("pos",):
        if key not in value:
            raise InputError(file, f"has no {key}", element=element, fix=f"{key} = [x, y, z] in metres")
    pos = vector(value["pos"], 3, file, f"{element}.pos")
    if not box:
        return MetaLink(kind, pos)
    size = vector(value["size"], 3, file, f"{element}.size")
    if np.any(size <= 0):
        raise InputError(file, f"is {_numbers(size)}", element=f"{element}.size", fix="give positive metres")
    rpy = np.radians(vector(value.get("rpy", [0.0, 0.0, 0.0]), 3, file, f"{element}.rpy"))
    return MetaLink(kind, pos, rpy, size, "box")


def _table(found: Mapping[str, Any], name: str, file: pathlib.Path) -> dict[str, Any]:
    value = found.get(name, {})
    if not isinstance(value, dict):
        raise InputError(file, f"is {value!r} and no table", element=name, fix=_FIX)
    return value


def _check_names(kind: str, found: Iterable[str], known: Iterable[str], file: pathlib.Path, element: str) -> None:
    names = list(known)
    for name in found:
        if name not in names:
            raise _unknown(kind, name, names, file, f"{element}.{name}" if element else name)


def _unknown(kind: str, name: str, known: Iterable[str], file: pathlib.Path, element: str) -> InputError:
    return InputError(file, str(UnknownNameError(kind, name, sorted(known))), element=element)


def _numbers(values: np.ndarray) -> str:
    return ", ".join(f"{v:.3g}" for v in values)
