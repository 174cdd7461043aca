"""The made home of benchmarks with abilities for every extended state, and a goal of ten literals."""

from __future__ import annotations

import pathlib

from benchmarks.harness.made_home import write_home
from ig2mj.scene import manifest as mf

FOOD = {
    "cookable": {},
    "burnable": {},
    "freezable": {},
    "dustyable": {},
    "stainable": {},
    "soakable": {},
}
FRIDGE = {"temperature": -18.0, "heating_rate": 0.02, "requires_inside": True, "requires_closed": True}
OVEN = {"temperature": 250.0, "heating_rate": 0.01, "requires_inside": True, "requires_closed": True}
DIRT = {"dustyable": {}, "stainable": {}}


def write_stateful_home(folder: pathlib.Path, num_objects: int) -> pathlib.Path:
    """As `made_home.write_home`; furniture heats and cools what is in it, objects are food, every tenth is a rag."""
    write_home(folder, num_objects)
    manifest = mf.load_manifest(folder)
    cabinets = 0
    for entry in manifest.objects:
        if entry.name.startswith("furniture"):
            entry.abilities = dict(DIRT)
            if entry.openable:
                source = {"coldSource": FRIDGE} if cabinets % 2 == 0 else {"heatSource": OVEN}
                entry.abilities |= {"openable": {}, "toggleable": {}, **source}
                cabinets += 1
        elif entry.name.startswith("thing"):
            number = int(entry.name.split("_")[1])
            entry.abilities = {"cleaningTool": {}, "soakable": {}, **DIRT} if number % 10 == 9 else dict(FOOD)
    mf.save_manifest(manifest, folder / "manifest.json")
    return folder


GOAL = """
(and (cooked thing_0) (not (burnt thing_1)) (frozen thing_2) (soaked thing_9) (not (dusty furniture_0))
     (not (stained furniture_1)) (open furniture_0) (on_top thing_3 furniture_0) (inside thing_4 furniture_2)
     (in_contact_with thing_5 furniture_0))
"""
"""Ten literals, three of them relations of two objects."""
