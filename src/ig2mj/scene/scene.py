"""`load_scene`: one household, read from disk, checked, compiled. A `Scene` never changes during a run."""

from __future__ import annotations

import copy
import dataclasses
import functools
import hashlib
import json
import os
import pathlib
import shlex
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Protocol, runtime_checkable

import msgspec
import mujoco
import numpy as np

from ig2mj.cluster.jobs import import_function
from ig2mj.errors import Ig2mjError, InputError, ManifestError, UnknownNameError, without_lines
from ig2mj.files.inside import inside
from ig2mj.process.user_warning import warn_user
from ig2mj.scene.additions import Addition, plan_additions
from ig2mj.scene.build_tables import build_tables
from ig2mj.scene.ceilings import add_ceiling
from ig2mj.scene.changes import Change, changes_of, read_change
from ig2mj.scene.extras import add_joints, extras_as_text, pairs_of, read_extras
from ig2mj.scene.floors import deepen_floors
from ig2mj.scene.grasp_equalities import add_grasp_equalities
from ig2mj.scene.ground import GROUND, add_ground
from ig2mj.scene.library import find_model
from ig2mj.scene.manifest import FORMAT_VERSION, UPGRADE, AgentEntry, Manifest, ObjectEntry, load_manifest
from ig2mj.scene.merging import merged_home
from ig2mj.scene.mjcf_files import read_mjcf
from ig2mj.scene.mjcf_limits import check_mjcf
from ig2mj.scene.object_requests import ObjectRequest, Pose, read_request
from ig2mj.scene.parking import add_parking
from ig2mj.scene.paths import MANIFEST_FILE, SHIPPED_HOMES, model_file
from ig2mj.scene.physics_digest import physics_digest
from ig2mj.scene.rooms import Rooms, load_rooms
from ig2mj.scene.small_bodies import steady_small_bodies
from ig2mj.scene.start_overlap import check_start
from ig2mj.scene.substance_requests import (
    check_substances,
    read_substances,
    requested_substances,
    split_contents,
    substances_as_text,
    with_contents,
)
from ig2mj.scene.tables import SceneTables
from ig2mj.scene.walls import deepen_walls

PLAIN = "plain"
LOOKS = ("day", "night", PLAIN)
"""How scenes are seen: decorated, by day or by night; "plain": as their files have them. Physics is the same."""


class OldFormatWarning(UserWarning):
    """A converted scene lacks what a newer format has."""


KNOWN_DIGESTS = pathlib.Path(__file__).with_name("known_digests.json")
"""Hash of a scene's physics -> the hash that is in the names and headers of its known pools."""


@runtime_checkable
class Attachable(Protocol):
    """The part of a robot's interface that scenes use (see `ig2mj.agents.base`)."""

    def attach(self, spec: mujoco.MjSpec) -> AgentEntry:
        """Adds its bodies to a scene that is not compiled yet, at its start, and says what it added."""
        ...


Agent = Attachable | Callable[[mujoco.MjSpec], AgentEntry]
"""A robot, or just a function that adds bodies (nothing can control those but `ctrl`)."""


@dataclasses.dataclass(frozen=True, eq=False)
class Scene:
    """A household.

    Attributes:
      folder: where it was read from.
      manifest: everything about it that MJCF cannot say; lists the agents that were added, too.
      model: the compiled model. Engines that must change a model change a copy.
      tables: its constants as arrays.
      rooms: room maps, or None.
      agents: what was attached when it was loaded, in the order of the A axis.
      additions: objects that were added when it was loaded; they come last on the O axis.
      changes: objects of the home that were removed or replaced. removed: names of all that went, with what stood on
        them.
      looks: one of `LOOKS`: what `ig2mj.looks` adds where the scene is shown. `model` and `digest` do not depend on it.
      replacements: objects that took the place, and the names, of others.
    """

    folder: pathlib.Path
    manifest: Manifest
    model: mujoco.MjModel
    tables: SceneTables
    rooms: Rooms | None = None
    agents: tuple[Agent, ...] = ()
    additions: tuple[Addition, ...] = ()
    changes: tuple[Change, ...] = ()
    removed: tuple[str, ...] = ()
    looks: str = "day"
    replacements: tuple[Addition, ...] = ()

    @property
    def substances(self) -> tuple[str, ...]:
        """Names of the substances in use (docs/design/substances.md); empty where none were asked for."""
        return tuple(self.manifest.substances)

    @property
    def requested(self) -> list[str]:
        """What `load_scene(objects=...)` takes for its substances, changes and additions."""
        return [*self.changes_as_text, *(addition.requested for addition in self.additions)]

    @property
    def changes_as_text(self) -> list[str]:
        """`requested` without the additions."""
        extras = extras_as_text(self.manifest.extras)
        return [*requested_substances(self.manifest), *extras, *(change.text for change in self.changes)]

    @property
    def name(self) -> str:
        return self.manifest.name

    @property
    def object_names(self) -> tuple[str, ...]:
        return self.tables.object_names

    @functools.cached_property
    def digest(self) -> str:
        """Hash of what determines physics in the scene without its agents: its files as far as `physics_digest` goes,
        and the objects that were added to it. Pools are bound to it. Scenes of `KNOWN_DIGESTS` keep the hash by which
        their pools are known."""
        hashed = hashlib.blake2b(digest_size=16)
        hashed.update(physics_digest(model_file(self.folder), load_manifest(self.folder / MANIFEST_FILE)).encode())
        hashed.update("\n".join(self.object_names).encode())
        for addition in self.additions:
            hashed.update(f"\n{addition.find().physics_digest} {addition.place}".encode())
            if addition.start is not None:
                hashed.update(f" {addition.start}".encode())
        for change in self.changes:
            new = "" if change.instead is None else find_model(change.instead).physics_digest
            hashed.update(f"\n{change.name} {new}".encode())
        if self.substances:
            insides = [(o.name, o.inside) for o in self.manifest.objects if o.inside is not None]
            hashed.update(msgspec.json.encode([self.substances, insides]))
        if self.manifest.contents:
            hashed.update(msgspec.json.encode(self.manifest.contents))
        if pairs := pairs_of(self.manifest.extras):
            hashed.update(msgspec.json.encode([p if p.place else (p.child, p.parent) for p in pairs]))
        return _known_digests().get(hashed.hexdigest(), hashed.hexdigest())

    @functools.cached_property
    def files_digest(self) -> str:
        """Hash of every byte of its files and of the added models: what pools of format 2 made before `digest` was of
        physics alone are bound to."""
        hashed = hashlib.blake2b(digest_size=16)
        for file in (model_file(self.folder), self.folder / MANIFEST_FILE):
            hashed.update(file.read_bytes())
        hashed.update("\n".join((*self.object_names, *(a.sha256 for a in self.additions))).encode())
        hashed.update("".join(a.requested for a in self.additions if a.place is not None).encode())
        return hashed.hexdigest()

    def owns(self, digest: str | None) -> bool:
        """Whether what is bound to this digest, of either kind, belongs to the scene."""
        return digest == self.digest or digest == self.files_digest

    @property
    def portable_name(self) -> str:
        """What `load_scene` finds it by on any machine that has it: its bare name if it ships, else its folder."""
        ships = self.folder.resolve().parent == SHIPPED_HOMES.resolve()
        return self.folder.name if ships else str(self.folder.resolve())

    def object_index(self, name: str) -> int:
        """Place of the object on the O axis. Raises UnknownNameError, with near matches."""
        try:
            return self.object_names.index(name)
        except ValueError:
            raise UnknownNameError("object", name, self.object_names) from None

    def object(self, name: str) -> ObjectEntry:
        """The manifest's entry of an object. Raises UnknownNameError."""
        return self.manifest.objects[self.object_index(name)]

    def spec(self) -> mujoco.MjSpec:
        """The scene with additions and agents, read again, to be changed and compiled; ids are those of `model`."""
        file = model_file(self.folder)
        if self.additions or self.changes:
            own = load_manifest(self.folder / MANIFEST_FILE)
            merged = merged_home(file, own, self.changes, [(a, a.find()) for a in self.additions])
            spec = _spec_from_text(ElementTree.tostring(merged.root, encoding="unicode"), file)
        else:
            spec = read_spec(file)
        _make_solid(spec, self.manifest, self.folder)
        _attach_all(self.agents, spec, self.manifest)
        return spec

    def start_data(self) -> mujoco.MjData:
        """New data at the scene's start, everything derived up to date: the first keyframe, else the zero pose."""
        data = mujoco.MjData(self.model)
        if self.model.nkey:
            mujoco.mj_resetDataKeyframe(self.model, data, 0)
        mujoco.mj_forward(self.model, data)
        return data

    def __repr__(self) -> str:
        return f"Scene('{self.name}', {len(self.object_names)} objects, {self.folder})"


def _make_solid(spec: mujoco.MjSpec, manifest: Manifest, folder: pathlib.Path) -> None:
    """Makes the building and small objects fit for physics steps. The ceiling lies on walls as thin as they are drawn.

    Raises ManifestError: the manifest names a body that the scene does not have.
    """
    there = {body.name for body in spec.bodies}
    for entry in manifest.objects:
        for name in entry.bodies:
            if name not in there:
                problem = f"names the body '{name}', which scene.xml does not have"
                fix = "manifest.json and scene.xml must come from one conversion: convert the scene again"
                raise ManifestError(folder / MANIFEST_FILE, problem, element=f"object '{entry.name}'", fix=fix)
    deepen_floors(spec, manifest)
    add_ground(spec, manifest)
    add_ceiling(spec, manifest)
    deepen_walls(spec, manifest)
    steady_small_bodies(spec, manifest)
    add_parking(spec, manifest)
    add_joints(spec, manifest)


Objects = str | os.PathLike | Sequence[str | os.PathLike]
"""What is added to a home: one object, or several (`ig2mj.scene.object_requests` has the forms of one)."""

PLACER = "ig2mj.sampling.start_places:sample_places"
"""Samples where objects start of which a predicate is to hold: called with the scene, which has them outside the house,
and (object, predicate, object or room) for each; gives their poses by name. Named by a text, since samplers are built
on scenes."""


def load_scene(
    path: str | os.PathLike,
    agents: Sequence[Agent] = (),
    objects: Objects = (),
    *,
    remove: str | Sequence[str] = (),
    replace: Mapping[str, str | os.PathLike] | None = None,
    substances: str | Sequence[str] = (),
    looks: str = "day",
) -> Scene:
    """Loads a converted scene.

    Args:
      path: its folder, its scene.xml or its manifest.json, or the bare name of a home that ships with the project.
      agents: robots to compile into it, e.g. `FloatingHand(pos=(0, 0, 1))`.
      objects: what is added, one object or several, each the folder that `ig2mj convert object` wrote, or a name of the
        object library ("steak", "plate/plate_00"). With a place it starts there: "obj/mug@1,2,0.8,90" (its frame at x,
        y, z in m, turned by degrees about the vertical), or "obj/mug@on_top:breakfast_table_0" (sampled, always the
        same); without one it stands outside the house until it is put somewhere. An object from a folder is named
        `<folder name>_<n>`, one of a library `<category>_<n>`; `n` goes on from the home's own. Objects of one's own
        are loose at their place unless they were converted as fixed, those of the library that ships are fixed for
        good; "fixed:" and "loose:" after the "@" say which. "remove:NAME" and "replace:NAME=MODEL" stand for the
        arguments below. "with:on_fire", "with:broken" and
        "with:attached:CHILD>PARENT[@X,Y,Z]" ask for further states (`ig2mj.scene.extras`).
      remove: objects of the home that are taken out, with what stands on or in them (`Scene.removed`).
      replace: objects of the home, and what takes their place and their name: a folder or a name of the object library.
        It is fixed to the house if the old one was. What stood on the old one is put down on the new one where that
        has room for it, and is taken out where not.
      substances: names of what can fill containers and cover objects, next to those that the manifest names
        (`ig2mj.knowledge.substances`); "substances:water,salt" in `objects` says the same. With a container
        ("milk@carton_0") that is filled with it at the start.
      looks: how it is shown: "day" or "night", with wallpapers, curtains, lamps, plants and a garden that are visual
        only, or "plain", as its files have it. Physics, objects and hashes are the same.

    Raises:
      InputError: a file is missing or is not valid MJCF. UnknownNameError: there is no such folder and the library has
        no such object, the home has none of this name, or there are no such looks or no such substance.
        Ig2mjError: an object starts inside of something, or a replacement stands in something, or falls; or `agents`
        are no robots, two of them have one name, or one starts at no finite place.
        ManifestError: a manifest is broken, or does not belong to its MJCF. StateError: no place was found at which the
        predicate holds.
    """
    check_looks(looks)
    _check_agents(agents)
    file = model_file(path)
    home = load_manifest(file.parent / MANIFEST_FILE)
    if home.format_version < FORMAT_VERSION:
        fix = f"{UPGRADE} {shlex.quote(str(file.parent))}"
        warn_user(f"{file.parent}: of an older format, in which containers hold nothing ({fix})", OldFormatWarning)
    named, others = read_substances([*substances_as_text(_listed(substances)), *_listed(objects)])
    if named:
        names, contents = split_contents(named)
        names, contents = dict.fromkeys((*home.substances, *names)), dict.fromkeys((*home.contents, *contents))
        home = msgspec.structs.replace(home, substances=list(names), contents=list(contents))
    check_substances(home.substances)
    extras, others = read_extras(others)
    if extras:
        home = msgspec.structs.replace(home, extras=list(dict.fromkeys((*home.extras, *extras))))
    changes, requests = _requests([*changes_of(remove, replace), *others])
    if any(request.predicate for request in requests):
        plan = plan_additions(home, [dataclasses.replace(r, place=None) if r.predicate else r for r in requests])
        names = [addition.name for addition, _ in plan]
        asked = [(n, *r.predicate) for n, r in zip(names, requests, strict=True) if r.predicate]
        poses: dict[str, Pose] = import_function(PLACER)(_load(file, home, (), requests, changes), asked)
        requests = [
            dataclasses.replace(r, place=poses[n], kind="loose", predicate=None) if r.predicate else r
            for n, r in zip(names, requests, strict=True)
        ]
    scene = dataclasses.replace(_load(file, home, agents, requests, changes), looks=looks)
    check_start(scene.model, scene.tables, list(scene.additions))
    return scene


def check_looks(looks: str) -> None:
    """Raises UnknownNameError: there are no such looks."""
    if looks not in LOOKS:
        raise UnknownNameError("looks", looks, LOOKS)


def scene_with(scene: Scene | str | os.PathLike, objects: Objects = ()) -> Scene:
    """A loaded scene as it is, or what `load_scene` loads. Raises Ig2mjError: objects for a scene that is loaded."""
    if not isinstance(scene, Scene):
        return load_scene(scene, objects=objects)
    if objects:
        raise Ig2mjError(f"{scene.name} is loaded already: add objects with load_scene(..., objects=...)")
    return scene


def _listed(objects: Objects) -> list[str | os.PathLike]:
    if isinstance(objects, Mapping):
        raise Ig2mjError(f"objects = {objects!r}: a list of names, one for each object to add")
    if isinstance(objects, str | os.PathLike):
        return [objects]
    if not isinstance(objects, Iterable):
        raise Ig2mjError(f"{objects!r} is no list of names")
    return list(objects)


def _requests(objects: Objects) -> tuple[list[Change], list[ObjectRequest]]:
    """Changes and objects to add. Raises Ig2mjError."""
    changes, requests = list[Change](), list[ObjectRequest]()
    for text in _listed(objects):
        if (change := read_change(text)) is not None:
            changes.append(change.canonical)
        else:
            requests.append(read_request(text))
    return changes, requests


def _load(
    file: pathlib.Path,
    manifest: Manifest,
    agents: Sequence[Agent],
    requests: list[ObjectRequest],
    changes: list[Change],
) -> Scene:
    folder, additions, removed = file.parent, list[Addition](), tuple[str, ...]()
    replacements: tuple[Addition, ...] = ()
    if requests or changes:
        planned = plan_additions(manifest, requests)
        merged = merged_home(file, manifest, changes, planned)
        manifest, removed, replacements = merged.manifest, merged.removed, merged.replacements
        additions = [addition for addition, _ in planned]
        spec = _spec_from_text(ElementTree.tostring(merged.root, encoding="unicode"), file)
    else:
        spec = read_spec(file)
    _make_solid(spec, manifest, folder)
    manifest = with_contents(manifest)
    if agents:
        manifest = copy.copy(manifest)
        manifest.agents = [*manifest.agents, *_attach_all(agents, spec, manifest)]
    model = _compile(spec, file, generated=bool(requests or changes))
    rooms = None
    if manifest.rooms.file:
        rooms = load_rooms(inside(manifest.rooms.file, folder, folder / MANIFEST_FILE, "rooms.file"))
    tables = build_tables(model, manifest, rooms, folder / MANIFEST_FILE)
    scene = Scene(folder, manifest, model, tables, rooms, tuple(agents), tuple(additions), tuple(changes), removed)
    return dataclasses.replace(scene, replacements=replacements)


def _check_agents(agents: Sequence[Agent]) -> None:
    """Raises Ig2mjError: `agents` of `load_scene` are no robots, of one name, or at no place."""
    how = "[ig2mj.agents.Fetch().at(x, y, yaw)]"
    if isinstance(agents, str) or not isinstance(agents, Sequence):
        raise Ig2mjError(f"agents = {agents!r}: a list of robots is expected, such as {how}")
    names = list[str]()
    for agent in agents:
        if isinstance(agent, type) or not (isinstance(agent, Attachable) or callable(agent)):
            raise Ig2mjError(f"agents: {agent!r} is not a robot, such as those of {how}")
        place = [*getattr(agent, "pos", ()), *getattr(agent, "quat", ())]
        if not np.isfinite(np.asarray(place, float)).all():
            raise Ig2mjError(f"robot '{getattr(agent, 'name', agent)}' starts at {place}: finite numbers are expected")
        name = getattr(agent, "name", None)
        names += [name] if isinstance(name, str) else []
    if twice := [name for name in names if names.count(name) > 1]:
        raise Ig2mjError(f"two robots are named '{twice[0]}': give one another, such as Fetch(name=\"other\")")


def _attach_all(agents: Sequence[Agent], spec: mujoco.MjSpec, manifest: Manifest) -> list[AgentEntry]:
    """Adds the agents, and what must be compiled for them and the scene together."""
    entries = list[AgentEntry]()
    for agent in agents:
        try:
            entries.append(agent.attach(spec) if isinstance(agent, Attachable) else agent(spec))
        except ValueError as e:
            raise Ig2mjError(f"robot '{getattr(agent, 'name', agent)}' cannot be added to the scene: {e}") from e
    for entry in entries:
        for body, categories in entry.no_contact.items():
            passed = [name for o in manifest.objects if o.category in categories for name in o.bodies]
            below = [GROUND] if "floors" in categories and spec.body(GROUND) is not None else []
            for name in (*passed, *below):
                spec.add_exclude(bodyname1=body, bodyname2=name)
    add_grasp_equalities(spec, manifest, entries)
    return entries


@functools.cache
def _known_digests() -> dict[str, str]:
    return json.loads(KNOWN_DIGESTS.read_text(encoding="utf-8"))


def digest_of(scene: str, objects: Sequence[str] = ()) -> str:
    """`Scene.digest` of a scene and what is added to it: that another machine has the same. Errors of `load_scene`."""
    return load_scene(scene, objects=objects).digest


def read_spec(file: pathlib.Path) -> mujoco.MjSpec:
    """Parses a scene.xml whose paths lie where they may (`mjcf_files`). Raises InputError."""
    read_mjcf(file)
    try:
        return mujoco.MjSpec.from_file(str(file))
    except (ValueError, OSError) as e:
        raise _not_mjcf(file, e) from e


def _spec_from_text(text: str, file: pathlib.Path) -> mujoco.MjSpec:
    check_mjcf(file, text)
    try:
        return mujoco.MjSpec.from_string(text)
    except ValueError as e:
        raise _not_mjcf(file, without_lines(e)) from e


def _compile(spec: mujoco.MjSpec, file: pathlib.Path, generated: bool) -> mujoco.MjModel:
    try:
        return spec.compile()
    except (ValueError, OSError) as e:
        raise _not_mjcf(file, without_lines(e) if generated else e) from e


def _not_mjcf(file: pathlib.Path, e: Exception | str) -> InputError:
    return InputError(file, f"MuJoCo cannot load it: {e}", fix="convert the scene again")
