"""`ig2mj convert scene`: a whole household out of a dataset in iGibson's layout."""

from __future__ import annotations

import hashlib
import os
import pathlib
import time
from typing import Any

import numpy as np

from ig2mj.errors import InputError
from ig2mj.scene.manifest import FORMAT_VERSION, Manifest, RoomsEntry

from .base import inputs
from .base.description import Instance, SceneDescription
from .base.options import ConvertOptions, under_limits
from .base.output import replaced_folder
from .base.process_pool import TaskPool
from .base.transforms import quat_from_rotation
from .bodies.assembly import has_own_look
from .bodies.placements import Placement, complete_parts, make_halves, place_instances
from .finish import ConversionOutcome, finish, version_record
from .hulls.pieces import HullOptions
from .mjcf.manifest_entries import room_entries, task_entry, vec3
from .mjcf.model_builder import ModelBuilder, write_model
from .mjcf.scene import SceneBuild, build_scene, fill_states, rest_start
from .model_task import BuiltModel, forget_datasets, is_quick, model_tasks, run_task
from .reading.dataset import Dataset
from .reading.room_maps import write_rooms
from .reading.scene_urdf import SceneOptions, parse_object_scope

ROOMS_FILE = "rooms.npz"


@under_limits
def convert_scene(
    dataset_root: str | os.PathLike,
    name: str,
    out: str | os.PathLike,
    *,
    urdf: str | os.PathLike | None = None,
    options: ConvertOptions | None = None,
) -> ConversionOutcome:
    """Converts a scene: `scene.xml`, `manifest.json`, `meshes/`, `rooms.npz`, and the report.

    Args:
      dataset_root: holds `objects/`, `scenes/` and `metadata/`. name: of the folder in `scenes/`.
      out: replaced as a whole when everything went well.
      urdf: a scene file other than the default one (iGibson's dataset format).

    Raises:
      InputError: naming the file and the element; without `options.skip_missing` also for models the dataset lacks.
    """
    options = options or ConvertOptions()
    timings: dict[str, float] = {}
    start = time.perf_counter()
    options.progress(0, 1, "reading the scene")
    forget_datasets()
    dataset = Dataset(dataset_root)
    scene = dataset.scene(name, urdf, SceneOptions.of(options))
    skipped = _drop_missing(dataset, scene, options)
    placements, warnings = place_instances(scene)
    timings["scene"] = time.perf_counter() - start

    start = time.perf_counter()
    built = _build_models(dataset, scene, placements, options, warnings)
    timings["models"] = time.perf_counter() - start

    with replaced_folder(out) as folder:
        start = time.perf_counter()
        options.progress(0, 1, "writing the scene")
        build = build_scene(
            ModelBuilder(name, folder, category_colours=_use_category_colours(built, options), assets=options.assets),
            placements,
            {object_name: model.assembly for object_name, model in built.items()},
            rooms=scene.rooms,
            assisted_grasp={category: spec.enable_ag for category, spec in dataset.specs.items()},
            ceiling_collision=options.ceiling_collision,
        )
        model = write_model(build.builder.spec, folder / "scene.xml")
        fill_states(build, model, placements)
        if rest_start(build, model, keep_hovering=options.keep_hovering):
            model = write_model(build.builder.spec, folder / "scene.xml")
        if scene.rooms is not None:
            write_rooms(scene.rooms, folder / ROOMS_FILE)
        timings["writing"] = time.perf_counter() - start
        options.progress(0, 1, "checking and reporting")
        return finish(
            folder,
            model,
            _manifest(dataset, scene, build, built, options),
            built,
            build.builder,
            options,
            kind="scene",
            timings=timings,
            overlaps_allowed=scene.overlaps_allowed,
            warnings=[*dataset.warnings, *scene.warnings, *warnings],
            skipped=skipped,
            rooms=scene.rooms,
        )


def _use_category_colours(built: dict[str, BuiltModel], options: ConvertOptions) -> bool:
    """Whether untextured visuals get their category's colour (see `ConvertOptions.colours`)."""
    if options.colours != "auto":
        return options.colours == "category"
    return not any(has_own_look(model.assembly) for model in built.values())


def _drop_missing(dataset: Dataset, scene: SceneDescription, options: ConvertOptions) -> list[str]:
    """Takes instances whose model the dataset lacks out of the scene, or refuses, listing all of them."""
    missing = dataset.missing(scene)
    lines = [f"{i.name} ({i.category}/{i.model})" for i in missing]
    if options.skip_missing:  # without it the reader refuses the first mesh that is not there
        absent = {i.name for i in missing}
        for instance in scene.instances:
            if instance.name not in absent and (meshes := dataset.missing_meshes(scene, instance)):
                missing.append(instance)
                lines.append(f"{instance.name} ({instance.category}/{instance.model}): no {', '.join(meshes)}")
    if not missing:
        return []
    if not options.skip_missing:
        problem = f"{len(lines)} models are not in the dataset: {', '.join(lines)}"
        raise InputError(scene.file, problem, fix="--skip-missing converts without them")
    gone = {i.name for i in missing}
    scene.instances = [i for i in scene.instances if i.name not in gone]
    return lines


def _build_models(
    dataset: Dataset,
    scene: SceneDescription,
    placements: list[Placement],
    options: ConvertOptions,
    warnings: list[str],
) -> dict[str, BuiltModel]:
    """Object name -> its model. Adds the halves of sliceable objects that the scene does not list to `placements`."""
    models = _run_tasks(dataset, scene, [p.instance for p in placements], options)
    by_name = {p.name: p for p in placements}
    taken = {i.name for i in scene.instances}
    made: list[Placement] = []
    for whole in list(placements):
        assembly = models[whole.name].assembly
        parts = assembly.model.metadata.object_parts
        halves = [p for p in placements if p.part_of == whole.name]
        if halves:
            complete_parts(whole, halves, parts)
        elif parts and whole.part_of is None:
            lacking = [f"{p.category}/{p.model}" for p in parts if not dataset.has_model(p.category, p.model)]
            if lacking:
                text = f"'{whole.name}' cannot be sliced: its parts {', '.join(lacking)} are not in the dataset"
                warnings.append(text)
                continue
            new, lines = make_halves(whole, parts, assembly.scale, taken)
            made += new
            warnings += lines
    assert all(p.name not in by_name for p in made)
    placements += made
    return models | _run_tasks(dataset, scene, [p.instance for p in made], options)


def _run_tasks(
    dataset: Dataset, scene: SceneDescription, instances: list[Instance], options: ConvertOptions
) -> dict[str, BuiltModel]:
    """Builds each model at each of its sizes once, over the process pool."""

    def hulls(instance: Instance) -> HullOptions:
        return HullOptions.of(options, building=instance.kind == "building")

    tasks, names = model_tasks(dataset, scene, instances, hulls, options.bullet_inertia)
    with TaskPool(options.jobs) as pool:
        results = pool.map(run_task, tasks, [task.label for task in tasks], options.progress, is_quick)
    built: dict[str, BuiltModel] = {}
    for models, sizes in zip(results, names, strict=True):
        for model, same in zip(models, sizes, strict=True):
            inputs.add(model.inputs)
            built |= dict.fromkeys(same, model)
    return {instance.name: built[instance.name] for instance in instances}


def _manifest(
    dataset: Dataset,
    scene: SceneDescription,
    build: SceneBuild,
    built: dict[str, BuiltModel],
    options: ConvertOptions,
) -> Manifest:
    named = [room for entry in build.entries for room in entry.rooms]
    rooms = RoomsEntry(file=ROOMS_FILE if scene.rooms is not None else None, instances=room_entries(scene.rooms, named))
    models = {f"{b.assembly.model.category}/{b.assembly.model.model}": b.file_hash for b in built.values()}
    return Manifest(
        format_version=FORMAT_VERSION,
        name=scene.name,
        objects=build.entries,
        source={
            **version_record(options),
            "kind": "scene",
            "file": scene.file.name,
            "sha256": hashlib.sha256(inputs.content(scene.file)).hexdigest(),
            "dataset_version": dataset.version,
            "models": dict(sorted(models.items())),
        },
        rooms=rooms,
        task=_task(scene, build),
    )


def _task(scene: SceneDescription, build: SceneBuild) -> dict[str, Any] | None:
    scopes: dict[str, str] = {}
    rooms: dict[str, str] = {}
    for entry in build.entries:
        for instance, room in parse_object_scope(entry.object_scope or "").items():
            scopes[instance] = entry.name
            if room is not None:
                rooms[instance] = room
    agents = [_agent(i) for i in scene.instances if i.kind in ("agent", "agent_pose")]
    for instance in (i for i in scene.instances if i.kind == "agent" and i.object_scope):
        scopes |= dict.fromkeys(parse_object_scope(instance.object_scope or ""), instance.name)
    return task_entry(pathlib.Path(scene.file).stem, scopes, rooms, agents)


def _agent(instance: Instance) -> dict[str, Any]:
    """Start pose of an agent: of its centre of mass for `agent` without saved poses, else of its base."""
    quat = [round(float(q), 9) + 0.0 for q in quat_from_rotation(np.asarray(instance.pose)[:3, :3])]
    return {
        "name": instance.name,
        "kind": instance.kind,
        "model": instance.model,
        "pos": list(vec3(instance.pose[:3, 3])),
        "quat": quat,
    }
