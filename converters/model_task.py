"""The work on one model: read, decompose, then for every size scale, weigh, plan. What a process pool is given."""

from __future__ import annotations

import dataclasses
import functools
import hashlib
import time
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from ig2mj.callbacks import ProgressCallback, no_progress
from ig2mj.errors import Ig2mjError

from .base import inputs
from .base.description import ROBOT_CATEGORY, Instance, ObjectModel, SceneDescription
from .base.process_pool import TaskPool
from .base.read_limits import ReadLimits, limits, limits_of
from .bodies.assembly import Assembly, assemble
from .bodies.inertia import MassRule, link_inertials
from .bodies.kinematics import model_bounds
from .bodies.robot_description import grasping_links
from .checks.plausible import implausible
from .hulls.link_hulls import LinkPieces, all_cached, decompose_links, scaled_pieces
from .hulls.pieces import HullOptions, LinkHulls
from .reading.dataset import Dataset
from .reading.scaling import instance_scale, link_maps, scale_model


@dataclasses.dataclass
class BuiltModel:
    """A model at a scale, ready to be written as often as the scene holds it.

    Attributes:
      hulls: link -> its collision geometry. encrypted: visuals were replaced by hulls.
      file_hash: of the URDF and its meshes. seconds: the work took.
      source_box: [2, 3] lowest and highest corner of the source's collision shapes in base axes, joints at 0, scaled;
        None without shapes.
      inputs: what was read for it (`inputs.Record.answers`), for when that happened in another process.
    """

    assembly: Assembly
    hulls: dict[str, LinkHulls]
    encrypted: bool
    file_hash: str
    seconds: float
    source_box: np.ndarray | None = None
    inputs: dict[str, str] = dataclasses.field(default_factory=dict)


@dataclasses.dataclass(frozen=True)
class ModelTask:
    """One model out of a dataset, at every scale that a scene has it in: it is read and decomposed once.

    Attributes:
      instances: one for each scale; they differ in nothing else that matters.
    """

    root: str
    scene: SceneDescription = dataclasses.field(repr=False)
    instances: tuple[Instance, ...] = dataclasses.field(repr=False)
    hulls: HullOptions
    bullet_inertia: bool
    limits: ReadLimits

    @property
    def label(self) -> str:
        """What the progress bar says."""
        return f"{self.instances[0].category}/{self.instances[0].model}"


def model_tasks(
    dataset: Dataset,
    scene: SceneDescription,
    instances: Sequence[Instance],
    hulls: Callable[[Instance], HullOptions],
    bullet_inertia: bool,
) -> tuple[list[ModelTask], list[list[list[str]]]]:
    """The tasks that build the models of these instances, under the limits in force.

    Returns:
      The tasks, and for each scale of each task the names of the instances that have it.
    """
    bare = SceneDescription(name=scene.name, file=scene.file, instances=[])
    models: dict[tuple, dict[tuple, list[Instance]]] = {}
    for instance in instances:
        scale = (_rounded(instance.bounding_box), _rounded(instance.scale))
        scales = models.setdefault((instance.kind, instance.category, instance.model), {})
        scales.setdefault(scale, []).append(instance)
    tasks, names = [], []
    for scales in models.values():
        firsts = tuple(same[0] for same in scales.values())
        tasks.append(ModelTask(str(dataset.root), bare, firsts, hulls(firsts[0]), bullet_inertia, limits()))
        names.append([[instance.name for instance in same] for same in scales.values()])
    return tasks, names


def run_task(task: ModelTask) -> list[BuiltModel]:
    """Does the work of a task, one result for each of its instances. Raises InputError as the readers do."""
    with inputs.recording() as record, limits_of(task.limits):
        dataset = _dataset(task.root)
        first = task.instances[0]
        source = dataset.instance_model(task.scene, first)
        density = dataset.density(first.category) if first.kind != "building" else None
        found = decompose_model(source, task.hulls)
        built = [
            build_model(
                source, found, instance_scale(instance, source), density, task.hulls, task.bullet_inertia,
                igibson_visuals=True, masses="object" if first.kind == "building" else "dataset",
            )
            for instance in task.instances
        ]  # fmt: skip
    for model in built:
        model.inputs = record.answers
    return built


def is_quick(task: ModelTask) -> bool:
    """Whether all the geometry of a task is in the cache; a task that will fail is left to `run_task`, so not quick."""
    try:
        source = scale_model(_dataset(task.root).instance_model(task.scene, task.instances[0]), 1.0)
    except Ig2mjError:
        return False
    return all_cached({name: link.collisions for name, link in source.links.items()}, task.hulls)


def decompose_model(
    model: ObjectModel, hulls: HullOptions, pool: TaskPool | None = None, progress: ProgressCallback = no_progress
) -> dict[str, LinkPieces]:
    """The convex pieces of every link of a model as it was read, unscaled: the work that takes long.

    Of a robot only the base and what may hold something are cut up (`grasping_links`). The other links of its arms get
    one hull for each mesh: they touch nothing but obstacles, and cutting them up takes minutes.

    pool: does shapes and parts of all links side by side.
    """
    links = {name: link.collisions for name, link in scale_model(model, 1.0).links.items()}
    if model.category != ROBOT_CATEGORY:
        return decompose_links(links, hulls, pool, progress)
    cut = {model.base, *grasping_links(model)}
    found = decompose_links({name: links[name] for name in links if name in cut}, hulls, pool, progress)
    plain = dataclasses.replace(hulls, whole_meshes=True)
    found |= decompose_links({name: links[name] for name in links if name not in cut}, plain, pool, progress)
    return {name: found[name] for name in links}


def build_model(
    model: ObjectModel,
    found: Mapping[str, LinkPieces],
    scale: np.ndarray,
    density: float | None,
    hulls: HullOptions,
    bullet_inertia: bool,
    *,
    igibson_visuals: bool,
    masses: MassRule,
    progress: ProgressCallback = no_progress,
) -> BuiltModel:
    """From a model as read to one ready to be written (see `scale_model`, `scaled_pieces`, `link_inertials`).

    Args:
      found: what `decompose_model` made of it.
      density: kg per m3 of the bounding box; None: the general one (see `link_inertials`).
      masses: what the URDF's inertials count for.
    """
    start = time.perf_counter()
    scaled = scale_model(model, scale)
    maps = link_maps(model, scale)
    decomposed = {}
    for name, link in scaled.links.items():
        progress(len(decomposed), len(scaled.links), f"link {name}: collision geoms")
        decomposed[name] = scaled_pieces(found[name], link.collisions, maps[name], hulls)
    inertials = link_inertials(scaled, density, bullet_inertia, masses)
    pieces = {name: link_hulls.pieces for name, link_hulls in decomposed.items()}
    assembly = assemble(scaled, scale, pieces, inertials, igibson_visuals=igibson_visuals)
    for name, link_hulls in decomposed.items():
        assembly.warnings += [f"link '{name}': {line}" for line in link_hulls.warnings]
        if model.links[name].collisions and not link_hulls.pieces:
            assembly.warnings.append(f"link '{name}' has no usable collision geometry")
    box = model_bounds(scaled)
    assembly.warnings += implausible(scaled, assembly)
    encrypted = any(shape.encrypted for link in model.links.values() for shape in link.visuals)
    seconds = time.perf_counter() - start + sum(pieces.seconds for pieces in found.values())
    return BuiltModel(assembly, decomposed, encrypted, _file_hash(model), seconds, box)


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
    """To 1e-6, so that instances which differ by rounding share a model."""
    return None if values is None else tuple(round(float(v), 6) for v in values)
