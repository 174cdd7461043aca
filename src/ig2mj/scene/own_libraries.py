"""Folders that hold the user's own objects: those that `ig2mj objects add` keeps, and those of `IG2MJ_OBJECTS`.

    ig2mj objects add my_objects        # kept in a file of the user's configuration
    IG2MJ_OBJECTS=a:b ig2mj view maple  # of this command alone, before the others

A library is a folder with objects at any depth down to `DEPTH`, each a folder that `ig2mj convert object` wrote.
"""

from __future__ import annotations

import os
import pathlib

import msgspec
import platformdirs

from ig2mj.errors import InputError
from ig2mj.files.content import read_struct

VARIABLE = "IG2MJ_OBJECTS"
"""Environment variable with folders, separated as in PATH."""

DEPTH = 3
"""Levels below a library's folder on which objects are looked for: category/collection/model."""

MOST_FOLDERS = 20_000
"""Folders that are looked through in one library; a larger one is probably no library but a whole disk."""

_FILES = ("manifest.json", "object.xml")


class _Kept(msgspec.Struct, forbid_unknown_fields=True):
    """The file of the user's configuration."""

    libraries: list[str] = []


def libraries() -> list[pathlib.Path]:
    """The folders, those of the environment variable first, each once. Raises InputError: one of them is no folder."""
    given = [(f"${VARIABLE}", name) for name in os.environ.get(VARIABLE, "").split(os.pathsep) if name]
    kept = [(str(registry_file()), name) for name in _kept().libraries]
    found: dict[pathlib.Path, None] = {}
    for where, name in (*given, *kept):
        path = pathlib.Path(name).expanduser()
        if not path.is_dir():
            fix = "correct the variable" if where.startswith("$") else f"`ig2mj objects remove {name}`"
            raise InputError(where, f"names the library {name}, which is not a folder", fix=fix)
        found[path.resolve()] = None
    return list(found)


def add_library(folder: str | os.PathLike) -> tuple[pathlib.Path, list[pathlib.Path]]:
    """Keeps a library for this and later runs; its folder, and those of its objects.

    Raises:
      InputError: it is no folder, or holds no object.
    """
    path = pathlib.Path(folder).expanduser().resolve()
    if not path.is_dir():
        raise InputError(folder, "is not a folder", fix="name a folder that holds converted objects")
    found = object_folders(path)
    if not found:
        fix = "`ig2mj convert object --out DIR` writes one"
        raise InputError(folder, f"holds no converted object down to {DEPTH} levels", fix=fix)
    kept = _kept()
    if str(path) not in kept.libraries:
        _keep([*kept.libraries, str(path)])
    return path, found


def remove_library(folder: str | os.PathLike) -> pathlib.Path:
    """Removes a library from the list; its files stay. Raises InputError: it is not kept."""
    path = pathlib.Path(folder).expanduser().resolve()
    kept = _kept()
    left = [name for name in kept.libraries if name not in (str(path), str(folder))]
    if len(left) == len(kept.libraries):
        known = ", ".join(kept.libraries) or "none"
        raise InputError(folder, "is no library that was added", fix=f"those that were: {known}")
    _keep(left)
    return path


def object_folders(root: pathlib.Path) -> list[pathlib.Path]:
    """Folders of the objects in a library, sorted; the library itself, if it is the folder of an object."""
    found: list[pathlib.Path] = []
    level, looked = [root], 0
    for _ in range(DEPTH + 1):
        below: list[pathlib.Path] = []
        for folder in level:
            looked += 1
            if looked > MOST_FOLDERS:
                raise InputError(root, f"holds more than {MOST_FOLDERS} folders", fix="name the folder of the objects")
            if all((folder / name).is_file() for name in _FILES):
                found.append(folder)
                continue
            try:
                below += [f for f in folder.iterdir() if f.is_dir() and not f.name.startswith(".")]
            except PermissionError:
                continue
        level = below
    return sorted(found)


def registry_file() -> pathlib.Path:
    """The file that names the libraries that were added."""
    return pathlib.Path(platformdirs.user_config_dir("ig2mj")) / "objects.json"


def _kept() -> _Kept:
    file = registry_file()
    return read_struct(file, _Kept, fix="delete it, and add the libraries again") if file.is_file() else _Kept()


def _keep(names: list[str]) -> None:
    file = registry_file()
    file.parent.mkdir(parents=True, exist_ok=True)
    half = file.with_suffix(f".{os.getpid()}")
    half.write_bytes(msgspec.json.format(msgspec.json.encode(_Kept(names)), indent=1) + b"\n")
    half.replace(file)
