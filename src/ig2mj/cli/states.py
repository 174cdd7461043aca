"""`ig2mj states SCENE`: the extended states of a scene's objects, at the start or after some time."""

from __future__ import annotations

import math
import pathlib
import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated, Any, Literal

import tyro

if TYPE_CHECKING:
    from ig2mj.simulation import Simulation


def run(
    scene: Annotated[pathlib.Path, tyro.conf.Positional, tyro.conf.arg(metavar="SCENE")],
    only: Annotated[tuple[str, ...], tyro.conf.arg(metavar="NAME ...")] = (),
    object: Annotated[
        tuple[tuple[str, ...], ...], tyro.conf.UseAppendAction, tyro.conf.arg(metavar="DIR|NAME[@PLACE]")
    ] = (),
    state: Annotated[tuple[str, ...], tyro.conf.arg(metavar="STATE ...")] = (),
    set: Annotated[tuple[str, ...], tyro.conf.arg(metavar="STATE=OBJECT[=VALUE] ...")] = (),
    seconds: Annotated[float, tyro.conf.arg(metavar="S")] = 0.0,
    compat: Literal["paper", "igibson"] = "paper",
    json: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False,
) -> None:
    """List the extended states of a scene's objects.

    By default all objects that have extended states are listed, without poses, boxes and contacts.

    Args:
      scene: folder of a converted scene, its scene.xml, or the name of a home that comes with ig2mj.
      only: only these objects, with all their states.
      object: {object}.
      state: only these states, e.g. temperature in_contact_objs.
      set: set states first, e.g. toggled_on=stove_0 or temperature=fish_0=80.
      seconds: simulate this many seconds first.
      compat: follow the paper, or iGibson's code where the two differ.
      json: print JSON instead of a table.
    """
    from ig2mj.cli.common.printing import print_json
    from ig2mj.cli.common.worlds import started
    from ig2mj.errors import UnknownNameError
    from ig2mj.states import registry

    added, named = _added(scene, [text for texts in object for text in texts])
    only = (*only, *named)

    def check(world: Simulation) -> None:
        for name in only:
            if name not in world.scene.object_names:
                raise UnknownNameError("object", name, world.scene.object_names)

    if state:
        names = [registry.find(s).name for s in state]
    else:
        # Those that every object has fill a table by themselves: poses, boxes, contacts, rooms.
        names = [s.name for s in registry.STATES.values() if only or s.abilities is not None]
    world = started(scene, compat, seconds, set, check, added)
    rows: dict[str, dict[str, Any]] = {}
    for name in names:
        kind = registry.STATES[name]
        for o in only or world.scene.object_names:
            if kind.belongs_to(world.state_model, world.scene.object_index(o)):
                rows.setdefault(o, {})[name] = world.state(name, o)
    if json:
        print_json({"name": world.scene.name, "time": round(world.time, 6), "objects": rows})
    else:
        _print_table(world, names, rows)


def _added(scene: pathlib.Path, given: Sequence[str]) -> tuple[list[str], list[str]]:
    """Values of `--object`: what is added to the home, and objects of the home, which `--only` names."""
    from ig2mj.process.deprecation import rename_text
    from ig2mj.scene.manifest import load_manifest
    from ig2mj.scene.paths import scene_folder

    own = {o.name for o in load_manifest(scene_folder(scene)).objects} if given else ()
    named = [text for text in given if text in own]
    if named:
        print(f"ig2mj states: {rename_text(f'--object {named[0]}', f'--only {named[0]}')}", file=sys.stderr)
    return [text for text in given if text not in own], named


def _print_table(world: Simulation, names: list[str], rows: dict[str, dict[str, Any]]) -> None:
    """One column for each state; where that does not fit, one line for each object that lists its states."""
    from ig2mj.cli.common.printing import least_width, make_table, stdout_console
    from ig2mj.states.registry import STATES

    used = [n for n in names if any(n in r for r in rows.values())]
    columns = ["object", *(f"{n} [{STATES[n].unit}]" if STATES[n].unit else n for n in used)]
    body = [[o, *(_text(values[n]) if n in values else "" for n in used)] for o, values in rows.items()]
    console = stdout_console()
    if least_width(columns, body) > console.width:
        columns = ["object", "states"]
        body = [[o, ", ".join(_named(n, v, STATES[n].unit) for n, v in values.items())] for o, values in rows.items()]
    title = f"{world.scene.name}, {world.time:.2f} s: {len(rows)} object{'s' * (len(rows) != 1)}"
    console.print(make_table(title, columns, body))


def _named(name: str, value: Any, unit: str) -> str:
    """E.g. "temperature 23 C"; units that are words are left to the wide table."""
    text = _text(value)
    return f"{name} {text} {unit}" if len(unit) == 1 and text != "-" else f"{name} {text}"


def _text(value: Any) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:.4g}" if math.isfinite(value) else "-"
    if isinstance(value, (list, tuple)):
        return "-" if not value else ", ".join(_text(v) for v in value)
    return str(value)
