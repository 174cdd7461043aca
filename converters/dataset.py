"""A dataset root in iGibson's layout (dataset_format.md section 1)."""

from __future__ import annotations

import dataclasses
import os
import pathlib

from .description import Instance, ObjectModel, SceneDescription
from .scene_urdf import SceneOptions


@dataclasses.dataclass(frozen=True)
class CategorySpec:
    """One entry of avg_category_specs.json: size [3] m, mass kg, density kg/m^3 of the bounding box."""

    size: tuple[float, float, float] | None
    mass: float | None
    density: float
    enable_ag: bool


class Dataset:
    """A dataset root.

    Attributes:
      root: the folder, resolved.
      version: text of VERSION, or None. warnings: what is odd about the root.
      specs: category -> CategorySpec. categories, room_types, non_sampleable: the lists of metadata/*.txt.
    """

    root: pathlib.Path
    version: str | None
    warnings: list[str]
    specs: dict[str, CategorySpec]
    categories: list[str]
    room_types: list[str]
    non_sampleable: list[str]

    def __init__(self, root: str | os.PathLike):
        raise NotImplementedError

    def models(self, category: str) -> list[str]:
        """Model names of a category, sorted; [] where the category has no folder."""
        raise NotImplementedError

    def has_model(self, category: str, model: str) -> bool:
        raise NotImplementedError

    def density(self, category: str) -> float:
        """Bounding-box density of a category, kg/m^3; 67.0 where it has no spec (section 6)."""
        raise NotImplementedError

    def enable_ag(self, category: str) -> bool:
        raise NotImplementedError

    def model(self, category: str, model: str) -> ObjectModel:
        """Reads an object: URDF, meshes, metadata. Cached; the result must not be changed."""
        raise NotImplementedError

    def building(self, scene: str, category: str, model: str) -> ObjectModel:
        """Reads a building part (walls, floors, ceilings) of a scene (section 2.3)."""
        raise NotImplementedError

    def instance_model(self, scene: SceneDescription, instance: Instance) -> ObjectModel:
        """`building` or `model`, whichever the instance is."""
        raise NotImplementedError

    def scene(
        self, name: str, urdf: str | os.PathLike | None = None, options: SceneOptions | None = None
    ) -> SceneDescription:
        """Reads a scene: instances with random models chosen and filters applied, rooms, allowed overlaps."""
        raise NotImplementedError

    def missing(self, scene: SceneDescription) -> list[Instance]:
        """Instances (objects and building parts) whose model folder or file is not in the dataset."""
        raise NotImplementedError
