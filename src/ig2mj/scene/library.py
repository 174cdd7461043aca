"""Models of objects on disk that can be added to any home when it is loaded.

The object library that ships is scenes_mjcf/objects/<category>/<model>/, with meshes and textures shared with the
homes; its file preferred.json names the models that a category alone stands for, where that is not the first by name.
Libraries of one's own are folders that hold what `ig2mj convert object` wrote (`ig2mj.scene.own_libraries`), and
a single folder of that kind can be named itself.
"""

from __future__ import annotations

import dataclasses
import functools
import hashlib
import os
import pathlib
import re

import msgspec

from ig2mj.errors import Ig2mjError, InputError, UnknownNameError
from ig2mj.files.shell import command
from ig2mj.knowledge.taxonomy import synset
from ig2mj.scene import own_libraries, paths
from ig2mj.scene.manifest import Manifest, ObjectEntry, load_manifest
from ig2mj.scene.paths import MANIFEST_FILE
from ig2mj.scene.physics_digest import physics_digest, without_insides

FOLDER = "objects"
MODEL_FILE = "object.xml"
SCENE_FILE = "scene.xml"
PREFERRED_FILE, VARIANTS_FILE = "preferred.json", "variants.json"

ROBOT = "agent"
"""Category of robots that `ig2mj convert robot` wrote."""

CONVERT = "`ig2mj convert object --urdf FILE --category CATEGORY --out DIR` writes such a folder"


class LibraryName(str):
    """A name of the object library that is never read as a folder, as of the tasks that ship: the working directory may
    hold a folder of the same name."""

    __slots__ = ()


@dataclasses.dataclass(frozen=True)
class LibraryModel:
    """One model.

    Attributes:
      category, model: what it is. folder: where its files lie.
      own: of a library of one's own, or a folder. named: it is added by its folder, and named after it.
    """

    category: str
    model: str
    folder: pathlib.Path
    own: bool = False
    named: bool = False

    @property
    def file(self) -> pathlib.Path:
        """Its MJCF."""
        return self.folder / MODEL_FILE

    @property
    def prefix(self) -> str:
        """What its objects in a scene are named, before `_<n>`: its category, or the name of its folder."""
        return re.sub(r"[^\w-]+", "_", self.folder.name).strip("_") or self.category if self.named else self.category

    @property
    def reference(self) -> str:
        """What finds it: its folder, or "category/model"."""
        return str(self.folder) if self.named else f"{self.category}/{self.model}"

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
        entries = msgspec.json.encode(without_insides(self.manifest))
        return hashlib.sha256(self.file.read_bytes() + entries).hexdigest()

    @functools.cached_property
    def physics_digest(self) -> str:
        """Of what determines physics alone (`ig2mj.scene.physics_digest`)."""
        return physics_digest(self.file, self.manifest)


@functools.cache
def library() -> dict[str, dict[str, LibraryModel]]:
    """The library that ships: category -> model name -> model, sorted, but the preferred model of a category first.

    Empty where no homes were shipped.
    """
    file = paths.SHIPPED_HOMES / FOLDER / PREFERRED_FILE
    preferred: dict[str, str] = msgspec.json.decode(file.read_bytes(), type=dict[str, str]) if file.is_file() else {}
    found: dict[str, dict[str, LibraryModel]] = {}
    for file in sorted((paths.SHIPPED_HOMES / FOLDER).glob(f"*/*/{MODEL_FILE}")):
        category, model = file.parts[-3:-1]
        found.setdefault(category, {})[model] = LibraryModel(category, model, file.parent)
    for category, first in preferred.items():
        if first in found.get(category, ()):
            found[category] = {first: found[category][first], **found[category]}
    return found


@functools.cache
def split_models() -> dict[str, list[str]]:
    """Models of the library that ships which only splits use, by category; activities are not bound to them."""
    file = paths.SHIPPED_HOMES / FOLDER / VARIANTS_FILE
    return msgspec.json.decode(file.read_bytes(), type=dict[str, list[str]]) if file.is_file() else {}


def own_library() -> dict[str, dict[str, LibraryModel]]:
    """All models of the user's own libraries: category -> model name -> model, in the order of the libraries.

    Raises:
      InputError: a library cannot be read, or two models have the same category and name.
    """
    found: dict[str, dict[str, LibraryModel]] = {}
    # a library may hold another one, whose objects count once
    folders = [f.resolve() for root in own_libraries.libraries() for f in own_libraries.object_folders(root)]
    for folder in dict.fromkeys(folders):
        model = read_model(folder)
        models = found.setdefault(model.category, {})
        other = models.get(model.model) or library().get(model.category, {}).get(model.model)
        if other is not None:
            raise InputError(
                folder,
                f"is '{model.category}/{model.model}', as is {other.folder}",
                fix="convert it with another --model NAME, or leave its library out (`ig2mj objects remove DIR`)",
            )
        models[model.model] = model
    return found


def read_model(folder: pathlib.Path, *, named: bool = False) -> LibraryModel:
    """The object in a folder that `ig2mj convert object` wrote. `named`: see `LibraryModel`.

    Raises:
      ManifestError: its manifest is broken. InputError: it holds a home or a robot, or lacks a file.
    """
    folder = folder.resolve()
    if (folder / SCENE_FILE).is_file():
        raise InputError(folder, "holds a home, not an object", fix=CONVERT)
    if not (folder / MODEL_FILE).is_file():
        raise InputError(folder, f"holds no {MODEL_FILE}", fix=CONVERT)
    manifest = load_manifest(folder / MANIFEST_FILE)
    if not manifest.objects:
        raise InputError(folder / MANIFEST_FILE, "lists no object", fix="convert the object again")
    entry = manifest.objects[0]
    if entry.category == ROBOT:
        raise InputError(folder, "holds a robot, not an object", fix="robots are given by --robot, or `agents=[...]`")
    return LibraryModel(entry.category, entry.model, folder, own=True, named=named)


def folder_of(requested: str) -> pathlib.Path | None:
    """The folder of an object that a text names: it holds a manifest.json, or is that file or the MJCF next to it."""
    path = pathlib.Path(requested).expanduser()
    if path.name in (MANIFEST_FILE, MODEL_FILE) and path.is_file():
        path = path.parent
    return path if (path / MANIFEST_FILE).is_file() else None


def find_model(requested: str) -> LibraryModel:
    """The model that `requested` names.

    Args:
      requested: a folder that `ig2mj convert object` wrote; "apple", the first of this category; or "apple/apple_00". A
        category of the library that ships comes before one of the user's own.

    Raises:
      UnknownNameError: there is no such category or model. ManifestError, InputError: see `read_model`, `own_library`.
    """
    folder = None if isinstance(requested, LibraryName) else folder_of(requested)
    if folder is not None:
        return read_model(folder, named=True)
    category, _, model = requested.partition("/")
    shipped = library().get(category, {})
    if shipped and (not model or model in shipped):
        return shipped[model] if model else next(iter(shipped.values()))
    own = own_library()
    models = own.get(category, {})
    if models and (not model or model in models):
        return models[model] if model else next(iter(models.values()))
    raise _no_such_model(requested, category, model, own)


def _no_such_model(requested: str, category: str, model: str, own: dict[str, dict[str, LibraryModel]]) -> Ig2mjError:
    """The error with both readings: as a folder, and as a name."""
    path = pathlib.Path(requested).expanduser()
    if path.suffix.lower() == ".urdf":
        out = path.with_suffix("")
        convert = command("convert", "object", "--urdf", path, "--category", "CATEGORY", "--out", out)
        fix = f"`{convert}`, then give {out}"
        return InputError(path, "is a URDF, not a converted object", fix=fix)
    if path.is_dir():
        problem = f"is a folder without {MANIFEST_FILE}, and no name of the object library"
        return InputError(path, problem, fix=CONVERT)
    also = f"and there is no folder {os.fspath(path)} with a {MANIFEST_FILE} ({CONVERT})"
    categories = {**library(), **own}
    if model and category in categories:
        models = [*library().get(category, {}), *own.get(category, {})]
        return UnknownNameError(f"model of '{category}' in the object library", model, models, also=also)
    if synset(category) is not None:  # furniture has no models in the library
        also += f"; `ig2mj homes model {requested} --out DIR` writes furniture as such a folder"
    names = [*categories, *(f"{c}/{m}" for c, models in own.items() for m in models)]
    return UnknownNameError(
        "category of the object library", requested if "/" in requested else category, names, also=also
    )
