"""Objects added to a home: its MJCF and its manifest with them, before anything is compiled.

An addition is named `<prefix>_<n>`, `n` going on where the home's own stop; the prefix is the category of a model of a
library, and the name of the folder of any other. Without a place it stands at rest on a slab far outside the house
until it is put somewhere; halves, where it can be sliced, wait there parked. Additions come after the home's own
objects, bodies and joints, so that indices of those stay what they were.
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
import mujoco
import numpy as np

from ig2mj.errors import Ig2mjError, InputError
from ig2mj.scene.library import LibraryModel, LibraryName, find_model
from ig2mj.scene.manifest import JointEntry, LinkEntry, Manifest, ObjectEntry, OpenableEntry
from ig2mj.scene.mjcf_files import read_mjcf
from ig2mj.scene.mjcf_text import make_absolute, rename
from ig2mj.scene.object_requests import ObjectRequest, Place, Pose, frame_of, read_request
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
COMPILED_BY = ("angle", "eulerseq", "coordinate")
"""Settings of <compiler> that change what a number means: an object's must be the home's."""


@dataclasses.dataclass(frozen=True)
class Addition:
    """An object that was added to a scene.

    Attributes:
      name: in the scene. category, model: what it is. sha256: of the model (`LibraryModel.sha256`).
      place: where it is fixed; None: it can be moved. start: where it starts, free to move; None: on the slab.
      folder: where the files of a model of the user's own lie; None: of the library that ships.
      named: it was added by its folder, and is named after it.
    """

    name: str
    category: str
    model: str
    sha256: str
    place: Place | None = None
    start: Place | Pose | None = None
    folder: str | None = None
    named: bool = False

    @property
    def reference(self) -> str:
        """What `find_model` finds its model by."""
        return self.folder if self.named and self.folder else f"{self.category}/{self.model}"

    @property
    def requested(self) -> str:
        """What `load_scene(objects=...)` takes for it."""
        if self.start is not None:
            return f"{self.reference}@loose:{_numbers(self.start, ',')}"
        if self.place is None:
            return self.reference
        kind = "" if self.folder is None else "fixed:"
        return f"{self.reference}@{kind}{_numbers(self.place, ',')}"

    def find(self) -> LibraryModel:
        """Its model, read again. Raises as `find_model`."""
        return find_model(self.reference if self.named else LibraryName(self.reference))


def name_additions(taken: Iterable[str], requested: Sequence[str]) -> list[tuple[str, LibraryModel]]:
    """The names that `requested` get ("apple", "apple/apple_00" or a folder) in a scene whose objects are `taken`.

    Raises:
      UnknownNameError: the library has no such category or model. Ig2mjError: a place is none.
    """
    return name_models(taken, [find_model(read_request(name).reference) for name in requested])


def name_models(taken: Iterable[str], models: Sequence[LibraryModel]) -> list[tuple[str, LibraryModel]]:
    """The names that objects of these models get in a scene whose objects are named `taken`."""
    names = set(taken)
    numbers: dict[str, int] = {}
    for name in names:
        if match := re.fullmatch(r"(.+)_(\d+)", name):
            numbers[match[1]] = max(numbers.get(match[1], -1), int(match[2]))
    found = []
    for model in models:
        number = numbers.get(model.prefix, -1) + 1
        while f"{model.prefix}_{number}" in names:
            number += 1
        numbers[model.prefix] = number
        found.append((f"{model.prefix}_{number}", model))
        names.add(found[-1][0])
    return found


def plan_additions(manifest: Manifest, requests: Sequence[ObjectRequest]) -> list[tuple[Addition, LibraryModel]]:
    """What is added to a home for these requests, in this order. Predicates are left to `load_scene`.

    Raises:
      UnknownNameError: there is no such model. Ig2mjError: a fixed model has no place.
    """
    models = [find_model(request.reference) for request in requests]
    found = []
    for (name, model), request in zip(name_models((o.name for o in manifest.objects), models), requests, strict=True):
        fixed = model.entry.fixed
        if fixed and request.place is None:
            raise Ig2mjError(f"'{request.text}' is fixed: give its pose, as in '{request.reference}@1,2,0.9,-90'")
        if request.place is not None and request.kind != "loose" and (request.kind or fixed or not model.own):
            fixed, place, start = True, request.place[:4], None
        else:
            if fixed and request.kind == "loose":
                fix = "convert it without --fixed"
                raise Ig2mjError(f"'{request.text}' is fixed and cannot be loose ({fix})")
            place, start = None, request.place
        folder = str(model.folder) if model.own else None
        addition = Addition(name, model.category, model.model, model.sha256, place, start, folder, model.named)
        found.append((addition, model))
    return found


def read_absolute(file: pathlib.Path) -> ElementTree.Element:
    """The MJCF of a home, with absolute paths. Raises InputError."""
    root = read_mjcf(file)
    make_absolute(root, file.parent)
    return root


def add_objects(
    root: ElementTree.Element, manifest: Manifest, planned: Sequence[tuple[Addition, LibraryModel]]
) -> Manifest:
    """Adds objects to a home.

    Args:
      root: its MJCF, as of `read_absolute`; objects are added to it. manifest: its manifest; not changed.
      planned: as of `plan_additions`.

    Returns:
      The manifest with all entries.

    Raises:
      InputError: a file is not MJCF, or one of an object does not fit the home's.
    """
    world = _child(root, "worldbody")
    waiting = [o for a, model in planned if a.place is None for o in _parked(a, model)]
    slab, cells = _add_slab(root, waiting) if waiting else (world, [])
    start: list[list[float]] = []
    standing: list[tuple[ElementTree.Element, int]] = []
    cell = iter(cells)
    for addition, model in planned:
        name = addition.name
        added = read_mjcf(model.file)
        make_absolute(added, model.folder)
        _rename(added, model.entry.name, name)
        if model.own:
            _check_compiler(root, added, model.file)
        _take_assets(root, added, name, model.own)
        poses = _start_values(added)
        bodies = {body.get("name"): body for body in _child(added, "worldbody").findall("body")}
        for tag in CONSTRAINTS:
            for element in added.iter(tag):
                _child(root, tag).extend(element)
        entries = model.manifest.objects if addition.place is None else model.manifest.objects[:1]
        for entry in entries:
            roots = [_body_of(bodies, f"{name}{b.removeprefix(model.entry.name)}", model) for b in entry.bodies]
            own = [poses[str(body.get("name"))] for body in roots]
            frame = addition.place or addition.start
            if frame is not None and entry is model.entry:
                moved = _moved([values for values, _ in own], frame_of(frame))
            else:
                x, y = next(cell)
                origin = own[0][0]
                moved = [[v[0] - origin[0] + x, v[1] - origin[1] + y, v[2] + HEIGHT, *v[3:]] for v, _ in own]
                standing += [(body, len(start) + k) for k, body in enumerate(roots)]
            for body, values, (_, inner) in zip(roots, moved, own, strict=True):
                body.set("pos", _numbers(values[:3]))
                body.set("quat", _numbers(values[3:]))
                free = body is not roots[0] or addition.place is None
                if not free:
                    _fix(body)
                start.append([*values, *inner] if free else list(inner))
                world.append(body)
    if standing:
        _lay_down(root, slab, standing, start)
    _extend_key(root, [value for values in start for value in values])
    merged = copy.copy(manifest)
    merged.objects = list(manifest.objects)
    for addition, model in planned:
        entries = [_entry(o, model.entry.name, addition.name) for o in model.manifest.objects]
        if addition.place is not None:
            entries = [msgspec.structs.replace(entries[0], fixed=True, assisted_grasp=False)]
        merged.objects += entries
    return merged


def _parked(addition: Addition, model: LibraryModel) -> list[ObjectEntry]:
    """Of an object and its halves what waits on the slab."""
    return [o for o in model.manifest.objects if o is not model.entry or addition.start is None]


def _body_of(bodies: dict[str | None, ElementTree.Element], name: str, model: LibraryModel) -> ElementTree.Element:
    if name not in bodies:
        problem = "names a body that object.xml does not have"
        raise InputError(model.folder / "manifest.json", problem, element=name, fix="convert the object again")
    return bodies[name]


def _moved(poses: Sequence[Sequence[float]], frame: Pose) -> list[list[float]]:
    """Poses of an object's root bodies, the base first, when the base is at `frame`."""
    there, turn, back = np.array(frame[:3]), np.array(frame[3:]), np.zeros(4)
    base = np.array(poses[0], float)
    mujoco.mju_negQuat(back, base[3:])
    mujoco.mju_mulQuat(back, turn, back.copy())
    found = [list(frame)]
    for pose in poses[1:]:
        offset, quat = np.zeros(3), np.zeros(4)
        mujoco.mju_rotVecQuat(offset, np.array(pose[:3], float) - base[:3], back)
        mujoco.mju_mulQuat(quat, back, np.array(pose[3:], float))
        found.append([*(there + offset).tolist(), *quat.tolist()])
    return found


def _check_compiler(root: ElementTree.Element, added: ElementTree.Element, file: pathlib.Path) -> None:
    """Raises InputError where the object's numbers mean something else than the home's."""
    home, own = (dict(e.attrib) if (e := r.find("compiler")) is not None else {} for r in (root, added))
    for name in COMPILED_BY:
        if own.get(name) != home.get(name):
            problem = f"has {name}={own.get(name)!r}, the home {home.get(name)!r}"
            raise InputError(file, problem, element="<compiler>", fix="convert the object again")


def _take_assets(root: ElementTree.Element, added: ElementTree.Element, name: str, own: bool) -> None:
    """Takes over an object's assets and default classes; what the home has already is shared.

    own: the object is of the user's own: what the home has under the same name with other content is then renamed
    `<object>/<name>`.
    """
    assets, defaults = _child(root, "asset"), _child(root, "default")
    given = [a for a in _child(added, "asset") if a.get("builtin") is None and a.get("name") != "ground"]
    classes = _child(added, "default").findall("default")
    known = {_asset_key(e): e for e in (*assets, *defaults.findall("default"))}
    if own and any(_content(known[k]) != _content(e) for e in (*given, *classes) if (k := _asset_key(e)) in known):
        rename(added, lambda value: value, lambda value: f"{name}/{value}")
    assets.extend(e for e in given if _asset_key(e) not in known)
    defaults.extend(e for e in classes if _asset_key(e) not in known)


def _asset_key(element: ElementTree.Element) -> tuple[str, str]:
    return element.tag, element.get("name", element.get("class")) or pathlib.PurePath(element.get("file", "")).stem


def _content(element: ElementTree.Element) -> str:
    """An element as text, in which a file counts by its name: names of meshes and images have a hash of the content."""
    plain = copy.deepcopy(element)
    for e in plain.iter():
        e.tail = None
        if file := e.get("file"):
            e.set("file", pathlib.PurePath(file).name)
    return ElementTree.tostring(plain, encoding="unicode")


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


def _fix(body: ElementTree.Element) -> None:
    """Takes the free joint from a body."""
    for joint in [j for j in body if j.tag == "freejoint" or j.get("type") == "free"]:
        body.remove(joint)


def _add_slab(
    root: ElementTree.Element, entries: Sequence[ObjectEntry]
) -> tuple[ElementTree.Element, list[tuple[float, float]]]:
    """Adds the slab; gives it and a place (x, y) on it for each object, whatever way it is turned.

    A home to which objects were added before it was written has such slabs; this one is beyond them.
    """
    reach = [math.hypot(*o.base_link_offset) + math.hypot(*o.bounding_box) / 2 for o in entries]
    cell = 2 * max(reach, default=0.0) + CLEARANCE
    columns = math.ceil(math.sqrt(len(entries)))
    half = columns * cell / 2
    statistic = root.find("statistic")
    given = {} if statistic is None else statistic.attrib
    centre = [float(v) for v in given.get("center", "0 0 0").split()]
    world = _child(root, "worldbody")
    others = [b for b in world.findall("body") if str(b.get("name")).startswith(SLAB)]
    ends = [float(b.get("pos", "0").split()[0]) - float(b[0].get("size", "0").split()[0]) for b in others]
    x = min([centre[0] - float(given.get("extent", "10")) - DISTANCE, *(end - CLEARANCE for end in ends)]) - half
    name = f"{SLAB}_{len(others)}" if others else SLAB
    body = ElementTree.SubElement(world, "body", name=name, pos=_numbers([x, centre[1], HEIGHT - 0.1]))
    size = _numbers([half, half, 0.1])
    place = {"name": f"{name}/collision_0", "class": "collision", "type": "box", "size": size}
    ElementTree.SubElement(body, "geom", place, rgba="0.5 0.5 0.5 1")
    return body, [
        (x - half + (i % columns + 0.5) * cell, centre[1] - half + (i // columns + 0.5) * cell)
        for i in range(len(entries))
    ]


def _lay_down(
    root: ElementTree.Element,
    slab: ElementTree.Element,
    standing: Sequence[tuple[ElementTree.Element, int]],
    start: list[list[float]],
) -> None:
    """Gives the bodies on the slab the poses in which they rest. `standing`: each, and its number in `start`."""
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


def _numbers(values: Iterable[float], between: str = " ") -> str:
    return between.join(f"{v:.9g}" for v in values)
