"""`make_home`: the TOML of a home becomes a folder that loads everywhere a home does.

Rooms, doors and furniture are placed and written as a scene of a dataset (`ig2mj_homes.own`) and converted; furniture
from folders and loose objects are added to the result; where loose objects lie is sampled; the home is checked.
"""

from __future__ import annotations

import collections
import dataclasses
import json
import os
import pathlib
import tempfile
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ig2mj.callbacks import ProgressCallback, no_progress
from ig2mj.errors import AbilityError, Ig2mjError, StateError, UnknownNameError

if TYPE_CHECKING:
    import mujoco
    from ig2mj_converters.base.outcome import CheckResult
    from ig2mj_homes.own.own_home import OwnHome

    from ig2mj.sampling.conditions import Condition
    from ig2mj.sampling.query import SceneQuery
    from ig2mj.sampling.row import Row, RowSampler
    from ig2mj.scene.manifest import ObjectEntry
    from ig2mj.scene.scene import Scene

MAX_HULLS = 16
"""Convex pieces per link of the models of the catalogue, as in the homes that ship."""

ATTEMPTS, STRIDE = 6, 1000
"""Samples of an object until a robot can still get everywhere, and what is added to their number each time."""

STEPS = ("placing furniture", "converting", "adding objects", "sampling", "checking")


@dataclasses.dataclass(frozen=True)
class MadeHome:
    """What `make_home` did.

    Attributes:
      folder: of the home. rooms: their names. objects: name -> category of all that is in use, without the building.
      checks: of the converter; `opens`: what opens does so under 20 N or 5 N m, and stays open and half-open;
        `reachable`: a robot of 0.3 m radius reaches every room and doorway.
    """

    folder: pathlib.Path
    rooms: list[str]
    objects: dict[str, str]
    checks: list[CheckResult]

    @property
    def failed(self) -> list[str]:
        """The checks that failed, a line each."""
        return [f"{check.name}: {check.summary}{_first(check)}" for check in self.checks if not check.passed]


def _first(check: CheckResult) -> str:
    """The first object of a failed check, and its problem."""
    if not check.failures:
        return ""
    return f" ({check.failures[0].get('object', '')} {check.failures[0].get('problem', '')})"


def make_home(
    file: str | os.PathLike,
    out: str | os.PathLike | None = None,
    *,
    seed: int | None = None,
    jobs: int = 1,
    progress: ProgressCallback = no_progress,
) -> MadeHome:
    """Makes a home.

    Args:
      file: its TOML (`ig2mj_homes.own.description`).
      out: output folder; an earlier result there is replaced once all went well. None: a folder of the home's name in
        the working directory.
      seed: in place of the file's. jobs: processes of the conversion.
      progress: called with (steps done, steps in all, what is done).

    Raises:
      InputError: it names the file, the table and the key, and what is wrong.
    """
    from ig2mj_homes.own.description import read_home

    description = read_home(file)  # errors before what takes seconds to import
    from ig2mj_converters.base.options import ConvertOptions
    from ig2mj_converters.base.output import replaced_folder
    from ig2mj_converters.conversion import convert_scene
    from ig2mj_homes.own.own_home import build_own

    if seed is not None:
        description.seed = seed
    target = pathlib.Path(out) if out is not None else pathlib.Path(description.name)
    with replaced_folder(target) as folder, tempfile.TemporaryDirectory(prefix="ig2mj-home-") as temporary:
        work = pathlib.Path(temporary)

        def begin(step: str) -> None:
            progress(STEPS.index(step), len(STEPS), step)

        begin("placing furniture")
        home = build_own(description, work / "dataset")
        for element, texts in _groups(home):
            _check_names(home, element, texts)
        begin("converting")
        options = ConvertOptions(jobs=jobs, cache=False, max_hulls=MAX_HULLS, report=False)
        convert_scene(work / "dataset", description.name, work / "converted", options=options)
        begin("adding objects")
        _add(home, work, folder)
        begin("sampling")
        closed = _compiled(folder)
        _sample(home, folder)
        begin("checking")
        checks = _check(home, folder, closed)
        progress(len(STEPS), len(STEPS), "done")
    objects = {o.name: o.category for o in _scene(target).manifest.objects if o.in_household}
    return MadeHome(target, home.rooms, objects, checks)


def _scene(folder: pathlib.Path) -> Scene:
    from ig2mj.scene.scene import load_scene

    return load_scene(folder)


def _compiled(folder: pathlib.Path) -> mujoco.MjModel:
    """The scene without what only physics has."""
    import mujoco

    return mujoco.MjModel.from_xml_path(str(folder / "scene.xml"))


def _add(home: OwnHome, work: pathlib.Path, folder: pathlib.Path) -> None:
    """Writes the converted scene with what the dataset does not have: furniture from folders and loose objects."""
    import msgspec

    from ig2mj.scene.additions import Addition, add_objects, read_absolute
    from ig2mj.scene.library import read_model
    from ig2mj.scene.manifest import load_manifest
    from ig2mj.scene.scene_folder import ROOMS_FILE, write_scene_folder

    converted = work / "converted"
    planned = []
    for piece in home.pieces:
        model = read_model(piece.folder, named=True)
        x, y, z, yaw = piece.pose
        fixed, start = ((x, y, z, yaw), None) if piece.fixed else (None, (x, y, z, yaw))
        planned.append((Addition(piece.name, model.category, model.model, model.sha256, fixed, start), model))
    for loose in home.loose:
        model = read_model(_converted(loose, work), named=True)
        planned.append((Addition(loose.name, model.category, model.model, model.sha256), model))
    root = read_absolute(converted / "scene.xml")
    manifest = add_objects(root, load_manifest(converted), planned)
    rooms = {piece.name: list(piece.rooms) for piece in home.pieces}
    manifest.objects = [
        msgspec.structs.replace(o, rooms=rooms[o.name]) if o.name in rooms else o for o in manifest.objects
    ]
    manifest.source = {**manifest.source, "file": pathlib.Path(home.description.file).name}
    write_scene_folder(root, manifest, folder, converted / ROOMS_FILE)


def _converted(loose: Any, work: pathlib.Path) -> pathlib.Path:
    """The folder of a loose object's converted model."""
    from ig2mj_converters.base.options import ConvertOptions
    from ig2mj_converters.conversion import convert_object

    if loose.source.suffix != ".urdf":
        return loose.source
    folder = work / "objects" / loose.category / loose.model
    if not folder.is_dir():
        options = ConvertOptions(cache=False, max_hulls=MAX_HULLS, report=False)
        convert_object(loose.source, loose.category, folder, model=loose.model, options=options)
    return folder


def _sample(home: OwnHome, folder: pathlib.Path) -> None:
    """Puts every loose object where its conditions hold, and makes the result the start of the home."""
    from ig2mj_homes.own.own_home import unreachable

    from ig2mj.sampling.many import make_sampler
    from ig2mj.scene.manifest import save_manifest
    from ig2mj.scene.scene_folder import write_start
    from ig2mj.states.initial import manifest_states

    scene = _scene(folder)
    sampler = make_sampler(scene)
    asked: list[Condition] = []
    row: Row | None = None
    for number, (element, texts) in enumerate(_groups(home)):
        requested = _read(home, scene, element, texts)
        if requested:
            for attempt in range(ATTEMPTS):
                row = _row(home, sampler, element, requested, number + attempt * STRIDE)
                lost = unreachable(home, _boxes(home, sampler.query))
                if not lost:
                    break
            else:
                text = " and ".join(map(str, requested))
                problem = f"where {text} holds, a robot of 0.3 m radius has no way to {lost}"
                raise home.description.error(element, problem, "give it another place")
            assert row is not None
            sampler.start_from(row.physics, row.states)
            asked += requested
    if row is None:
        return
    for condition in asked:
        if not sampler.holds([condition], row.states):
            problem = f"{condition} no longer holds when all objects are placed"
            raise home.description.error("objects", problem, "try another seed, or other conditions")
    engine = sampler.query.engine
    model, data = engine.to_mujoco(sampler.query.physics, 0)
    write_start(folder, model, data.qpos)
    names = [model.body(b).name for b in range(model.nbody)]
    for entry, states in zip(scene.manifest.objects, manifest_states(sampler.model, row.states, names), strict=True):
        entry.state = states
    lying = {loose.name for loose in home.loose}
    for entry in scene.manifest.objects:
        if entry.name in lying and scene.rooms is not None:
            room = scene.rooms.room_at(data.body(entry.bodies[0]).xpos[:2])
            entry.rooms = [room] if room is not None else []
    save_manifest(scene.manifest, folder / "manifest.json")


def _groups(home: OwnHome) -> list[tuple[str, tuple[str, ...]]]:
    """(element of the file, conditions) of what is sampled one after another."""
    groups = [(f"objects.{loose.key}.where", loose.conditions) for loose in home.loose]
    return [*groups, ("conditions", tuple(home.description.conditions))]


def _conditions(home: OwnHome, element: str, texts: tuple[str, ...]) -> list[Condition]:
    """Conditions with rooms by their names in the scene. Raises InputError."""
    from ig2mj.sampling.conditions import read_conditions

    rooms = {name: f"{name}_0" for name in home.description.rooms if f"{name}_0" in home.rooms}
    try:
        found = read_conditions(texts)
    except Ig2mjError as e:
        raise home.description.error(element, str(e)) from e
    return [dataclasses.replace(c, arguments=tuple(rooms.get(a, a) for a in c.arguments)) for c in found]


def _check_names(home: OwnHome, element: str, texts: tuple[str, ...]) -> None:
    """Refuses names that nothing in the home has, before it is converted."""
    things = home.made.things.things.values()
    known = {*(t.name for t in things), *(t.category for t in things), *home.rooms}
    known |= {name for loose in home.loose for name in (loose.name, loose.category)}
    for name in (a for c in _conditions(home, element, texts) for a in c.arguments):
        if name not in known and name.partition("#")[0] not in known:
            raise home.description.error(
                element, str(UnknownNameError("object, room or category", name, sorted(known)))
            )


def _read(home: OwnHome, scene: Scene, element: str, texts: tuple[str, ...]) -> list[Condition]:
    """Conditions of objects in the scene, categories bound. Raises InputError."""
    from ig2mj.sampling.conditions import bind

    found = _conditions(home, element, texts)
    try:
        return bind(found, scene.tables, np.random.default_rng([home.description.seed, 1]))
    except (StateError, UnknownNameError) as e:
        raise home.description.error(element, str(e)) from e


def _row(home: OwnHome, sampler: RowSampler, element: str, requested: list[Condition], number: int) -> Row:
    """A state in which conditions hold, in addition to what stands. Raises InputError: none was found."""
    from ig2mj.sampling.many import sample_row

    try:
        row, rejected = sample_row(sampler, requested, home.description.seed, number)
    except (StateError, AbilityError, UnknownNameError) as e:
        raise home.description.error(element, str(e)) from e
    if row is None:
        reasons = _why(rejected)
        text = " and ".join(map(str, requested))
        raise home.description.error(element, f"{text} cannot be made true{reasons}")
    return row


def _why(rejected: collections.Counter) -> str:
    """The reasons why candidates were turned down, the most frequent first."""
    found = ", ".join(f"{reason} ({count} times)" for reason, count in rejected.most_common(3))
    return f": {found}" if found else ""


def _check(home: OwnHome, folder: pathlib.Path, closed: mujoco.MjModel) -> list[CheckResult]:
    """The checks that homes that ship pass; also writes them to checks.json. closed: before anything was opened."""
    from ig2mj_converters.base.outcome import CheckResult
    from ig2mj_converters.checks.run import run_checks
    from ig2mj_homes.own.own_home import unreachable

    from ig2mj.sampling.query import SceneQuery
    from ig2mj.scene.manifest import load_manifest

    checks = run_checks(_compiled(folder), load_manifest(folder), closed=closed)
    scene = _scene(folder)
    own = {piece.name for piece in home.pieces} | {loose.name for loose in home.loose}
    checks.append(_opens(closed, [o for o in scene.manifest.objects if o.name not in own and not o.parked]))
    query = SceneQuery(scene)
    lost = unreachable(home, _boxes(home, query))
    failures = [{"object": lost, "problem": "cannot be reached by a robot of 0.3 m radius"}] if lost else []
    summary = f"a robot of 0.3 m radius reaches {'not all of' if lost else 'all'} {len(home.rooms)} rooms"
    checks.append(CheckResult("reachable", not lost, summary, failures))
    kept = [{key: getattr(c, key) for key in ("name", "passed", "summary", "failures")} for c in checks]
    text = json.dumps(kept, indent=1, default=lambda value: value.tolist()) + "\n"
    (folder / "checks.json").write_text(text, encoding="utf-8", newline="\n")
    return checks


def _boxes(home: OwnHome, query: SceneQuery) -> np.ndarray:
    """[n, 2, 3] boxes around the loose objects, m."""
    names = {loose.name for loose in home.loose}
    boxes = [query.box(k) for k, name in enumerate(query.scene.object_names) if name in names]
    return np.array(boxes).reshape(-1, 2, 3)


def _opens(model: mujoco.MjModel, entries: Sequence[ObjectEntry]) -> CheckResult:
    """Whether everything that opens does; hinges of one's own objects are as their makers want them."""
    from ig2mj_converters.base.outcome import CheckResult
    from ig2mj_homes.objects.opening_strength import open_joint

    opened = {
        o.name: result
        for o in entries
        for result in (open_joint(model, j.joint, j.closed, j.open) for j in o.openable)
        if not result.works
    }
    count = sum(len(o.openable) for o in entries)
    failures = [
        {"object": name, "problem": f"{r.joint} opens to {r.reached:.0%}" + (f" and meets {r.met[0]}" if r.met else "")}
        for name, r in opened.items()
    ]
    text = f"{count - len(failures)} of {count} joints open under 20 N or 5 N m and stay open"
    return CheckResult("opens", not failures, text, failures)
