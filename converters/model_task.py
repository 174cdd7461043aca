"""The work on one model at one scale: read, scale, decompose, weigh, plan. What a process pool is given."""

from __future__ import annotations

import dataclasses
import functools
import hashlib
import time

import numpy as np

from ig2mj.errors import Ig2mjError

from .base import inputs
from .base.description import Instance, ObjectModel, SceneDescription, Shape
from .base.options import Progress, no_progress
from .base.process_pool import map_tasks
from .bodies.assembly import Assembly, assemble
from .bodies.inertia import link_inertials
from .hulls.link_hulls import decompose_link, is_cached
from .hulls.pieces import HullOptions, LinkHulls
from .reading.dataset import Dataset
from .reading.scaling import instance_scale, scale_model


@dataclasses.dataclass
class BuiltModel:
    """A model at a scale, ready to be written as often as the scene holds it.

    Attributes:
      hulls: link -> its collision geometry. encrypted: visuals were replaced by hulls.
      file_hash: of the URDF and its meshes. seconds: the work took.
      inputs: what was read for it (`inputs.Record.answers`), for when that happened in another process.
    """

    assembly: Assembly
    hulls: dict[str, LinkHulls]
    encrypted: bool
    file_hash: str
    seconds: float
    inputs: dict[str, str] = dataclasses.field(default_factory=dict)


@dataclasses.dataclass(frozen=True)
class ModelTask:
    """One model at one scale out of a dataset. Equal tasks give equal results, so instances share them."""

    root: str
    scene: SceneDescription = dataclasses.field(compare=False, repr=False)
    instance: Instance = dataclasses.field(compare=False, repr=False)
    key: tuple
    hulls: HullOptions
    bullet_inertia: bool

    @property
    def label(self) -> str:
        """What the progress bar says."""
        return f"{self.instance.category}/{self.instance.model}"


def model_task(
    dataset: Dataset, scene: SceneDescription, instance: Instance, hulls: HullOptions, bullet_inertia: bool
) -> ModelTask:
    """The task that builds an instance's model."""
    bare = SceneDescription(name=scene.name, file=scene.file, instances=[])
    key = (
        instance.kind,
        instance.category,
        instance.model,
        _rounded(instance.bounding_box),
        _rounded(instance.scale),
    )
    return ModelTask(str(dataset.root), bare, instance, key, hulls, bullet_inertia)


def run_task(task: ModelTask) -> BuiltModel:
    """Does the work of a task. Raises InputError as the readers do."""
    with inputs.recording() as record:
        dataset = _dataset(task.root)
        instance = task.instance
        model = dataset.instance_model(task.scene, instance)
        scale = instance_scale(instance, model)
        weighed = instance.kind != "building" and model.metadata.bbox_size is not None
        density = dataset.density(instance.category) if weighed else None
        built = build_model(model, scale, density, task.hulls, task.bullet_inertia, igibson_visuals=True)
    built.inputs = record.answers
    return built


def is_quick(task: ModelTask) -> bool:
    """Whether all the geometry of a task is in the cache; a task that will fail is left to `run_task`, so not quick."""
    try:
        model = _dataset(task.root).instance_model(task.scene, task.instance)
        scaled = scale_model(model, instance_scale(task.instance, model))
    except Ig2mjError:
        return False
    return all(is_cached(link.collisions, task.hulls) for link in scaled.links.values() if link.collisions)


def build_model(
    model: ObjectModel,
    scale: np.ndarray,
    density: float | None,
    hulls: HullOptions,
    bullet_inertia: bool,
    *,
    igibson_visuals: bool,
    jobs: int = 1,
    progress: Progress = no_progress,
) -> BuiltModel:
    """From a model as read to one ready to be written (see `scale_model`, `decompose_link`, `link_inertials`).

    jobs: processes that decompose links.
    """
    start = time.perf_counter()
    scaled = scale_model(model, scale)
    tasks = [(link.collisions, hulls) for link in scaled.links.values()]
    found = map_tasks(_decompose, tasks, list(scaled.links), jobs, progress, _is_decomposed)
    decomposed = dict(zip(scaled.links, found, strict=True))
    inertials = link_inertials(scaled, density, bullet_inertia)
    pieces = {name: link_hulls.pieces for name, link_hulls in decomposed.items()}
    assembly = assemble(scaled, scale, pieces, inertials, igibson_visuals=igibson_visuals)
    for name, link_hulls in decomposed.items():
        assembly.warnings += [f"link '{name}': {line}" for line in link_hulls.warnings]
        if model.links[name].collisions and not link_hulls.pieces:
            assembly.warnings.append(f"link '{name}' has no usable collision geometry")
    encrypted = any(shape.encrypted for link in model.links.values() for shape in link.visuals)
    return BuiltModel(assembly, decomposed, encrypted, _file_hash(model), time.perf_counter() - start)


def _decompose(task: tuple[list[Shape], HullOptions]) -> LinkHulls:
    return decompose_link(*task)


def _is_decomposed(task: tuple[list[Shape], HullOptions]) -> bool:
    return not task[0] or is_cached(*task)


def forget_datasets() -> None:
    """Makes `run_task` read again what this process has read before: files may have changed since."""
    _dataset.cache_clear()


def _file_hash(model: ObjectModel) -> str:
    """First 16 hex digits of a hash over the URDF and the mesh files it names, by content, in document order."""
    digest = hashlib.sha256()
    shapes = (s for link in model.links.values() for s in (*link.collisions, *link.visuals))
    files = dict.fromkeys([model.file, *(shape.file for shape in shapes if shape.file is not None)])
    for file in files:
        digest.update(hashlib.sha256(inputs.content(file)).digest())
    return digest.hexdigest()[:16]


@functools.lru_cache(maxsize=2)
def _dataset(root: str) -> Dataset:
    return Dataset(root)


def _rounded(values: np.ndarray | None) -> tuple[float, ...] | None:
    """To 1e-6 (section 8, step 5), so that instances which differ by rounding share a model."""
    return None if values is None else tuple(round(float(v), 6) for v in values)
