"""Which folder and which file a scene's name means: a path, or the bare name of a home that ships with the project."""

from __future__ import annotations

import difflib
import os
import pathlib

from ig2mj.errors import InputError

MODEL_FILES, MANIFEST_FILE = ("scene.xml", "object.xml"), "manifest.json"

_HERE = pathlib.Path(__file__).resolve()

SHIPPED_HOMES = next(
    (folder for folder in (_HERE.parents[3] / "scenes_mjcf", _HERE.parents[2] / "ig2mj_scenes") if folder.is_dir()),
    _HERE.parents[2] / "ig2mj_scenes",
)
"""Homes that come with the project: the folder of a checkout, or the one next to an installed package. `load_scene`
finds them by their bare names."""

_URDF = (
    "`ig2mj convert object --urdf FILE` converts an object, `ig2mj convert scene` a scene; "
    "`ig2mj view SCENE --robot-urdf FILE` shows a robot"
)

_FIX = "give the folder that `ig2mj convert` wrote"


def _as_path(path: str | os.PathLike) -> pathlib.Path:
    if not isinstance(path, str | os.PathLike):
        raise InputError(repr(path), "is not a path", fix=f"{_FIX}, or the name of a home")
    return pathlib.Path(path)


def shipped_homes() -> list[str]:
    """Names of the homes in `SHIPPED_HOMES`, sorted."""
    return sorted(file.parent.name for file in SHIPPED_HOMES.glob(f"*/{MANIFEST_FILE}"))


def scene_folder(path: str | os.PathLike) -> pathlib.Path:
    """The folder of a converted scene.

    Args:
      path: that folder, one of its files scene.xml, object.xml or manifest.json, or the name of a home that ships.

    Raises:
      InputError: there is no such path (the message names near matches among the shipped homes), or it is another file.
    """
    path = _as_path(path)
    if path.is_dir():
        return path
    if path.suffix.lower() == ".urdf":
        raise InputError(path, "is a URDF, not a converted scene", fix=_URDF)
    if path.is_file():
        if path.name not in (*MODEL_FILES, MANIFEST_FILE):
            raise InputError(path, "is not a file of a converted scene", fix=f"{_FIX}, or its {MODEL_FILES[0]}")
        return path.parent
    bare = len(path.parts) == 1
    if bare and (SHIPPED_HOMES / path).is_dir():
        return SHIPPED_HOMES / path
    fix = _FIX
    if bare and (homes := shipped_homes()):
        near = difflib.get_close_matches(path.name, homes, n=3, cutoff=0.5)
        fix += (
            f", or a home that `ig2mj homes list` names; near matches: {', '.join(near)}"
            if near
            else (f", or one of {', '.join(homes)}")
        )
    raise InputError(path, "there is no such scene", fix=fix)


def model_file(path: str | os.PathLike) -> pathlib.Path:
    """The MJCF file of a scene: `path` itself, or the one in `scene_folder(path)`. Raises InputError."""
    path = _as_path(path)
    if path.is_file() and path.name in MODEL_FILES:
        return path
    folder = scene_folder(path)
    for name in MODEL_FILES:
        if (folder / name).is_file():
            return folder / name
    raise InputError(folder, f"holds no {MODEL_FILES[0]}", fix=_FIX)
