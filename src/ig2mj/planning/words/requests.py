"""Requests to primitives as data: `tools` describes them for function calling, `read_script` reads a list of them."""

from __future__ import annotations

import pathlib
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import msgspec

from ig2mj.errors import InputError, UnknownNameError
from ig2mj.planning.steps import PRIMITIVES, SUBSTANCE, Step, make_step
from ig2mj.scene.tables import SceneTables

MOST_BYTES, MOST_REQUESTS = 1 << 20, 10_000
"""Size of a script, and requests in it, at most."""

FIX = 'give a JSON array such as [{"name": "grasp", "arguments": {"object": "apple_0"}}]'


class _Request(msgspec.Struct, forbid_unknown_fields=True):
    name: str
    arguments: dict[str, str] = {}


def tools(tables: SceneTables | None = None, substances: Sequence[str] | None = None) -> list[dict[str, Any]]:
    """The primitives as functions that a language model can call, each with a JSON schema of its arguments.

    Args:
      tables: of a scene whose names of objects and rooms are listed as the only values; None: any text.
      substances: that are in use in it (`Scene.substances`), listed likewise; None: any text.
    """
    found = []
    for primitive in PRIMITIVES.values():
        properties = {name: _argument(name, tables, substances) for name in primitive.arguments}
        found.append(
            {
                "type": "function",
                "function": {
                    "name": primitive.name,
                    "description": f"Needs: {primitive.before}. Ends when: {primitive.until}.",
                    "parameters": {
                        "type": "object",
                        "properties": properties,
                        "required": list(primitive.arguments),
                        "additionalProperties": False,
                    },
                },
            }
        )
    return found


def _argument(name: str, tables: SceneTables | None, substances: Sequence[str] | None) -> dict[str, Any]:
    if name == "room":
        schema: dict[str, Any] = {"type": "string", "description": "name of a room of the scene"}
        names = None if tables is None else list(tables.room_names)
    elif name == SUBSTANCE:
        schema = {"type": "string", "description": "name of a substance that is in use in the scene"}
        names = None if substances is None else list(substances)
    else:
        schema = {"type": "string", "description": f"name of an object of the scene: the {name}"}
        names = None if tables is None else list(tables.object_names)
    return schema if names is None else schema | {"enum": names}


def step_of(name: str, arguments: Mapping[str, str]) -> Step:
    """The step that a function call asks for.

    Args:
      name: of a primitive. arguments: by the names that `tools` gives them.

    Raises:
      UnknownNameError: no such primitive or argument. PlanningError: an argument is missing.
    """
    if name not in PRIMITIVES:
        raise UnknownNameError("primitive", name, PRIMITIVES)
    known = PRIMITIVES[name].arguments
    for argument in arguments:
        if argument not in known:
            raise UnknownNameError(f"argument of '{name}'", argument, known)
    return make_step(name, [arguments[a] for a in known if a in arguments])


def read_script(file: pathlib.Path) -> list[Step]:
    """The steps of a JSON array of {"name": ..., "arguments": {...}}.

    Raises:
      InputError: the file is not such an array. UnknownNameError, PlanningError: see `step_of`.
    """
    try:
        data = file.read_bytes() if file.stat().st_size <= MOST_BYTES else None
    except OSError as e:
        raise InputError(file, e.strerror or "cannot be read") from e
    if data is None:
        raise InputError(file, f"is larger than {MOST_BYTES >> 20} MiB", fix=FIX)
    try:
        requests = msgspec.json.decode(data, type=list[_Request])
    except msgspec.MsgspecError as e:
        raise InputError(file, f"is not a script: {e}", fix=FIX) from e
    if len(requests) > MOST_REQUESTS:
        raise InputError(file, f"has {len(requests)} requests", fix=f"give at most {MOST_REQUESTS}")
    return [step_of(r.name, r.arguments) for r in requests]


def script_of(steps: Iterable[Step]) -> list[dict[str, Any]]:
    """Steps as the array that `read_script` reads."""
    return [
        {"name": s.primitive, "arguments": dict(zip(PRIMITIVES[s.primitive].arguments, s.arguments, strict=True))}
        for s in steps
    ]
