"""Writes a scene folder of the dataset (iGibson's dataset format) out of a plan and what stands in it."""

from __future__ import annotations

import json
import pathlib
import random
import shutil
from collections.abc import Collection
from xml.sax.saxutils import quoteattr

from ..furnish.arrangement import Arrangement
from ..furnish.placed import Placed, rpy_of
from ..plans.building import write_building
from ..plans.layout_maps import Maps
from ..plans.plan import Plan
from .model_writer import numbers
from .root import BUILDING

VARIANTS = ("", "_best")
"""Scene files with the same contents; the loader takes `_best` first."""


def write_scene(
    root: pathlib.Path, plan: Plan, home: Arrangement, seed: int = 0, skipped: Collection[str] = ()
) -> pathlib.Path:
    """Writes `scenes/<name>/`: the scene URDFs, the building's parts, the maps and the list of overlapping boxes.

    Args:
      skipped: names of objects that are on the maps and not in the scene, since the dataset has no model of them.
    """
    folder = root / "scenes" / plan.name
    shutil.rmtree(folder, ignore_errors=True)
    write_building(plan, folder, random.Random(f"{seed}/{plan.name}/building"))
    listed = [thing for thing in home.things.values() if thing.name not in skipped]
    for variant in VARIANTS:
        _text(folder / "urdf" / f"{plan.name}{variant}.urdf", scene_urdf(plan.name, listed))
    _text(folder / "urdf" / f"{plan.name}_orig.urdf", scene_urdf(plan.name, []))
    (folder / "misc").mkdir(exist_ok=True)
    _text(folder / "misc/bbox_overlap.json", json.dumps(home.overlapping_boxes()) + "\n")
    Maps(plan, home).write(folder)
    return folder


def scene_urdf(name: str, things: list[Placed]) -> str:
    """The pseudo-URDF: building parts, then one link per object whose joint gives its bounding-box centre."""
    lines = ['<?xml version="1.0" ?>', '<robot name="igibson_scene">', '  <link name="world"/>']
    for part in reversed(BUILDING):
        lines.append(f'  <link category="{part}" model={quoteattr(name)} name="{part}"/>')
        lines += _joint(f"fix_to_world_{part}", part, True, "0 0 0", "0 0 0")
    for thing in things:
        attributes = {
            "bounding_box": numbers(thing.size),
            "category": thing.category,
            "model": thing.shape.model.model,
            "name": thing.name,
        }
        if thing.rooms:
            attributes["room"] = ",".join(thing.rooms)
        lines.append("  <link " + " ".join(f"{key}={quoteattr(value)}" for key, value in attributes.items()) + "/>")
        rpy, xyz = numbers(rpy_of(thing.rotation), 8), numbers(thing.centre)
        lines += _joint(f"j_{thing.name}", thing.name, thing.fixed, rpy, xyz)
    return "\n".join([*lines, "</robot>", ""])


def _joint(name: str, child: str, fixed: bool, rpy: str, xyz: str) -> list[str]:
    kind = "fixed" if fixed else "floating"
    return [
        f'  <joint name="{name}" type="{kind}">',
        f'    <origin rpy="{rpy}" xyz="{xyz}"/><child link="{child}"/><parent link="world"/>',
        "  </joint>",
    ]


def _text(path: pathlib.Path, text: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8", newline="\n")
