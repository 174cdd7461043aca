"""Objects of the library added to a home: its MJCF and its manifest with them, before anything is compiled.

Additions are named `<category>_<n>`, `n` going on where the home's own stop, and stand at rest on a slab of their own
far outside the house until they are put somewhere; their halves, where they can be sliced, wait there parked. They come
after the home's own objects, bodies and joints, so that indices of those stay what they were.
"""

from __future__ import annotations

import copy
import dataclasses
import math
import pathlib
import re
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterable, Sequence

import msgspec

from ig2mj.errors import Ig2mjError
from ig2mj.scene.library import LibraryModel, find_model
from ig2mj.scene.manifest import JointEntry, LinkEntry, Manifest, ObjectEntry, OpenableEntry
from ig2mj.scene.mjcf_files import read_mjcf
from ig2mj.scene.mjcf_text import make_absolute, rename
from ig2mj.scene.resting import rest

SLAB = "additions_slab"
HEIGHT = -5.0
"""Of the slab's top (m): below the floor, so that nothing in the house can roll there."""
DISTANCE = 40.0
"""From the house to the slab (m), on the side away from the home's own parking slab."""
CLEARANCE = 0.15
"""Free space (m) between what stands there."""
CONSTRAINTS = ("contact", "equality", "tendon")
"""Sections of an object's file by which its bodies and joints depend on each other."""

Place = tuple[float, float, float, float]
"""x, y, z (m) of an object's frame, and degrees that it is turned about the vertical."""


@dataclasses.dataclass(frozen=True)
class Addition:
    """An object of the library in a scene.

    Attributes:
      name: in the scene. category, model: of the library. sha256: of the model (`LibraryModel.sha256`).
      place: where it is fixed; None: it can be moved.
    """

    name: str
    category: str
    model: str
    sha256: str
    place: Place | None = None

    @property
    def wanted(self) -> str:
        """What `load_scene(objects=...)` takes for it."""
        fixed = "" if self.place is None else f"@{','.join(f'{v:g}' for v in self.place)}"
        return f"{self.category}/{self.model}{fixed}"


def place_of(wanted: str) -> tuple[str, Place | None]:
    """The model's name, and where it is fixed: "shelf/shelf_14@1,2,0.9,-90". Raises Ig2mjError: it is neither."""
    if not isinstance(wanted, str):
        raise Ig2mjError(f"objects: {wanted!r} is not a name of the object library, such as 'plate'")
    name, mark, place = wanted.partition("@")
    if not mark:
        return name, None
    try:
        x, y, z, yaw = map(float, place.split(","))
    except ValueError:
        raise Ig2mjError(f"'{wanted}': the pose of a fixed object is x,y,z,yaw in metres and degrees") from None
    return name, (x, y, z, yaw)


def name_additions(taken: Iterable[str], wanted: Sequence[str]) -> list[tuple[str, LibraryModel]]:
    """The names that `wanted` get ("apple", or "apple/apple_00") in a scene whose objects have the names `taken`.

    Raises:
      UnknownNameError: the library has no such category or model. Ig2mjError: a place is not four numbers.
    """
    names = set(taken)
    numbers: dict[str, int] = {}
    for name in names:
        if match := re.fullmatch(r"(.+)_(\d+)", name):
            numbers[match[1]] = max(numbers.get(match[1], -1), int(match[2]))
    found = []
    for model in (find_model(place_of(name)[0]) for name in wanted):
        number = numbers.get(model.category, -1) + 1
        while f"{model.category}_{number}" in names:
            number += 1
        numbers[model.category] = number
        found.append((f"{model.category}_{number}", model))
        names.add(found[-1][0])
    return found


def add_objects(file: pathlib.Path, manifest: Manifest, wanted: Sequence[str]) -> tuple[str, Manifest, list[Addition]]:
    """A home with objects of the library.

    Args:
      file: its scene.xml. manifest: its manifest; not changed.
      wanted: what is added, in this order: "apple" or "apple/apple_00"; "shelf/shelf_14@1,2,0.9,-90" is fixed there.

    Returns:
      MJCF whose paths are absolute, the manifest with all entries, what was added.

    Raises:
      UnknownNameError: the library has no such model. InputError: a file is not MJCF. Ig2mjError: a fixed model has
      no place.
    """
    root = read_mjcf(file)
    make_absolute(root, file.parent)
    world, assets = _child(root, "worldbody"), _child(root, "asset")
    known = {(e.tag, e.get("name")) for e in assets}
    named = name_additions((o.name for o in manifest.objects), wanted)
    places = [place_of(name)[1] for name in wanted]
    for (_, model), at in zip(named, places, strict=True):
        if model.entry.fixed and at is None:
            raise Ig2mjError(
                f"'{model.category}/{model.model}' is fixed: give its pose, as in '{model.category}@1,2,0.9,-90'"
            )
    loose = [o for (_, model), at in zip(named, places, strict=True) if at is None for o in model.manifest.objects]
    cells = _add_slab(root, loose) if loose else []
    start: list[list[float]] = []
    standing: list[tuple[ElementTree.Element, int]] = []
    place = iter(cells)
    for (name, model), at in zip(named, places, strict=True):
        added = read_mjcf(model.file)
        make_absolute(added, model.folder)
        _rename(added, model.entry.name, name)
        _take_defaults(root, added)
        for asset in _child(added, "asset"):
            key = (asset.tag, asset.get("name"))
            if key not in known and asset.get("builtin") is None and asset.get("name") != "ground":
                known.add(key)
                assets.append(asset)
        poses = _start_values(added)
        bodies = {body.get("name"): body for body in _child(added, "worldbody").findall("body")}
        for tag in CONSTRAINTS:
            for element in added.iter(tag):
                _child(root, tag).extend(element)
        if at is not None:
            _fix(bodies[name], at)
            start.append(poses[name][1])
            world.append(bodies[name])
            continue
        for entry in model.manifest.objects:
            x, y = next(place)
            roots = [bodies[f"{name}{body.removeprefix(model.entry.name)}"] for body in entry.bodies]
            origin = poses[str(roots[0].get("name"))][0]
            for body in roots:
                values, inner = poses[str(body.get("name"))]
                values = [values[0] - origin[0] + x, values[1] - origin[1] + y, values[2] + HEIGHT, *values[3:]]
                standing.append((body, len(start)))
                start.append([*values, *inner])
                world.append(body)
    if standing:
        _lay_down(root, standing, start)
    _extend_key(root, [value for values in start for value in values])
    merged = copy.copy(manifest)
    merged.objects = list(manifest.objects)
    for (name, model), at in zip(named, places, strict=True):
        entries = [_entry(o, model.entry.name, name) for o in model.manifest.objects]
        if at is not None:
            entries = [msgspec.structs.replace(entries[0], fixed=True, assisted_grasp=False)]
        merged.objects += entries
    additions = [Addition(name, m.category, m.model, m.sha256, at) for (name, m), at in zip(named, places, strict=True)]
    return ElementTree.tostring(root, encoding="unicode"), merged, additions


def _child(root: ElementTree.Element, tag: str) -> ElementTree.Element:
    """The section of that name; made where there is none. The keyframe stays last."""
    found = root.find(tag)
    if found is None:
        found = ElementTree.Element(tag)
        keys = root.find("keyframe")
        root.insert(len(root) if keys is None else list(root).index(keys), found)
    return found


def _rename(root: ElementTree.Element, old: str, new: str) -> None:
    """Replaces an object's name at the beginning of its elements' names and where they refer to each other."""

    def named(value: str) -> str:
        if not value.startswith(old):
            return value
        first, mark, second = value.partition(f"--{old}")  # of an excluded pair of bodies
        return f"{new}{first.removeprefix(old)}" + (f"--{new}{second}" if mark else "")

    rename(root, named)


def _take_defaults(root: ElementTree.Element, added: ElementTree.Element) -> None:
    """Takes over default classes that the home does not have."""
    known = {element.get("class") for element in root.iter("default")}
    target = _child(root, "default")
    for element in _child(added, "default").findall("default"):
        if element.get("class") not in known:
            target.append(element)


def _fix(body: ElementTree.Element, place: Place) -> None:
    """Takes the free joint from a body and puts it in its place for good."""
    for joint in [j for j in body if j.tag == "freejoint" or j.get("type") == "free"]:
        body.remove(joint)
    half = math.radians(place[3]) / 2
    body.set("pos", _numbers(place[:3]))
    body.set("quat", _numbers([math.cos(half), 0.0, 0.0, math.sin(half)]))


def _add_slab(root: ElementTree.Element, entries: Sequence[ObjectEntry]) -> list[tuple[float, float]]:
    """Adds the slab and returns a place (x, y) on it for each object, whatever way it is turned."""
    reach = [math.hypot(*o.base_link_offset) + math.hypot(*o.bounding_box) / 2 for o in entries]
    cell = 2 * max(reach, default=0.0) + CLEARANCE
    columns = math.ceil(math.sqrt(len(entries)))
    half = columns * cell / 2
    statistic = root.find("statistic")
    given = {} if statistic is None else statistic.attrib
    centre = [float(v) for v in given.get("center", "0 0 0").split()]
    x = centre[0] - float(given.get("extent", "10")) - DISTANCE - half
    body = ElementTree.SubElement(
        _child(root, "worldbody"), "body", name=SLAB, pos=_numbers([x, centre[1], HEIGHT - 0.1])
    )
    size = _numbers([half, half, 0.1])
    place = {"name": f"{SLAB}/collision_0", "class": "collision", "type": "box", "size": size}
    ElementTree.SubElement(body, "geom", place, rgba="0.5 0.5 0.5 1")
    return [
        (x - half + (i % columns + 0.5) * cell, centre[1] - half + (i // columns + 0.5) * cell)
        for i in range(len(entries))
    ]


def _lay_down(
    root: ElementTree.Element, standing: Sequence[tuple[ElementTree.Element, int]], start: list[list[float]]
) -> None:
    """Gives the bodies on the slab the poses in which they rest. `standing`: each, and its number in `start`."""
    slab = next(body for body in _child(root, "worldbody") if body.get("name") == SLAB)
    found = rest(root, slab, [body for body, _ in standing], [v for _, number in standing for v in start[number]])
    first = 0
    for body, number in standing:
        values = [float(v) for v in found[first : first + len(start[number])]]
        first += len(values)
        start[number] = values
        body.set("pos", _numbers(values[:3]))
        body.set("quat", _numbers(values[3:7]))


def _start_values(root: ElementTree.Element) -> dict[str, tuple[list[float], list[float]]]:
    """Of every body in the world: position and quaternion at the start, and positions of the joints on it."""
    key = root.find("keyframe/key")
    saved = [] if key is None else [float(v) for v in key.get("qpos", "").split()]
    found, at = {}, 0
    for body in _child(root, "worldbody").findall("body"):
        joints = [j for j in body.iter("joint") if j.get("type") != "free"]
        free = 7 * any(j.tag == "freejoint" or j.get("type") == "free" for j in body)
        own = [float(v) for v in f"{body.get('pos', '0 0 0')} {body.get('quat', '1 0 0 0')}".split()]
        values = saved[at : at + free + len(joints)] if saved else [0.0] * (free + len(joints))
        found[str(body.get("name"))] = values[:free] if saved and free else own, values[free:]
        at += free + len(joints)
    return found


def _extend_key(root: ElementTree.Element, start: list[float]) -> None:
    """Adds the additions' start to the home's keyframes; one without positions means the bodies' own, joints at 0."""
    for key in root.findall("keyframe/key"):
        if qpos := key.get("qpos"):
            key.set("qpos", f"{qpos} {_numbers(start)}")


def _entry(o: ObjectEntry, old: str, new: str) -> ObjectEntry:
    """An entry of the library under its name in the scene."""

    def named(name: str) -> str:
        return f"{new}{name.removeprefix(old)}"

    return msgspec.structs.replace(
        o,
        name=named(o.name),
        bodies=[named(b) for b in o.bodies],
        joints=[JointEntry(named(j.name), j.type, j.range) for j in o.joints],
        openable=[OpenableEntry(named(j.joint), j.closed, j.open) for j in o.openable],
        links={
            kind: LinkEntry(site=link.site and named(link.site), geom=link.geom and named(link.geom))
            for kind, link in o.links.items()
        },
        parts=[msgspec.structs.replace(p, object=named(p.object)) for p in o.parts],
        part_of=None if o.part_of is None else named(o.part_of),
    )


def _numbers(values: Iterable[float]) -> str:
    return " ".join(f"{v:.9g}" for v in values)
