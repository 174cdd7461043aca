"""The object library: models on disk that can be added to any home when it is loaded.

scenes_mjcf/objects/<category>/<model>/object.xml and manifest.json     meshes and textures shared with the homes
"""

from __future__ import annotations

import dataclasses
import functools
import hashlib
import pathlib

import msgspec

from ig2mj.errors import UnknownNameError
from ig2mj.scene import paths
from ig2mj.scene.manifest import Manifest, ObjectEntry, load_manifest
from ig2mj.scene.paths import MANIFEST_FILE
from ig2mj.scene.physics_digest import physics_digest

FOLDER = "objects"
MODEL_FILE = "object.xml"


@dataclasses.dataclass(frozen=True)
class LibraryModel:
    """One model of the library.

    Attributes:
      category, model: what it is. folder: where its files lie.
    """

    category: str
    model: str
    folder: pathlib.Path

    @property
    def file(self) -> pathlib.Path:
        """Its MJCF."""
        return self.folder / MODEL_FILE

    @functools.cached_property
    def manifest(self) -> Manifest:
        """The object, then its halves. Raises ManifestError."""
        return load_manifest(self.folder / MANIFEST_FILE)

    @property
    def entry(self) -> ObjectEntry:
        """The manifest's entry of the object itself."""
        return self.manifest.objects[0]

    @functools.cached_property
    def sha256(self) -> str:
        """Of all that the object depends on: its MJCF, whose meshes and textures are named by their content, and its
        entries in the manifest. The version of the converter is not part of it."""
        entries = msgspec.json.encode(self.manifest.objects)
        return hashlib.sha256(self.file.read_bytes() + entries).hexdigest()

    @functools.cached_property
    def physics_digest(self) -> str:
        """Of what determines physics alone (`ig2mj.scene.physics_digest`)."""
        return physics_digest(self.file, self.manifest)


@functools.cache
def library() -> dict[str, dict[str, LibraryModel]]:
    """Category -> model name -> model; all that is on disk, sorted. Empty where no homes were shipped."""
    found: dict[str, dict[str, LibraryModel]] = {}
    for file in sorted((paths.SHIPPED_HOMES / FOLDER).glob(f"*/*/{MODEL_FILE}")):
        category, model = file.parts[-3:-1]
        found.setdefault(category, {})[model] = LibraryModel(category, model, file.parent)
    return found


def find_model(wanted: str) -> LibraryModel:
    """The model that `wanted` names: "apple" (the first of its category), or "apple/apple_00".

    Raises:
      UnknownNameError: there is no such category or model.
    """
    category, _, model = wanted.partition("/")
    models = library().get(category)
    if not models:
        raise UnknownNameError("category of the object library", category, library())
    if not model:
        return next(iter(models.values()))
    if model not in models:
        raise UnknownNameError(f"model of '{category}' in the object library", model, models)
    return models[model]
