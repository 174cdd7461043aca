"""An exported home as MJCF that Genesis reads: one model for each object, and what had to be left out, counted."""

from __future__ import annotations

import collections
import copy
import dataclasses
import json
import pathlib
import xml.etree.ElementTree as ET
from typing import Any

UNUSED = ("site", "camera", "light", "texture", "material", "visual", "statistic", "keyframe", "size")
"""Elements without meaning for collision and motion."""

TURNS = ("quat", "euler", "axisangle", "xyaxes", "zaxis")
"""Attributes that say how a body is turned."""


@dataclasses.dataclass(frozen=True)
class Part:
    """A model of its own. `moves`: it has joints."""

    name: str
    xml: str
    moves: bool


@dataclasses.dataclass(frozen=True)
class Home:
    """Parts of a home, what was left out of it by kind, and `home.json`."""

    parts: list[Part]
    left_out: dict[str, int]
    written: dict[str, Any]


def read_home(folder: pathlib.Path) -> Home:
    """Reads an exported home.

    Every body of the world that moves becomes a part (Genesis then keeps one small mass matrix for each), all bodies
    that do not become one more. Free bodies are put at their settled poses.
    """
    root = ET.parse(folder / "scene.xml").getroot()
    written = json.loads((folder / "home.json").read_text())
    left_out = _simplify(root)
    compiler = root.find("compiler")
    if compiler is None:
        compiler = ET.SubElement(root, "compiler")
    compiler.attrib.pop("texturedir", None)
    compiler.set("meshdir", str((folder / compiler.get("meshdir", "")).resolve()))
    world = root.find("worldbody")
    assert world is not None
    bodies = world.findall("body")
    for body in bodies:
        _settle(body, written["poses"])
    still = [body for body in bodies if not _moves(body)]
    parts = [Part("still", _model(root, "still", still), False)] if still else []
    for body in bodies:
        if _moves(body):
            name = body.get("name", "")
            parts.append(Part(name, _model(root, name, [body], actuators=name == "hand"), True))
    return Home(parts, left_out, written)


def _simplify(root: ET.Element) -> dict[str, int]:
    """Takes out what Genesis does not know or need; how many of each."""
    count: collections.Counter[str] = collections.Counter()
    drawn_classes = {
        default.get("class")
        for default in root.iter("default")
        for geom in default.findall("geom")
        if geom.get("contype") == "0"
    }

    def drawn(geom: ET.Element) -> bool:
        return geom.get("class") in drawn_classes or geom.get("contype") == geom.get("conaffinity") == "0"

    for parent in list(root.iter()):
        for child in list(parent):
            if child.tag in UNUSED or (child.tag == "geom" and drawn(child)):
                parent.remove(child)
                count["visual geoms" if child.tag == "geom" else child.tag] += 1
            elif child.tag == "geom":
                child.attrib.pop("material", None)
                if child.attrib.pop("gap", None):
                    count["gap of a geom (Genesis lists no contacts ahead)"] += 1
            elif child.tag == "general" and child.attrib.pop("input", None):
                count["input of an actuator (its default)"] += 1
    for contact in root.findall("contact"):
        count["contact excludes within one object (no self-collision instead)"] += len(contact)
        root.remove(contact)
    for option in root.findall("option"):
        count["option (timestep and gravity are set on the scene)"] += 1
        root.remove(option)
    return dict(count)


def _settle(body: ET.Element, poses: dict[str, list[float]]) -> None:
    free = next((j for j in body if j.tag == "freejoint" or (j.tag == "joint" and j.get("type") == "free")), None)
    if free is not None:
        pose = poses[free.get("name", "")]
        for word in TURNS:
            body.attrib.pop(word, None)
        body.set("pos", " ".join(map(repr, pose[:3])))
        body.set("quat", " ".join(map(repr, pose[3:])))


def _moves(body: ET.Element) -> bool:
    return any(element.tag in ("joint", "freejoint") for element in body.iter())


def _model(root: ET.Element, name: str, bodies: list[ET.Element], actuators: bool = False) -> str:
    """A model of some bodies with the defaults and meshes that they use."""
    model = ET.Element("mujoco", model=name)
    model.extend(copy.deepcopy(root.findall("compiler") + root.findall("default")))
    used = {geom.get("mesh") for body in bodies for geom in body.iter("geom")}
    meshes = [m for m in root.iterfind("asset/mesh") if (m.get("name") or pathlib.Path(m.get("file", "")).stem) in used]
    if meshes:
        ET.SubElement(model, "asset").extend(copy.deepcopy(meshes))
    ET.SubElement(model, "worldbody").extend(copy.deepcopy(bodies))
    if actuators:
        model.extend(copy.deepcopy(root.findall("actuator")))
    return ET.tostring(model, encoding="unicode")
