"""Overrides: abilities and parameters that differ from the taxonomy's, per category and per model.

The paper lets thresholds "be adapted per object category and model" (tables A.1 and A.4). The shipped file is
`overrides.json`; a project can keep one of its own and read it with `load_overrides`. Its form:

    {"categories": {CATEGORY: {ABILITY: {PARAMETER: VALUE} | null}},   null takes the ability away
     "models": {"CATEGORY/MODEL": {ABILITY: {PARAMETER: VALUE} | null}},
     "compat": {"igibson": {CATEGORY: {ABILITY: {PARAMETER: VALUE}}}},  used with compat="igibson" only
     "also_accepts": {SYNSET: [SYNSET, ...]}}
"""

from __future__ import annotations

import functools
import os
import pathlib

import msgspec

from ig2mj.errors import InputError
from ig2mj.files.content import read_struct
from ig2mj.knowledge.ability_table import ABILITIES

Parameters = dict[str, float | bool]
Changes = dict[str, Parameters | None]


class Overrides(msgspec.Struct, forbid_unknown_fields=True):
    """Contents of an overrides file; see the module's docstring."""

    categories: dict[str, Changes] = {}
    models: dict[str, Changes] = {}
    compat: dict[str, dict[str, Changes]] = {}
    also_accepts: dict[str, list[str]] = {}


def load_overrides(path: str | os.PathLike) -> Overrides:
    """Reads and checks an overrides file.

    Raises:
      InputError: it cannot be read, is not JSON, does not fit the form, or names an ability or a parameter that does
        not exist or has the wrong type.
    """
    file = pathlib.Path(path)
    overrides = read_struct(file, Overrides, fix="see ig2mj.knowledge.overrides for the form")
    tables = [overrides.categories, overrides.models, *overrides.compat.values()]
    for key, changes in ((k, c) for table in tables for k, c in table.items()):
        for ability, parameters in changes.items():
            check_parameters(file, f"'{key}': {ability}", ability, parameters or {})
    return overrides


def check_parameters(file: pathlib.Path, element: str, ability: str, parameters: Parameters) -> None:
    """Raises InputError: no such ability, or a parameter that it does not have or that is of another type."""
    if ability not in ABILITIES:
        raise InputError(
            file, "is not an ability", element=element, fix=f"abilities are {', '.join(sorted(ABILITIES))}"
        )
    known = ABILITIES[ability].defaults
    for name, value in parameters.items():
        if name not in known:
            have = ", ".join(known) or "none"
            raise InputError(file, f"has no parameter '{name}'", element=element, fix=f"its parameters: {have}")
        if isinstance(value, bool) != isinstance(known[name], bool):
            requested = "true or false" if isinstance(known[name], bool) else "a number"
            raise InputError(file, f"parameter '{name}' is {value!r}", element=element, fix=f"give {requested}")


@functools.cache
def shipped_overrides() -> Overrides:
    """The overrides that come with ig2mj."""
    return load_overrides(pathlib.Path(__file__).with_name("overrides.json"))
