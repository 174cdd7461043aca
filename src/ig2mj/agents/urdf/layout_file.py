"""Entries of a layout (`ig2mj.agents.urdf.layout`): read from a file, and checked against their robot."""

from __future__ import annotations

import dataclasses
import os
import pathlib
import tomllib
from collections.abc import Mapping, Sequence
from typing import Any

from ig2mj.agents.urdf.description import Description
from ig2mj.agents.urdf.layout import BASES, CLOSED, Layout
from ig2mj.errors import InputError, UnknownNameError
from ig2mj.files.content import decode_json, read_text

MAX_POSITION = 1e6
"""rad or m of a joint's start."""

MAX_MOUNT = 3.0
"""m."""

LISTS, LINKS = ("wheels", "arm", "gripper", "suction"), ("hand", "camera", "laser")

_DERIVED = ("several", "reversed")
"""Fields of a layout that no file has."""


def read_entries(file: str | os.PathLike) -> dict[str, Any]:
    """Of a TOML or a JSON file. Raises InputError: it cannot be read."""
    path = pathlib.Path(file)
    text = read_text(path, fix="name a TOML or JSON file")
    if path.suffix.lower() == ".json":
        return decode_json(text, path, kind=dict)
    try:
        return tomllib.loads(text)
    except (ValueError, RecursionError) as e:
        raise InputError(path, f"is not TOML: {e}") from e


def check_entries(robot: Description, given: Mapping[str, Any], where: str) -> None:
    """Whether entries are known, of the right kind, and name what there is.

    Raises:
      InputError: an entry is of the wrong kind. UnknownNameError: no such entry, joint or link.
    """
    known = [*(field.name for field in dataclasses.fields(Layout) if field.name not in _DERIVED), "grippers"]
    for name, value in given.items():
        if name not in known:
            raise UnknownNameError(f"entry of {where}", name, known)
        if name == "grippers":
            _check_grippers(robot, given, where)
        elif name in LISTS:
            if not isinstance(value, list | tuple) or not all(isinstance(entry, str) for entry in value):
                what = "links" if name == "suction" else "joints"
                raise InputError(where, f"must be a list of names of {what}", element=name)
            if name == "suction":
                _check_names("link", name, value, list(robot.frames), where)
            else:
                _check_names("joint", name, value, [joint.name for joint in robot.joints], where)
        elif name == "start":
            if not isinstance(value, Mapping) or not all(_is_number(v) for v in value.values()):
                raise InputError(where, "must be a table of numbers by joint", element=name)
            _check_names("joint", name, list(value), [joint.name for joint in robot.joints], where)
        elif name == "mount":
            if not _is_number(value) or not 0 <= value <= MAX_MOUNT:
                raise InputError(where, f"must be 0 to {MAX_MOUNT:g} m", element=name)
        elif not isinstance(value, str):
            raise InputError(where, "must be a text", element=name)
        elif name in LINKS and value:
            _check_names("link", name, [value], list(robot.frames), where)
        elif name in ("base", "closed") and value not in (choices := BASES if name == "base" else CLOSED):
            raise InputError(
                where, f"is '{value}'", element=name, fix=f"use {', '.join(choices[:-1])} or {choices[-1]}"
            )


def _check_grippers(robot: Description, given: Mapping[str, Any], where: str) -> None:
    also = sorted({"gripper", "hand", "closed"} & set(given))
    if also:
        raise InputError(where, f"has both 'grippers' and '{also[0]}'", element="grippers", fix="keep one of them")
    if not isinstance(given["grippers"], list | tuple) or not all(isinstance(g, Mapping) for g in given["grippers"]):
        raise InputError(where, "must be a list of tables with joints and a hand", element="grippers")
    for one in given["grippers"]:
        for name in ("joints", "hand"):
            if name not in one:
                raise InputError(where, f"a gripper has no '{name}'", element="grippers")
        for name in one:
            if name not in ("joints", "hand", "closed"):
                raise UnknownNameError(f"entry of grippers of {where}", name, ["joints", "hand", "closed"])
        entries = {"gripper": one["joints"]} | {name: one[name] for name in ("hand", "closed") if name in one}
        check_entries(robot, entries, where)
        if not one["joints"] or not one["hand"]:
            raise InputError(where, "a gripper has joints and a hand", element="grippers")


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= MAX_POSITION


def _check_names(kind: str, entry: str, names: Sequence[str], known: Sequence[str], where: str) -> None:
    for name in names:
        if name not in known:
            raise UnknownNameError(f"{kind} of the robot ({where}: {entry})", name, known)
