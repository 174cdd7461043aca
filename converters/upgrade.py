"""`ig2mj convert upgrade`: manifests of an older format brought to the present one, without converting again."""

from __future__ import annotations

import dataclasses
import os
import pathlib

import mujoco

from ig2mj.callbacks import ProgressCallback, no_progress
from ig2mj.errors import InputError
from ig2mj.scene.manifest import load_manifest, save_manifest
from ig2mj.scene.mjcf_files import read_mjcf

from .hulls.insides import add_insides

MODELS = ("scene.xml", "object.xml")


@dataclasses.dataclass(frozen=True)
class Upgraded:
    """folders: that hold a manifest. upgraded: whose manifest was changed. containers: with an inside, in all."""

    folders: int
    upgraded: int
    containers: int


def upgrade_folders(folder: str | os.PathLike, progress: ProgressCallback = no_progress) -> Upgraded:
    """Adds the inside of containers to every manifest below a folder.

    Manifests of the present version are computed again, which gives the same.

    Raises:
      InputError: there is none. ManifestError: one is broken.
    """
    root = pathlib.Path(folder)
    files = sorted(root.rglob("manifest.json")) if root.is_dir() else []
    pairs = [(f, next((f.with_name(n) for n in MODELS if f.with_name(n).is_file()), None)) for f in files]
    found = [(manifest, model) for manifest, model in pairs if model is not None]
    if not found:
        raise InputError(root, "holds no converted scene or object", fix="name a folder that `ig2mj convert` wrote")
    upgraded = containers = 0
    for done, (file, model) in enumerate(found):
        progress(done, len(found), file.parent.name)
        manifest = load_manifest(file)
        before = file.read_bytes()
        read_mjcf(model)
        try:
            compiled = mujoco.MjModel.from_xml_path(str(model))
        except ValueError as e:
            raise InputError(model, f"MuJoCo cannot load it: {e}", fix="convert it again") from e
        containers += add_insides(manifest, compiled)
        save_manifest(manifest, file)
        upgraded += before != file.read_bytes()
    progress(len(found), len(found), root.name)
    return Upgraded(len(found), upgraded, containers)
