"""Writes a scene that was put together from several folders as a folder of its own: `scene.xml`, `manifest.json`,
`meshes/`, `textures/`, `rooms.npz`.
"""

from __future__ import annotations

import hashlib
import pathlib
import shutil
import xml.etree.ElementTree as ElementTree
from collections.abc import Sequence

import mujoco
import numpy as np

from ig2mj.errors import InputError
from ig2mj.scene.manifest import Manifest, save_manifest
from ig2mj.scene.paths import MANIFEST_FILE, MODEL_FILES

ROOMS_FILE = "rooms.npz"
ASSETS = {"mesh": "meshes", "texture": "textures"}
"""Tag of an asset -> the folder of its files."""
DIGITS = 6
"""Behind the point, of positions (m, rad, unit quaternion): below what separates a resting object from a moving one."""


def write_scene_folder(
    root: ElementTree.Element, manifest: Manifest, folder: pathlib.Path, rooms: pathlib.Path | None = None
) -> None:
    """Writes a scene.

    Args:
      root: MJCF whose paths are absolute (`mjcf_text.make_absolute`); it is changed. folder: there already.
      rooms: file of the room maps, which is copied.

    Raises:
      InputError: a mesh or a texture cannot be read.
    """
    _drop_unused(root)
    compiler = root.find("compiler")
    if compiler is None:
        compiler = ElementTree.Element("compiler")
        root.insert(0, compiler)
    compiler.attrib.pop("assetdir", None)
    for tag, name in ASSETS.items():
        compiler.set(f"{tag}dir", name)
        for element in root.iter(tag):
            if file := element.get("file"):
                element.set("file", _copied(pathlib.Path(file), folder / name))
    ElementTree.indent(root)
    text = ElementTree.tostring(root, encoding="unicode")
    (folder / MODEL_FILES[0]).write_text(text + "\n", encoding="utf-8", newline="\n")
    save_manifest(manifest, folder / MANIFEST_FILE)
    if rooms is not None:
        shutil.copyfile(rooms, folder / ROOMS_FILE)


def write_start(folder: pathlib.Path, model: mujoco.MjModel, qpos: Sequence[float] | np.ndarray) -> None:
    """Makes positions the start of a written scene: those of its bodies that are free, and its first keyframe.

    Args:
      model: compiled from the file. qpos: [nq].
    """
    file = folder / MODEL_FILES[0]
    root = ElementTree.parse(file).getroot()
    given = np.round(np.asarray(qpos, float), DIGITS) + 0.0
    bodies = {body.get("name"): body for body in root.iter("body")}
    for joint in np.flatnonzero(model.jnt_type == mujoco.mjtJoint.mjJNT_FREE):
        at = int(model.jnt_qposadr[joint])
        body = bodies[model.body(int(model.jnt_bodyid[joint])).name]
        body.set("pos", _numbers(given[at : at + 3]))
        body.set("quat", _numbers(given[at + 3 : at + 7]))
    keys = root.find("keyframe")
    if keys is None:
        keys = ElementTree.SubElement(root, "keyframe")
    key = keys.find("key")
    if key is None:
        key = ElementTree.SubElement(keys, "key", name="initial")
    key.set("qpos", _numbers(given))
    ElementTree.indent(root)
    file.write_text(ElementTree.tostring(root, encoding="unicode") + "\n", encoding="utf-8", newline="\n")


def _drop_unused(root: ElementTree.Element) -> None:
    """Removes meshes, materials and textures that nothing names."""
    for tag, attributes in (("mesh", ("mesh",)), ("material", ("material",)), ("texture", ("texture",))):
        used = {e.get(a) for e in root.iter() if e.tag != tag for a in attributes}
        for section in root.findall("asset"):
            for element in section.findall(tag):
                name = element.get("name") or pathlib.PurePath(element.get("file", "")).stem
                if name not in used and element.get("type") != "skybox":
                    section.remove(element)


def _copied(file: pathlib.Path, folder: pathlib.Path) -> str:
    """Copies a file into a folder; its name there. Files of one name and other content get a longer name."""
    folder.mkdir(exist_ok=True)
    try:
        content = file.read_bytes()
    except OSError as e:
        raise InputError(file, f"cannot be read: {e.strerror or e}", fix="convert the object again") from e
    target = folder / file.name
    if target.exists() and target.read_bytes() != content:
        mark = hashlib.sha256(content).hexdigest()[:12]
        target = folder / f"{file.stem}-{mark}{file.suffix}"
    target.write_bytes(content)
    return target.name


def _numbers(values: np.ndarray) -> str:
    return " ".join(f"{v:.9g}" for v in values)
