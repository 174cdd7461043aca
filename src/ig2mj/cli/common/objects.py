"""The options `--object`, `--remove`, `--replace` and `--substances` of every command that loads a home, several times
each: what is added to it, what is taken out of it, what takes the place of what, and what its containers can hold.
"""

from __future__ import annotations

import inspect
import os
import sys
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Annotated, Any

import tyro

from ig2mj.errors import Ig2mjError

if TYPE_CHECKING:
    from ig2mj.scene.scene import Agent, Scene

AddedObjects = Annotated[
    tuple[str, ...], tyro.conf.UseAppendAction, tyro.conf.arg(metavar="DIR|NAME[@PLACE]", help_behavior_hint="")
]
"""Type of the parameter `object`; `{object}` in a docstring stands for `HELP`."""

HELP = (
    "add an object, several times: a folder that `ig2mj convert object` wrote, or a name of the object library "
    "(`ig2mj objects list`), with the place where it starts: obj/mug@on_top:breakfast_table_0, or obj/mug@1,2,0.8,90 "
    "(metres, degrees); docs/guide/objects.md. --remove NAME takes an object of the home out, with what stands on it; "
    "--replace NAME=DIR|NAME puts another one in its place; --substances water,salt lets containers hold them"
)

CHANGES = {"--remove": "NAME", "--replace": "NAME=DIR, or NAME=MODEL", "--substances": "NAME,NAME"}
"""Options that are written as values of `--object` (remove:NAME, replace:NAME=MODEL, substances:NAME,NAME), and the
form of their values."""


def with_changes(function: Callable[..., Any], args: Sequence[str]) -> list[str]:
    """A command line whose changes of the home are values of `--object`, where the function has that option.

    Raises:
      Ig2mjError: an option lacks its value.
    """
    if "object" not in inspect.signature(function).parameters:
        return list(args)
    out, waiting = list[str](), list(args)
    while waiting:
        word = waiting.pop(0)
        option, equals, value = word.partition("=")
        if option not in CHANGES:
            out.append(word)
            continue
        if not equals:
            if not waiting or waiting[0].startswith("--"):
                raise Ig2mjError(f"{option} needs a value: {option} {CHANGES[option]}")
            value = waiting.pop(0)
        out += ["--object", f"{option.removeprefix('--')}:{value}"]
    return out


def load_home(
    scene: str | os.PathLike, objects: Sequence[str] = (), agents: Sequence[Agent] = (), looks: str = "day"
) -> Scene:
    """`load_scene`, with the notes of `note_changes`. Raises as `load_scene`."""
    from ig2mj.scene.scene import load_scene

    loaded = load_scene(scene, agents, objects, looks=looks)
    note_changes(loaded, objects)
    return loaded


def note_changes(scene: Scene, objects: Sequence[str]) -> None:
    """Says on stderr what the changes of a command line do to a home: what goes with an object that is taken out
    or replaced, and which objects stand outside the house, with how to place them.
    """
    from ig2mj.scene.changes import added
    from ig2mj.scene.object_requests import read_request

    gone = [name for name in scene.removed if f"remove:{name}" not in objects]
    if gone:
        print(f"note: {', '.join(gone)}: removed with what they stood on or in", file=sys.stderr)
    objects = added(objects)
    given = scene.additions[-len(objects) :] if objects else ()
    absent = [(a, text) for a, text in zip(given, objects, strict=True) if a.place is None and a.start is None]
    for addition, text in absent:
        if read_request(text).predicate is not None:
            continue  # a condition of the start states places it
        print(
            f"note: {addition.name} stands outside the house until it is put somewhere; to start in it: "
            f"--object {text}@on_top:OBJECT, or {text}@X,Y,Z,DEGREES",
            file=sys.stderr,
        )
