"""`ig2mj inspect SCENE`: tables of a scene's objects, joints, abilities and rooms. Reads the manifest only."""

from __future__ import annotations

import math
import pathlib
from typing import TYPE_CHECKING, Annotated, Any, Literal

import tyro

from ig2mj.cli.common.objects import AddedObjects

if TYPE_CHECKING:
    from ig2mj.scene.manifest import Manifest, ObjectEntry

Kind = Literal["objects", "joints", "abilities", "rooms"]


def run(
    scene: Annotated[pathlib.Path, tyro.conf.Positional, tyro.conf.arg(metavar="SCENE")],
    show: tuple[Kind, ...] = ("rooms", "objects", "joints", "abilities"),
    room: Annotated[str | None, tyro.conf.arg(metavar="ROOM")] = None,
    category: Annotated[str | None, tyro.conf.arg(metavar="CATEGORY")] = None,
    object: AddedObjects = (),
    json: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False,
) -> None:
    """List a scene's objects, joints, abilities and rooms.

    Args:
      scene: folder of a converted scene, its scene.xml or manifest.json, or the name of a home that comes with ig2mj.
      show: which tables to print.
      room: only objects of this room instance, e.g. kitchen_0.
      category: only objects of this category, e.g. fridge.
      object: {object}.
      json: print JSON instead of tables.
    """
    from ig2mj.cli.common.objects import load_home
    from ig2mj.scene.manifest import load_manifest
    from ig2mj.scene.paths import scene_folder

    manifest = load_home(scene, object).manifest if object else load_manifest(scene_folder(scene))
    objects = _select(manifest, room, category)
    if json:
        _print_json(manifest, objects, show)
    else:
        _print_tables(manifest, objects, show)


def _select(manifest: Manifest, room: str | None, category: str | None) -> list[ObjectEntry]:
    from ig2mj.errors import UnknownNameError

    if room is not None and room not in manifest.rooms.instances:
        raise UnknownNameError("room", room, manifest.rooms.instances)
    categories = {o.category for o in manifest.objects}
    if category is not None and category not in categories:
        raise UnknownNameError("category of this scene", category, sorted(categories))
    return [
        o
        for o in manifest.objects
        if (room is None or room in o.rooms) and (category is None or category == o.category)
    ]


def _print_json(manifest: Manifest, objects: list[ObjectEntry], show: tuple[Kind, ...]) -> None:
    import msgspec

    from ig2mj.cli.common.printing import print_json

    out: dict[str, Any] = {"name": manifest.name}
    if "rooms" in show:
        out["rooms"] = [
            {"name": n, "type": r.type, "floor": r.floor, "objects": sum(n in o.rooms for o in objects)}
            for n, r in manifest.rooms.instances.items()
        ]
    if "objects" in show:
        out["objects"] = [msgspec.to_builtins(o) for o in objects]
    if "joints" in show:
        out["joints"] = [
            {
                "object": o.name,
                "name": j.name,
                "type": j.type,
                "range": j.range,
                "openable": next(({"closed": p.closed, "open": p.open} for p in o.openable if p.joint == j.name), None),
            }
            for o in objects
            for j in o.joints
        ]
    if "abilities" in show:
        out["abilities"] = {
            name: {o.name: o.abilities[name] for o in objects if name in o.abilities}
            for name in sorted({a for o in objects for a in o.abilities})
        }
    print_json(out)


def _print_tables(manifest: Manifest, objects: list[ObjectEntry], show: tuple[Kind, ...]) -> None:
    from ig2mj.cli.common.printing import make_table, stdout_console

    console = stdout_console()
    household = [o for o in objects if o.in_household]
    movable = [o for o in household if not o.fixed]
    parked = sum(o.parked for o in objects)
    building = len(objects) - len(household) - parked
    joints = sum(len(o.joints) for o in household)
    console.print(
        f"{manifest.name}: {len(household)} objects ({len(movable)} movable, {sum(o.mass for o in movable):.1f} kg), "
        f"{joints} joints, {len(manifest.rooms.instances)} rooms"
        + (f"; plus {parked} parked" * (parked > 0))
        + (f"{' and' if parked else '; plus'} {building} of the building" * (building > 0)),
        markup=False,
    )
    makers = {"rooms": _room_rows, "objects": _object_rows, "joints": _joint_rows, "abilities": _ability_rows}
    for kind in show:
        columns, rows = makers[kind](manifest, objects)
        if rows:
            console.print()
            console.print(make_table(kind, columns, rows, console.width))


def _room_rows(manifest: Manifest, objects: list[ObjectEntry]):
    rows = [(n, r.type, r.floor, sum(n in o.rooms for o in objects)) for n, r in manifest.rooms.instances.items()]
    return ("room", "type", ">floor", ">objects"), rows


def _object_rows(manifest: Manifest, objects: list[ObjectEntry]):
    rows = [
        (
            o.name,
            o.category,
            o.model,
            o.synset or "-",
            ", ".join(o.rooms) or "-",
            "parked" if o.parked else "fixed" if o.fixed else f"{o.mass:.3g}",
            " x ".join(f"{d:.2f}" for d in o.bounding_box),
            len(o.joints) or "",
            ", ".join([*o.abilities, *(f"[{kind}]" for kind in o.links)]),
        )
        for o in objects
    ]
    columns = (
        "object",
        "?category",
        "?model",
        "?synset",
        "rooms",
        ">kg",
        "?box (m)",
        "?>joints",
        "abilities, [links]",
    )
    return columns, rows


def _joint_rows(manifest: Manifest, objects: list[ObjectEntry]):
    rows = []
    for o in objects:
        openable = {p.joint: p for p in o.openable}
        for j in o.joints:
            unit, factor = ("deg", math.degrees(1)) if j.type == "hinge" else ("m", 1.0)
            span = "unlimited" if j.range is None else f"{j.range[0] * factor:.3g} .. {j.range[1] * factor:.3g} {unit}"
            ends = openable.get(j.name)
            opens = f"{ends.closed * factor:.3g} -> {ends.open * factor:.3g} {unit}" if ends else ""
            rows.append((o.name, j.name, j.type, span, opens))
    return ("object", "joint", "type", "range", "closed -> open"), rows


def _ability_rows(manifest: Manifest, objects: list[ObjectEntry]):
    having: dict[tuple[str, str], list[str]] = {}
    for o in objects:
        for ability, parameters in o.abilities.items():
            text = ", ".join(f"{k} {_value(v)}" for k, v in parameters.items())
            having.setdefault((ability, text), []).append(o.name)
    rows = [(a, text, len(names), ", ".join(names)) for (a, text), names in sorted(having.items())]
    return ("ability", "parameters", ">objects", "which"), rows


def _value(value: float | bool) -> str:
    return ("yes" if value else "no") if isinstance(value, bool) else f"{value:g}"
