"""Objects of a home removed and replaced when it is loaded: its MJCF and its manifest without them.

What stands on or in a removed object goes with it. A replacement has the old object's name and stands in its place: its
back and its lower edge where the old one's were, fixed to the house if that was. What stood on the old object is put
down on the new one where that has a surface below it, and goes where not (`settle`).
"""

from __future__ import annotations

import collections
import copy
import dataclasses
import math
import os
import re
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterable, Mapping, Sequence

import mujoco
import numpy as np

from ig2mj.errors import Ig2mjError, UnknownNameError
from ig2mj.scene.additions import Addition
from ig2mj.scene.extras import is_extra
from ig2mj.scene.library import LibraryModel, find_model, folder_of
from ig2mj.scene.manifest import BUILDING, Manifest, ObjectEntry
from ig2mj.scene.substance_requests import is_substances

SUPPORTING = 0.5
"""Least vertical part of a contact's normal (unit vector) by which one object bears the other."""
TOUCHING = 0.006
"""m between a fixed object and the top that it stands on, at most."""
FLOOR = 0.05
"""m: a fixed object whose lower edge is below stands on the floor, whatever it touches."""

THIN = 0.03
"""m: what stands on a removed object that is thinner, a carpet or a mat, stays and is put down on the floor."""

_CHANGE = re.compile(r"(?P<kind>remove|replace):(?P<name>[^=]*)(?:=(?P<instead>.*))?")


@dataclasses.dataclass(frozen=True)
class Change:
    """name: an object of the home. instead: what takes its place, as of `find_model`; None: nothing."""

    name: str
    instead: str | None = None

    @property
    def text(self) -> str:
        """What `load_scene(objects=...)` takes for it."""
        return f"remove:{self.name}" if self.instead is None else f"replace:{self.name}={self.instead}"

    @property
    def canonical(self) -> Change:
        """The same with a folder's whole path. Raises UnknownNameError: there is no such object."""
        if self.instead is None:
            return self
        model = find_model(self.instead)
        return Change(self.name, model.reference if model.named else self.instead)


def read_change(requested: object) -> Change | None:
    """The change that a value of `objects` is: "remove:NAME", "replace:NAME=MODEL"; None: it is an object to add.

    Raises:
      Ig2mjError: a name is missing.
    """
    text = os.fspath(requested) if isinstance(requested, str | os.PathLike) else ""
    match = _CHANGE.fullmatch(text)
    if match is None or folder_of(text) is not None:
        return None
    kind, name, instead = match["kind"], match["name"], match["instead"]
    if not name or (kind == "replace") != bool(instead):
        raise Ig2mjError(f"'{text}': write remove:NAME, or replace:NAME=MODEL with an object of the home")
    return Change(name, instead)


def changes_of(remove: str | Iterable[str] = (), replace: Mapping[str, str | os.PathLike] | None = None) -> list[str]:
    """Values of `objects` for names that are removed, and for names and what takes their place.

    Raises:
      Ig2mjError: they are no names, or no mapping.
    """
    if replace is not None and not isinstance(replace, Mapping):
        raise Ig2mjError(f"replace = {replace!r}: a mapping of names to what takes their place")
    names = [remove] if isinstance(remove, str) else list(remove)
    pairs = [(name, None) for name in names] + [(name, os.fspath(new)) for name, new in (replace or {}).items()]
    for name, _ in pairs:
        if not isinstance(name, str) or not name:
            raise Ig2mjError(f"remove, replace: {name!r} is no name of an object")
    return [Change(name, instead).text for name, instead in pairs]


def added(requested: Iterable[object]) -> list:
    """Of values of `objects` those that are objects to add, and neither changes, substances nor further states."""
    return [t for t in requested if read_change(t) is None and not is_substances(t) and not is_extra(t)]


@dataclasses.dataclass(frozen=True)
class ChangedHome:
    """A home without what was taken out of it.

    Attributes:
      manifest: without it. removed: all names that are gone for good; those of replaced objects are not among them.
      planned: the replacements, as `add_objects` takes them. rooms: of each replacement.
      dependents: loose objects that stood on a replaced one or a carpet -> what they stand on now, the lowest first.
      bottoms: height (m) of the lower edge of each dependent.
    """

    manifest: Manifest
    removed: tuple[str, ...]
    planned: list[tuple[Addition, LibraryModel]]
    rooms: dict[str, list[str]]
    dependents: dict[str, str]
    bottoms: dict[str, float]


def take_out(
    root: ElementTree.Element,
    manifest: Manifest,
    model: mujoco.MjModel,
    changes: Sequence[Change],
    also: Iterable[str] = (),
) -> ChangedHome:
    """Takes objects out of a home.

    Args:
      root: its MJCF; it is changed. manifest: not changed. model: compiled from it.
      also: loose objects that go, too, with what stands on them.

    Raises:
      UnknownNameError: the home has no such object, or there is no such model. Ig2mjError: an object cannot be taken
        out, or is named twice.
    """
    entries = {o.name: o for o in manifest.objects}
    _check(changes, entries, manifest.name)
    home = _AtStart(model, manifest)
    replaced = {c.name: find_model(c.instead) for c in changes if c.instead is not None}
    bearing = home.bearing()
    removed = [c.name for c in changes if c.instead is None]
    floor = next((o.name for o in entries.values() if o.category == "floors"), None)
    thin = {name for name in removed if floor is not None and np.ptp(home.box(name)[:, 2]) < THIN}
    gone = _above([name for name in removed if name not in thin] + list(also), bearing) | thin
    if left := sorted(gone & set(replaced)):
        raise Ig2mjError(f"'{left[0]}' is replaced, and what it stands on is removed: remove it, too, or keep that")
    lowered = [*replaced, *sorted(thin)]
    onto = _above(lowered, bearing) - set(lowered)
    fixed = {name for name in onto if entries[name].fixed}
    gone = (gone | fixed | _above(list(fixed), bearing)) - set(replaced)
    dependents = {
        name: next(k for k, above in bearing.items() if name in above and (k in lowered or k in onto))
        for name in _lowest_first(lowered, bearing)
        if name in onto - gone
    }
    dependents = {name: str(floor) if under in thin else under for name, under in dependents.items()}
    planned = [(home.replacement(entries[name], new), new) for name, new in replaced.items()]
    names = gone | set(replaced)
    names |= {part.object for name in names for part in entries[name].parts}
    _remove(root, [entries[name] for name in names])
    kept = copy.copy(manifest)
    kept.objects = [o for o in manifest.objects if o.name not in names]
    rooms = {name: entries[name].rooms for name in replaced}
    bottoms = {name: float(home.box(name)[0][2]) for name in dependents}
    return ChangedHome(kept, tuple(sorted(gone)), planned, rooms, dependents, bottoms)


def _check(changes: Sequence[Change], entries: Mapping[str, ObjectEntry], home: str) -> None:
    twice = [name for name, count in collections.Counter(c.name for c in changes).items() if count > 1]
    if twice:
        raise Ig2mjError(f"'{twice[0]}' is removed or replaced twice")
    known = [o.name for o in entries.values() if o.in_household]
    for change in changes:
        if change.name not in entries:
            raise UnknownNameError(f"object of {home}", change.name, known)
        if not entries[change.name].in_household:
            part = entries[change.name].part_of
            fix = f"; take {part}" if part is not None else ""
            raise Ig2mjError(f"'{change.name}' is a part of {part or 'the house'} and cannot be taken out{fix}")


def _above(names: Sequence[str], bearing: Mapping[str, set[str]]) -> set[str]:
    """These names, and all that stands on or in them."""
    found = list(dict.fromkeys(names))
    for name in found:
        found += [other for other in sorted(bearing.get(name, ())) if other not in found]
    return set(found)


def _lowest_first(names: Sequence[str], bearing: Mapping[str, set[str]]) -> list[str]:
    found = list(names)
    for name in found:
        found += [other for other in sorted(bearing.get(name, ())) if other not in found]
    return found[len(names) :]


class _AtStart:
    """What a home is like at its start."""

    def __init__(self, model: mujoco.MjModel, manifest: Manifest):
        self.model = copy.copy(model)
        self.model.opt.enableflags &= ~int(mujoco.mjtEnableBit.mjENBL_SLEEP)  # sleeping pairs have no contacts
        self.data = mujoco.MjData(self.model)
        if model.nkey:
            mujoco.mj_resetDataKeyframe(self.model, self.data, 0)
        mujoco.mj_forward(self.model, self.data)
        self.entries = {o.name: o for o in manifest.objects}
        roots = {self.model.body(body).id: o.name for o in manifest.objects for body in o.bodies}
        self.owner = [roots.get(int(self.model.body_rootid[b]), "") for b in range(model.nbody)]
        solid = (model.geom_contype != 0) | (model.geom_conaffinity != 0)
        self.geoms = collections.defaultdict(list)
        for geom in np.flatnonzero(solid):
            self.geoms[self.owner[int(model.geom_bodyid[geom])]].append(int(geom))

    def bearing(self) -> dict[str, set[str]]:
        """Object -> what stands directly on or in it. The building bears nothing that could go with it."""
        found: dict[str, set[str]] = collections.defaultdict(set)
        for k in range(self.data.ncon):
            contact = self.data.contact[k]
            if abs(contact.frame[2]) < SUPPORTING:
                continue
            lower, upper = (self.owner[int(self.model.geom_bodyid[g])] for g in contact.geom)
            if contact.frame[2] < 0:  # the normal points from the first geom to the second
                lower, upper = upper, lower
            if lower and upper and lower != upper and self._in_house(lower) and not self.entries[upper].fixed:
                found[lower].add(upper)
        self._add_fixed(found)
        return found

    def _add_fixed(self, found: dict[str, set[str]]) -> None:
        """Fixed objects touch nothing, since they cannot move: those whose lower edge is at a top of another."""
        fixed = [name for name, o in self.entries.items() if o.fixed and self._in_house(name) and self.geoms[name]]
        boxes = {name: np.array([self._geom_box(g) for g in self.geoms[name]]) for name in fixed}
        for upper in fixed:
            low, high = boxes[upper][:, 0].min(0), boxes[upper][:, 1].max(0)
            if low[2] < FLOOR:
                continue
            for lower in fixed:
                tops = boxes[lower]
                over = np.all((tops[:, 0, :2] < high[:2]) & (tops[:, 1, :2] > low[:2]), axis=1)
                if lower != upper and (over & (np.abs(tops[:, 1, 2] - low[2]) < TOUCHING)).any():
                    found[lower].add(upper)

    def _in_house(self, name: str) -> bool:
        return self.entries[name].category not in BUILDING

    def _geom_box(self, geom: int) -> np.ndarray:
        centre, half = self.model.geom_aabb[geom, :3], self.model.geom_aabb[geom, 3:]
        turn = self.data.geom_xmat[geom].reshape(3, 3)
        middle, reach = self.data.geom_xpos[geom] + turn @ centre, np.abs(turn) @ half
        return np.array([middle - reach, middle + reach])

    def box(self, name: str) -> np.ndarray:
        """[2, 3] m, world: around an object's collision geometry."""
        boxes = np.array([self._geom_box(g) for g in self.geoms[name]])
        return np.array([boxes[:, 0].min(0), boxes[:, 1].max(0)])

    def replacement(self, old: ObjectEntry, new: LibraryModel) -> Addition:
        """The new object in the old one's place."""
        root = self.model.body(old.bodies[0]).id
        turn = self.data.xmat[root].reshape(3, 3)
        yaw = math.atan2(turn[1, 0], turn[0, 0])
        middle = self.data.xpos[root] + turn @ np.array(old.base_link_offset)
        forward = np.array([math.cos(yaw), math.sin(yaw)])
        spot = middle[:2]
        if old.fixed:  # its back stays where it is, so that it does not go into the wall
            spot = spot + forward * (new.entry.bounding_box[0] - old.bounding_box[0]) / 2
        offset = np.array(new.entry.base_link_offset)
        x, y = spot - [forward @ (offset[0], -offset[1]), forward @ (offset[1], offset[0])]
        z = float(self.box(old.name)[0, 2]) + new.entry.bounding_box[2] / 2 - float(offset[2])
        place = (round(float(x), 6), round(float(y), 6), round(z, 6), round(math.degrees(yaw), 6))
        fixed, loose = (place, None) if old.fixed else (None, place)
        folder = str(new.folder) if new.own else None
        return Addition(old.name, new.category, new.model, new.sha256, fixed, loose, folder, new.named)


def _remove(root: ElementTree.Element, entries: Sequence[ObjectEntry]) -> None:
    """Removes bodies, and what refers to anything in them."""
    world = root.find("worldbody")
    assert world is not None
    requested = {body for entry in entries for body in entry.bodies}
    counts = [(body, _positions(body)) for body in world.findall("body")]
    for key in root.findall("keyframe/key"):
        for other in ("qvel", "act", "ctrl", "mpos", "mquat"):
            key.attrib.pop(other, None)
        if qpos := key.get("qpos", "").split():
            kept, at = [], 0
            for body, count in counts:
                if body.get("name") not in requested:
                    kept += qpos[at : at + count]
                at += count
            key.set("qpos", " ".join(kept))
    gone: set[str | None] = set()
    for body, _ in counts:
        if body.get("name") in requested:
            gone |= {element.get("name") for element in body.iter()}
            world.remove(body)
    gone.discard(None)
    for section in root:
        if section.tag in ("contact", "equality", "tendon", "actuator", "sensor"):
            for element in list(section):
                names = {value for part in element.iter() for k, value in part.attrib.items() if k != "name"}
                if names & gone:
                    section.remove(element)


def _positions(body: ElementTree.Element) -> int:
    """Numbers of qpos that a body and those below it have."""
    widths = {"free": 7, "ball": 4}
    return sum(7 if j.tag == "freejoint" else widths.get(j.get("type", ""), 1) for j in body.iter()
               if j.tag in ("joint", "freejoint"))  # fmt: skip
