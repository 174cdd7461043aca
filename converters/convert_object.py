"""`ig2mj convert object`: one URDF, from the dataset or from anywhere, as an MJCF file of its own."""

from __future__ import annotations

import difflib
import os
import pathlib
import time

import mujoco
import numpy as np

from ig2mj import knowledge
from ig2mj.errors import InputError
from ig2mj.scene.manifest import FORMAT_VERSION, Manifest

from .base import inputs
from .base.description import ROBOT_CATEGORY, Instance, ObjectModel
from .base.naming import file_slug
from .base.options import ConvertOptions, under_limits
from .base.output import replaced_folder
from .base.process_pool import TaskPool
from .base.xml_reader import shortened
from .bodies.assembly import Assembly, extent
from .bodies.inertia import MassRule
from .bodies.joint_limits import start_positions
from .bodies.kinematics import model_bounds
from .bodies.placements import Placement, make_halves
from .bodies.robot_description import ROBOT_FILE, drop_markers, put_on_floating_base, robot_json
from .finish import ConversionOutcome, finish, version_record
from .hulls.pieces import HullOptions
from .mjcf.appearance import add_ground, add_setting
from .mjcf.manifest_entries import object_entry
from .mjcf.model_builder import ModelBuilder, write_model
from .mjcf.object import add_object
from .mjcf.parking import CLEARANCE, resting_pose
from .mjcf.scene import SceneBuild, add_start_key, rest_start
from .model_task import BuiltModel, build_model, decompose_model
from .reading.annotations import Annotations, annotate, annotation_warnings, read_annotations
from .reading.dataset import Dataset
from .reading.metadata import read_metadata
from .reading.scaling import scale_model
from .reading.urdf import read_urdf


@under_limits
def convert_object(
    urdf: str | os.PathLike,
    category: str,
    out: str | os.PathLike,
    *,
    model: str | None = None,
    bounding_box: tuple[float, float, float] | None = None,
    fixed: bool = False,
    annotations: str | os.PathLike | None = None,
    options: ConvertOptions | None = None,
) -> ConversionOutcome:
    """Converts one object: `object.xml`, `manifest.json`, `meshes/`, and the report.

    The object stands on a ground plane, free to move unless it is `fixed`; halves of a sliceable one lie next to it.
    Masses are the URDF's own. Without any, the object weighs its bounding box times a density: the category's where the
    URDF lies in a dataset, else a general one (`link_inertials`).

    Args:
      category: what it is, in iGibson's names: decides its abilities. "agent" is a robot: `robot.json` is written, too.
      model: its name, default the file's; a robot's is the one that its URDF gives.
      bounding_box: wanted size in base axes, m; default the size it has.
      fixed: it is furniture, and stands where it is put for good.
      annotations: TOML file with abilities and functional parts (`reading.annotations`).

    Raises:
      InputError: naming the file and the element.
    """
    options = options or ConvertOptions()
    file = pathlib.Path(urdf)
    start = time.perf_counter()
    options.progress(0, 2, f"reading {file.name}")
    marks = None if annotations is None else read_annotations(pathlib.Path(annotations))
    source, dataset = _read(file, category, model, options, marks)
    built = {source.model: _build(source, dataset, _scale(source, bounding_box), options)}
    built |= _halves(dataset, built[source.model], options)
    read_seconds = time.perf_counter() - start
    options.progress(1, 2, f"writing {source.model}")
    with replaced_folder(out) as folder:
        start = time.perf_counter()
        ag = dataset is None or source.category not in dataset.specs or dataset.enable_ag(source.category)
        builder, manifest, compiled = _write(
            source, built, folder, options, fixed=fixed, assisted_grasp=ag and not fixed
        )
        timings = {"models": read_seconds, "writing": time.perf_counter() - start}
        outcome = finish(
            folder,
            compiled,
            manifest,
            built,
            builder,
            options,
            kind="object",
            timings=timings,
        )
        if source.category == ROBOT_CATEGORY:
            (folder / ROBOT_FILE).write_text(robot_json(source), encoding="utf-8")
        options.progress(2, 2, source.model)
    return outcome


def _read(
    file: pathlib.Path, category: str, model: str | None, options: ConvertOptions, marks: Annotations | None
) -> tuple[ObjectModel, Dataset | None]:
    """Reads the URDF, its metadata, and the dataset it lies in, if it does. `marks`: annotations that it gets."""
    if not inputs.is_file(file):
        raise InputError(file, "is not a file", element="--urdf", fix="name an object's URDF")
    name = model or file.stem
    if not name.strip() or not category.strip():
        raise InputError(file, "the object needs a category and a name", element="--category, --model")
    root = _dataset_root(file)
    source = read_urdf(file, category, name, mesh_root=options.mesh_root, package_path=options.package_path,
        progress=options.progress)  # fmt: skip
    if category == ROBOT_CATEGORY:
        source.model = model or file_slug(source.title or name)
        put_on_floating_base(source)
        drop_markers(source)
    elif knowledge.synset(category) is None and not (marks and marks.abilities):
        near = difflib.get_close_matches(category, knowledge.categories(), n=3, cutoff=0.6)
        hint = f"; near matches: {', '.join(near)}" if near else ""
        source.warnings.append(f"--category {shortened(category)} is not known, so the object gets no abilities{hint}")
    prepared = inputs.is_folder(file.parent / "misc")
    source.metadata = read_metadata(file.parent, source.warnings if prepared else [])
    if marks is not None:
        annotate(source, marks)
        box = model_bounds(scale_model(source, 1.0))
        source.warnings += [] if box is None else annotation_warnings(source, *box)
    return source, None if root is None else Dataset(root)


def _dataset_root(file: pathlib.Path) -> pathlib.Path | None:
    """The root of the dataset that holds `objects/<category>/<model>/<model>.urdf`, or None."""
    parents = inputs.real_path(file).parents
    inside = len(parents) > 3 and parents[2].name == "objects"
    return parents[3] if inside and inputs.is_folder(parents[3] / "metadata") else None


def _build(source: ObjectModel, dataset: Dataset | None, scale: np.ndarray, options: ConvertOptions) -> BuiltModel:
    density = None if dataset is None else dataset.density(source.category)
    hulls = HullOptions.of(options)
    with TaskPool(options.jobs) as pool:
        found = decompose_model(source, hulls, pool, options.progress)
    masses: MassRule = "robot" if source.category == ROBOT_CATEGORY else "object"
    return build_model(
        source, found, scale, density, hulls, options.bullet_inertia, igibson_visuals=False, masses=masses,
        progress=options.progress,
    )  # fmt: skip


def _scale(source: ObjectModel, bounding_box: tuple[float, float, float] | None) -> np.ndarray:
    """Scale [3] that gives the object the size wanted. Raises InputError."""
    if bounding_box is None:
        return np.ones(3)
    requested = np.asarray(bounding_box, dtype=float)
    if not np.all(np.isfinite(requested)) or np.any(requested <= 0):
        raise InputError(
            source.file, f"cannot have the size {bounding_box}", element="--bbox", fix="give positive metres"
        )
    size = source.metadata.bbox_size
    if size is None:
        box = model_bounds(scale_model(source, 1.0))
        size = np.zeros(3) if box is None else box[1] - box[0]
    if np.any(np.asarray(size) <= 0):
        raise InputError(source.file, "is flat: it cannot be scaled to a bounding box", element="--bbox")
    return requested / size


def _halves(dataset: Dataset | None, whole: BuiltModel, options: ConvertOptions) -> dict[str, BuiltModel]:
    """`<model>_part_<i>` -> half of a sliceable object, at the whole's scale; {} where the dataset lacks one."""
    parts = whole.assembly.model.metadata.object_parts
    if dataset is None or not all(dataset.has_model(p.category, p.model) for p in parts):
        return {}
    made = {}
    for number, part in enumerate(parts):
        source = dataset.model(part.category, part.model)
        made[f"{whole.assembly.model.model}_part_{number}"] = _build(source, dataset, whole.assembly.scale, options)
    return made


def _beside(low: np.ndarray, high: np.ndarray, halves: dict[str, Assembly]) -> dict[str, np.ndarray]:
    """Poses (4x4) at rest on the ground in a row along +y, next to the object whose box is `low` to `high`."""
    places, edge = {}, high[1]
    for name, assembly in halves.items():
        pose = resting_pose(assembly)
        half_low, half_high = extent(assembly, pose)
        edge += CLEARANCE
        pose[:2, 3] += [(low[0] + high[0]) / 2, edge - half_low[1]]
        edge += half_high[1] - half_low[1]
        places[name] = pose
    return places


def _write(
    source: ObjectModel,
    built: dict[str, BuiltModel],
    folder: pathlib.Path,
    options: ConvertOptions,
    *,
    fixed: bool,
    assisted_grasp: bool,
) -> tuple[ModelBuilder, Manifest, mujoco.MjModel]:
    """Writes `object.xml`: the object on a ground plane, its halves next to it, all at rest."""
    colours = options.colours == "category"
    builder = ModelBuilder(source.model, folder, category_colours=colours, assets=options.assets)
    name, assemblies = source.model, {name: model.assembly for name, model in built.items()}
    base = resting_pose(assemblies[name])
    low, high = extent(assemblies[name], base)
    whole = Placement(Instance(name=name, category=source.category, model=source.model, pose=base, fixed=fixed))
    metadata = assemblies[name].model.metadata
    halves, _ = make_halves(whole, metadata.object_parts[: len(built) - 1], assemblies[name].scale, set())
    places = {name: base} | _beside(low, high, {half.name: assemblies[half.name] for half in halves})
    build = SceneBuild(builder, [], {}, {})
    for placement in [whole, *halves]:
        assembly = assemblies[placement.name]
        roots = [places[placement.name] @ assembly.bodies[index].pose for index in assembly.roots]
        elements = add_object(builder, assembly, placement.name, roots, fixed=fixed)
        build.elements[placement.name] = elements
        start = start_positions(assembly.model.joints, {})
        build.start_joints |= {name: start[joint] for joint, name in elements.joints.items()}
        build.entries.append(
            object_entry(
                placement.name,
                assembly,
                elements,
                fixed=fixed,
                parts=placement.parts,
                part_of=placement.part_of,
                parked=placement.parked,
                assisted_grasp=assisted_grasp,
            )
        )
    add_setting(builder.spec, low, high, None, distance=2.0)
    add_ground(builder.spec, builder.collision_class)
    add_start_key(builder.spec, build.start_joints)
    compiled = write_model(builder.spec, folder / "object.xml", exact=source.category == ROBOT_CATEGORY)
    if rest_start(build, compiled):
        compiled = write_model(builder.spec, folder / "object.xml", exact=source.category == ROBOT_CATEGORY)
    models = {f"{b.assembly.model.category}/{b.assembly.model.model}": b.file_hash for b in built.values()}
    manifest = Manifest(
        format_version=FORMAT_VERSION,
        name=name,
        objects=build.entries,
        source={**version_record(options), "kind": "object", "file": source.file.name, "models": models},
    )
    return builder, manifest, compiled
