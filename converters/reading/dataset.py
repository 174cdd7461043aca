"""A dataset root in iGibson's layout."""

from __future__ import annotations

import os
import pathlib
import re

import numpy as np

from ig2mj.errors import InputError, UnknownNameError

from ..base import inputs
from ..base.description import Instance, ObjectModel, SceneDescription
from ..base.file_access import FileGuard, OutsideError
from ..base.xml_reader import read_xml
from ..bodies.inertia import DEFAULT_DENSITY
from .dataset_files import CategorySpec, read_lines, read_overlaps, read_specs, read_version
from .looks import encrypted_twin
from .metadata import read_metadata
from .room_maps import read_room_maps, room_at
from .scene_urdf import FIXED_FURNITURE, SceneOptions, read_scene
from .urdf import read_urdf

__all__ = ["CategorySpec", "Dataset", "SceneOptions"]


class Dataset:
    """A dataset root.

    Attributes:
      root: the folder, resolved.
      version: text of VERSION, or None. warnings: what is odd about the root.
      specs: category -> CategorySpec. categories, room_types, non_sampleable: the lists of metadata/*.txt.

    Raises:
      InputError: the root is not a folder with objects/ or scenes/, or its metadata is broken.
    """

    def __init__(self, root: str | os.PathLike):
        self.root = inputs.real_path(root)
        if not inputs.is_folder(self.root / "objects") and not inputs.is_folder(self.root / "scenes"):
            raise InputError(
                root,
                "is not a dataset root: it has neither objects/ nor scenes/",
                fix="give the folder that holds VERSION, metadata/, objects/ and scenes/",
            )
        self.warnings: list[str] = []
        self.version = read_version(self.root, self.warnings)
        self.specs = read_specs(self.root, self.warnings)
        self.categories = read_lines(self.root, "categories.txt", self.warnings)
        self.room_types = read_lines(self.root, "room_categories.txt", self.warnings)
        self.non_sampleable = read_lines(self.root, "non_sampleable_categories.txt", self.warnings)
        self._models: dict[tuple[str, str], ObjectModel] = {}
        self._buildings: dict[tuple[str, str, str], ObjectModel] = {}

    def models(self, category: str) -> list[str]:
        """Model names of a category, sorted; [] where the category has no folder. Hidden entries and files are none."""
        return inputs.folders_in(self._inside("objects", category))

    def index(self) -> dict[str, list[str]]:
        """category -> model names, both sorted."""
        return {name: self.models(name) for name in inputs.folders_in(self.root / "objects")}

    def has_model(self, category: str, model: str) -> bool:
        """The model's folder holds its URDF."""
        folder = self._inside("objects", category, model)
        return any(inputs.is_file(folder / f"{model}{end}.urdf") for end in ("", "_simplified"))

    def density(self, category: str) -> float:
        """Bounding-box density of a category, kg/m^3; 67.0 where it has no spec."""
        spec = self.specs.get(category)
        return DEFAULT_DENSITY if spec is None or spec.density is None else spec.density

    def enable_ag(self, category: str) -> bool:
        """Objects of the category may be grasped with assistance; False where it has no spec."""
        spec = self.specs.get(category)
        return spec is not None and spec.enable_ag

    def model(self, category: str, model: str) -> ObjectModel:
        """Reads an object: URDF, meshes, metadata. Cached; the result must not be changed.

        Raises:
          InputError: the folder is missing, or something in it is broken.
        """
        key = (category, model)
        if key not in self._models:
            folder = self._inside("objects", category, model)
            if not inputs.is_folder(folder):
                fix = f"known models: {', '.join(self.models(category)[:5]) or 'none'}"
                raise InputError(folder, "model folder does not exist", element=f"{category}/{model}", fix=fix)
            file = folder / f"{model}.urdf"
            if not self.has_model(category, model):
                raise InputError(file, "does not exist", element=f"{category}/{model}")
            result = read_urdf(file, category, model, self.root)
            result.metadata = read_metadata(folder, result.warnings)
            _check_metadata(result)
            self._models[key] = result
        return self._models[key]

    def building(self, scene: str, category: str, model: str) -> ObjectModel:
        """Reads a building part (walls, floors, ceilings) of a scene. Cached; not to be changed."""
        key = (scene, category, model)
        if key not in self._buildings:
            folder = self._inside("scenes", scene)
            file = self._building_file(scene, category, model)
            if not inputs.is_file(file):
                raise InputError(file, "does not exist", element=f"{category} of {scene}")
            self._buildings[key] = read_urdf(file, category, model, self.root, mesh_folder=folder)
        return self._buildings[key]

    def instance_model(self, scene: SceneDescription, instance: Instance) -> ObjectModel:
        """`building` or `model`, whichever the instance is."""
        if instance.kind == "building":
            return self.building(scene.name, instance.category, instance.model)
        return self.model(instance.category, instance.model)

    def scenes(self) -> list[str]:
        """Names of the scenes, sorted."""
        folder = self.root / "scenes"
        if not folder.is_dir():
            return []
        return sorted(f.name for f in folder.iterdir() if (f / "urdf").is_dir())

    def scene_file(
        self, name: str, urdf: str | os.PathLike | None = None, random_index: int | None = None
    ) -> pathlib.Path:
        """The scene URDF that is read: an explicit path, an explicit name in the scene's urdf/ folder,
        `<S>_random_<index>`, `<S>_best`, `<S>`.

        Raises:
          UnknownNameError: no such scene. InputError: no such file.
        """
        folder = self._inside("scenes", name) / "urdf"
        if not inputs.is_folder(folder):
            raise UnknownNameError("scene", name, self.scenes())
        if urdf is not None:
            given = pathlib.Path(urdf)
            if inputs.is_file(given):
                return given
            word = given.name if given.suffix == ".urdf" else f"{given.name}.urdf"
            if given.parent == pathlib.Path() and inputs.is_file(folder / word):
                return folder / word
            known = ", ".join(f.name for f in sorted(folder.glob("*.urdf"))[:6])
            raise InputError(urdf, "does not exist", fix=f"{folder} has {known}")
        if random_index is not None:
            names = [f"{name}_random_{random_index}"]
        else:
            names = [f"{name}_best", name]
        for stem in names:
            if inputs.is_file(folder / f"{stem}.urdf"):
                return folder / f"{stem}.urdf"
        raise InputError(folder / f"{names[0]}.urdf", "does not exist", fix="name the file with --urdf")

    def scene(
        self, name: str, urdf: str | os.PathLike | None = None, options: SceneOptions | None = None
    ) -> SceneDescription:
        """Reads a scene: instances with random models chosen and filters applied, rooms, allowed overlaps.

        Raises:
          UnknownNameError: no such scene. InputError: naming the file and the element.
        """
        options = options or SceneOptions()
        description = read_scene(self.scene_file(name, urdf, options.random_index), name)
        folder = self._inside("scenes", name)
        description.rooms = read_room_maps(folder, self.room_types, description.warnings)
        description.overlaps_allowed = read_overlaps(folder / "misc" / "bbox_overlap.json")
        self._choose_models(description, options.seed)
        _filter(description, options)
        if options.fixed_furniture:
            for instance in description.instances:
                instance.fixed = instance.fixed or instance.category in FIXED_FURNITURE
        return description

    def missing(self, scene: SceneDescription) -> list[Instance]:
        """Instances (objects and building parts) whose model folder or file is not in the dataset."""
        absent = []
        for instance in scene.instances:
            if instance.kind == "building":
                there = inputs.is_file(self._building_file(scene.name, instance.category, instance.model))
            else:
                there = instance.kind != "object" or self.has_model(instance.category, instance.model)
            if not there:
                absent.append(instance)
        return absent

    def missing_meshes(self, scene: SceneDescription, instance: Instance) -> list[str]:
        """Collision meshes that an instance's URDF names and the dataset lacks, as named there."""
        if instance.kind == "building":
            file = self._building_file(scene.name, instance.category, instance.model)
            folder = self._inside("scenes", scene.name)
        elif instance.kind == "object":
            folder = self._inside("objects", instance.category, instance.model)
            simplified = folder / f"{instance.model}_simplified.urdf"
            file = simplified if inputs.is_file(simplified) else folder / f"{instance.model}.urdf"
        else:
            return []
        guard = FileGuard(file, self.root, folder)
        named = dict.fromkeys(
            mesh.get("filename") or "" for mesh in read_xml(file, "robot").iterfind("link/collision/geometry/mesh")
        )
        paths = {name: guard.resolve(name, "mesh") for name in named if name}
        return [name for name, path in paths.items() if not inputs.is_file(path) and encrypted_twin(path) is None]

    def _building_file(self, scene: str, category: str, model: str) -> pathlib.Path:
        return self._inside("scenes", scene, "urdf", f"{model}_{category}.urdf")

    def _inside(self, *parts: str) -> pathlib.Path:
        """A path below the root, whatever the parts say. Raises OutsideError."""
        for part in parts:
            if not part or "/" in part or "\\" in part or part in (".", "..") or "\0" in part:
                raise OutsideError(self.root, f"'{part}' is not a name of a folder", element="/".join(parts))
        path = self.root.joinpath(*parts)
        if not inputs.real_path(path).is_relative_to(self.root):
            raise OutsideError(path, "a symbolic link leads outside the dataset root", fix="copy the files instead")
        return path

    def _choose_models(self, scene: SceneDescription, seed: int) -> None:
        """model="random": evenly among the category's models; one choice per (category, random_group)."""
        rng = np.random.default_rng(seed)
        chosen: dict[tuple[str, str], str] = {}
        for instance in scene.instances:
            if instance.kind != "object" or instance.model != "random":
                continue
            models = [m for m in self.models(instance.category) if self.has_model(instance.category, m)]
            if not models:
                continue  # reported by `missing`
            choice = models[int(rng.integers(len(models)))]
            if instance.random_group is not None:
                choice = chosen.setdefault((instance.category, instance.random_group), choice)
            instance.model = choice


def _check_metadata(model: ObjectModel) -> None:
    """Warns of openable joints that the URDF has not."""
    for joint, _ in model.metadata.openable_joints:
        if joint not in model.joints:
            model.warnings.append(f"metadata.json: openable joint '{joint}' is not a joint of the URDF")


def _filter(scene: SceneDescription, options: SceneOptions) -> None:
    """Applies the loader's filters. An object without `room` is taken to be in the room it stands in."""
    requested = None if options.only_rooms is None else set(options.only_rooms)
    if requested is not None:
        known = {room for i in scene.instances for room in i.rooms} | set(scene.rooms.names if scene.rooms else [])
        for word in sorted(requested):
            if word not in known and word not in map(_room_type, known):
                raise UnknownNameError("room", word, sorted(known | set(map(_room_type, known))))
    kept = []
    for instance in scene.instances:
        if instance.category in options.without_categories:
            continue
        if instance.kind == "object":
            if options.only_categories is not None and instance.category not in options.only_categories:
                continue
            if requested is not None:
                rooms = instance.rooms or _standing_in(scene, instance)
                if not any(room in requested or _room_type(room) in requested for room in rooms):
                    continue
        kept.append(instance)
    _drop_orphans(scene, kept)


def _standing_in(scene: SceneDescription, instance: Instance) -> list[str]:
    if scene.rooms is None:
        return []
    room = room_at(scene.rooms, *(float(v) for v in instance.pose[:2, 3]))
    return [] if room is None else [room]


def _room_type(room: str) -> str:
    return re.sub(r"_\d+\Z", "", room)


def _drop_orphans(scene: SceneDescription, kept: list[Instance]) -> None:
    """Keeps multiplexers and groupers of which something is left, and drops names of those that are not."""
    owners = {name for i in kept if i.kind == "object" for name in (i.multiplexer, i.grouper) if name}
    owners |= {i.multiplexer for i in kept if i.kind == "grouper" and i.name in owners and i.multiplexer}
    scene.instances = [i for i in kept if i.kind not in ("multiplexer", "grouper") or i.name in owners]
    names = {i.name for i in scene.instances}
    for instance in scene.instances:
        instance.multiplexer = instance.multiplexer if instance.multiplexer in names else None
        instance.grouper = instance.grouper if instance.grouper in names else None
