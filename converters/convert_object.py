"""`ig2mj convert object`: one URDF, from the dataset or from anywhere, as an MJCF file of its own."""

from __future__ import annotations

import os
import pathlib
import time

import numpy as np

from ig2mj.errors import InputError
from ig2mj.scene.manifest import FORMAT_VERSION, Manifest

from .base import inputs
from .base.description import ObjectModel
from .base.options import ConvertOptions
from .base.output import replaced_folder
from .bodies.assembly import extent
from .finish import Outcome, finish, version_record
from .mjcf.appearance import add_ground, add_setting
from .mjcf.file import write_model
from .mjcf.manifest_entries import object_entry
from .mjcf.model_builder import ModelBuilder
from .mjcf.object import add_object
from .mjcf.parking import resting_pose
from .mjcf.scene import add_start_key
from .model_task import BuiltModel, build_model
from .reading.dataset import Dataset
from .reading.joint_limits import clamp
from .reading.metadata import read_metadata
from .reading.urdf import read_urdf


def convert_object(
    urdf: str | os.PathLike,
    category: str,
    out: str | os.PathLike,
    *,
    model: str | None = None,
    bounding_box: tuple[float, float, float] | None = None,
    options: ConvertOptions | None = None,
) -> Outcome:
    """Converts one object: `object.xml`, `manifest.json`, `meshes/`, and the report.

    The object stands on a ground plane, free to move. Masses are the URDF's own; missing ones come from the
    category's density where the URDF lies in a dataset, else from a general one.

    Args:
      category: what it is, in iGibson's names: decides its abilities. model: its name, default the URDF's.
      bounding_box: wanted size in base axes, m; default the size it has.

    Raises:
      InputError: naming the file and the element.
    """
    options = options or ConvertOptions()
    file = pathlib.Path(urdf)
    start = time.perf_counter()
    options.progress(f"reading {file.name}", 0, 2)
    source, dataset = _read(file, category, model or file.stem)
    built = _build(source, dataset, bounding_box, options)
    read_seconds = time.perf_counter() - start
    options.progress(f"writing {source.model}", 1, 2)
    with replaced_folder(out) as folder:
        start = time.perf_counter()
        builder, manifest = _write(source, built, folder, options)
        compiled = write_model(builder.spec, folder / "object.xml")
        timings = {"models": read_seconds, "writing": time.perf_counter() - start}
        outcome = finish(
            folder,
            compiled,
            manifest,
            {source.model: built},
            builder,
            options,
            kind="object",
            timings=timings,
        )
        options.progress(source.model, 2, 2)
    return outcome


def _read(file: pathlib.Path, category: str, name: str) -> tuple[ObjectModel, Dataset | None]:
    """Reads the URDF, its metadata, and the dataset it lies in, if it does."""
    if not inputs.is_file(file):
        raise InputError(file, "is no file", element="--urdf", mend="name an object's URDF")
    if not name.strip() or not category.strip():
        raise InputError(file, "the object needs a category and a name", element="--category, --model")
    root = _dataset_root(file)
    source = read_urdf(file, category, name)
    prepared = inputs.is_folder(file.parent / "misc")
    source.metadata = read_metadata(file.parent, source.warnings if prepared else [])
    return source, None if root is None else Dataset(root)


def _dataset_root(file: pathlib.Path) -> pathlib.Path | None:
    """The root of the dataset that holds `objects/<category>/<model>/<model>.urdf`, or None."""
    parents = inputs.real_path(file).parents
    inside = len(parents) > 3 and parents[2].name == "objects"
    return parents[3] if inside and inputs.is_folder(parents[3] / "metadata") else None


def _build(
    source: ObjectModel,
    dataset: Dataset | None,
    bounding_box: tuple[float, float, float] | None,
    options: ConvertOptions,
) -> BuiltModel:
    own_masses = any(link.inertial is not None for link in source.links.values())
    density = None
    if dataset is not None and not own_masses and source.metadata.bbox_size is not None:
        density = dataset.density(source.category)
    hulls = options.hull_options()

    def built(scale: np.ndarray) -> BuiltModel:
        return build_model(
            source,
            scale,
            density,
            hulls,
            options.bullet_inertia,
            igibson_visuals=False,
            jobs=options.jobs,
            progress=options.progress,
        )

    if bounding_box is None:
        return built(np.ones(3))
    wanted = np.asarray(bounding_box, dtype=float)
    if not np.all(np.isfinite(wanted)) or np.any(wanted <= 0):
        raise InputError(
            source.file, f"cannot have the size {bounding_box}", element="--bbox", mend="give positive metres"
        )
    size = source.metadata.bbox_size
    if size is None:
        low, high = extent(built(np.ones(3)).assembly, np.eye(4))
        size = high - low
    if np.any(np.asarray(size) <= 0):
        raise InputError(source.file, "is flat: it cannot be scaled to a bounding box", element="--bbox")
    return built(wanted / size)


def _write(
    source: ObjectModel, built: BuiltModel, folder: pathlib.Path, options: ConvertOptions
) -> tuple[ModelBuilder, Manifest]:
    builder = ModelBuilder(source.model, folder, category_colours=options.colours == "category")
    assembly, name = built.assembly, source.model
    base = resting_pose(assembly)
    elements = add_object(
        builder,
        assembly,
        name,
        [base @ assembly.bodies[index].pose for index in assembly.roots],
        fixed=False,
    )
    low, high = extent(assembly, base)
    add_setting(builder.spec, low, high, None, distance=2.0)
    add_ground(builder.spec, builder.collision_class)
    add_start_key(builder.spec, {elements.joints[j.name]: clamp(j, 0.0) for j in assembly.joints()})
    manifest = Manifest(
        format_version=FORMAT_VERSION,
        name=name,
        objects=[object_entry(name, assembly, elements, fixed=False)],
        source={
            **version_record(options),
            "kind": "object",
            "file": source.file.name,
            "models": {f"{source.category}/{name}": built.file_hash},
        },
    )
    return builder, manifest
