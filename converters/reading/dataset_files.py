"""The small files of a dataset root: VERSION, metadata/*, misc/bbox_overlap.json (iGibson's dataset format)."""

from __future__ import annotations

import dataclasses
import pathlib
import re
from typing import Any

from ig2mj.errors import InputError

from ..base import inputs
from ..base.text import decoded
from ..base.xml_reader import read_bytes
from .json_reader import read_json, scalar, vector

OLDEST, BEYOND = (2, 0, 6), (2, 2, 3)
"""iGibson 2.2.2 accepts OLDEST <= VERSION < BEYOND."""
ALWAYS_THERE = "floor.n.01"  # iGibson puts it before non_sampleable_categories.txt


@dataclasses.dataclass(frozen=True)
class CategorySpec:
    """One entry of avg_category_specs.json: size [3] m, mass kg, density kg/m^3 of the bounding box."""

    size: tuple[float, float, float] | None
    mass: float | None
    density: float | None
    enable_ag: bool


def read_version(root: pathlib.Path, warnings: list[str]) -> str | None:
    """Text of VERSION; a missing or unknown one is a warning."""
    file = root / "VERSION"
    if not inputs.is_file(file):
        warnings.append("the dataset has no VERSION file")
        return None
    text = decoded(read_bytes(file, 4096)).strip()
    match = re.match(r"v?(\d+)\.(\d+)(?:\.(\d+))?", text)
    version = None if match is None else tuple(int(n or 0) for n in match.groups())
    if version is None or not OLDEST <= version < BEYOND:
        warnings.append(f"dataset version '{text[:40]}' is not between 2.0.6 and 2.2.2")
    return text


def read_lines(root: pathlib.Path, name: str, warnings: list[str]) -> list[str]:
    """Lines of metadata/<name>, trailing empty ones dropped; a missing file is a warning and no lines.

    Empty lines in between stay: a line's number is its meaning. non_sampleable_categories.txt gets floor.n.01 first.
    """
    file = root / "metadata" / name
    if not inputs.is_file(file):
        warnings.append(f"metadata/{name} is missing")
        return []
    lines = [line.strip() for line in decoded(read_bytes(file, 2**22)).splitlines()]
    while lines and not lines[-1]:
        lines.pop()
    if name == "non_sampleable_categories.txt":
        lines = [ALWAYS_THERE, *(line for line in lines if line and line != ALWAYS_THERE)]
    return lines


def read_specs(root: pathlib.Path, warnings: list[str]) -> dict[str, CategorySpec]:
    """metadata/avg_category_specs.json; a missing file is a warning and no specs.

    Raises:
      InputError: it is not JSON, or a number is not positive.
    """
    file = root / "metadata" / "avg_category_specs.json"
    if not inputs.is_file(file):
        warnings.append("metadata/avg_category_specs.json is missing; every category gets the default density")
        return {}
    return {name: _spec(entry, file, f"category '{name}'") for name, entry in read_json(file, dict).items()}


def _spec(entry: Any, file: pathlib.Path, at: str) -> CategorySpec:
    if not isinstance(entry, dict):
        raise InputError(file, "is not an object with size, mass, density, enable_ag", element=at)
    values: dict[str, float | None] = {}
    for key in ("mass", "density"):
        raw = entry.get(key)
        values[key] = None if raw is None else scalar(raw, file, f"{at} '{key}'")
        if (value := values[key]) is not None and value <= 0:
            raise InputError(file, f"{key} {value:g} is not positive", element=at)
    size = None
    if entry.get("size") is not None:
        x, y, z = (float(v) for v in vector(entry["size"], 3, file, f"{at} 'size'"))
        size = (x, y, z)
        if values["density"] is None and values["mass"] is not None and x * y * z > 0:
            values["density"] = values["mass"] / (x * y * z)
    return CategorySpec(size, values["mass"], values["density"], bool(entry.get("enable_ag", False)))


def read_overlaps(file: pathlib.Path) -> set[frozenset[str]]:
    """bbox_overlap.json: pairs of instances whose boxes may overlap; empty where there is no file."""
    if not inputs.is_file(file):
        return set()
    pairs = set()
    for i, pair in enumerate(read_json(file, list)):
        if not isinstance(pair, list) or len(pair) != 2 or not all(isinstance(name, str) for name in pair):
            raise InputError(file, "is not a pair of names", element=f"entry {i}")
        pairs.add(frozenset(pair))
    return pairs
