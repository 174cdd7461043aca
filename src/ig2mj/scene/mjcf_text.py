"""MJCF as text: its paths made absolute, and its elements given other names, also where they are referred to.

Names are changed in the text since `MjSpec` keeps references as strings, and does not give out those of tendons.
"""

from __future__ import annotations

import pathlib
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable

REFERENCES = (
    "name",
    "body",
    "body1",
    "body2",
    "joint",
    "joint1",
    "joint2",
    "jointinparent",
    "geom",
    "geom1",
    "geom2",
    "site",
    "site1",
    "site2",
    "sidesite",
    "refsite",
    "cranksite",
    "slidersite",
    "tendon",
    "tendon1",
    "tendon2",
    "actuator",
    "camera",
    "sensor",
    "target",
    "objname",
    "refname",
)
"""Attributes that hold the name of an element of the tree, or of one that refers to such elements."""

ASSET_REFERENCES = ("mesh", "material", "texture", "hfield", "class", "childclass")
"""Attributes that hold the name of an asset or of a default class."""

ASSETS = ("asset", "default")
"""Sections whose elements those are."""


def make_absolute(root: ElementTree.Element, folder: pathlib.Path) -> None:
    """Gives every mesh and texture its absolute path, so that files of several folders can stand in one MJCF."""
    compiler = root.find("compiler")
    known = {} if compiler is None else compiler.attrib
    folders = {"mesh": known.get("meshdir", ""), "texture": known.get("texturedir", "")}
    for kind, inner in folders.items():
        for element in root.iter(kind):
            if file := element.get("file"):
                element.set("file", str((folder / inner / file).resolve()))


def rename(
    root: ElementTree.Element, named: Callable[[str], str], named_asset: Callable[[str], str] | None = None
) -> None:
    """Changes the names of all elements, and where they refer to each other.

    Args:
      named: old name -> new, of everything in the tree and of what refers to it (contacts, equalities, tendons,
        actuators, sensors, keyframes). named_asset: of assets and default classes; None leaves those.
    """
    for section in root:
        inside = section.tag in ASSETS
        for element in section.iter():
            if named_asset is not None:
                _rename_assets(element, inside, named_asset)
            for attribute in REFERENCES if not inside else ():
                if value := element.get(attribute):
                    element.set(attribute, named(value))


def _rename_assets(element: ElementTree.Element, inside: bool, named: Callable[[str], str]) -> None:
    file = element.get("file")
    if inside and file and not element.get("name"):  # MuJoCo names it after its file
        element.set("name", pathlib.PurePath(file).stem)
    for attribute in (*ASSET_REFERENCES, "name") if inside else ASSET_REFERENCES:
        value = element.get(attribute)
        if value and not (attribute in ("class", "childclass") and value == "main"):
            element.set(attribute, named(value))
