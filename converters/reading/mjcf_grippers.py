"""Arms and grippers that are separate MJCF files, as in MuJoCo Menagerie: a gripper is mounted on an arm.

`Mounting` says which file goes where; `assembled` gives the model of both.
"""

from __future__ import annotations

import dataclasses
import pathlib
import xml.etree.ElementTree as ElementTree
from collections.abc import Sequence

import mujoco

from ig2mj.errors import InputError, UnknownNameError
from ig2mj.scene.mjcf_files import read_mjcf
from ig2mj.scene.mjcf_text import make_absolute

FLANGES = ("attachment_site", "attachment", "flange", "tool0")
"""Names of the sites that a gripper is mounted on, of an arm that has one: Menagerie's first."""

PREFIX = "gripper"
"""Before the names of what belongs to the only gripper; of several, the name of what each is mounted on comes first."""

SETTINGS = ("option", "visual", "statistic", "size", "keyframe")
"""Sections of a gripper's file that are about a whole model: the arm's file says those."""


@dataclasses.dataclass(frozen=True)
class Mounting:
    """A gripper's MJCF, and the site or the body of the arm that it is mounted on; None: the arm's flange, else its
    last body."""

    file: pathlib.Path
    on: str | None = None

    @classmethod
    def of_words(cls, words: str) -> Mounting:
        """`FILE` or `FILE@NAME`."""
        file, at, on = words.rpartition("@")
        if at and not pathlib.Path(words).exists():
            return cls(pathlib.Path(file), on)
        return cls(pathlib.Path(words))


def assembled(arm: pathlib.Path, mountings: Sequence[Mounting], roots: Sequence[pathlib.Path] = ()) -> mujoco.MjModel:
    """The model of an arm with grippers on it. Files outside of each one's own folder, and of `roots`, are not read.

    Raises:
      InputError: a file is missing or broken, or MuJoCo cannot put them together. UnknownNameError: the arm has no such
        site or body.
    """
    spec = _spec(arm, roots)
    for mounting in mountings:
        gripper = _spec(mounting.file, roots, SETTINGS)
        for element in (*_free_joints(gripper), *_endless(gripper)):
            gripper.delete(element)
        place = _place(spec, mounting, arm)
        prefix = f"{PREFIX}_" if len(mountings) == 1 else f"{place.name}_{PREFIX}_"
        try:
            if isinstance(place, mujoco.MjsSite):
                spec.attach(gripper, prefix=prefix, site=place)
            else:
                spec.attach(gripper, prefix=prefix, frame=place.add_frame())
        except ValueError as e:
            raise InputError(mounting.file, f"cannot be mounted on '{place.name}': {e}", element="--gripper") from e
    return spec.compile()


def _spec(file: pathlib.Path, roots: Sequence[pathlib.Path], without: Sequence[str] = ()) -> mujoco.MjSpec:
    """Of a checked file, with absolute paths, and without some of its sections."""
    if not file.is_file():
        raise InputError(file, "is not a file", element="--gripper", fix="name a gripper's MJCF")
    root = read_mjcf(file, roots)
    if root.find(".//include") is not None:
        raise InputError(
            file,
            "includes other files: it cannot be put together with a gripper",
            element="include",
            fix="name the file that it includes",
        )
    for section in [section for section in root if section.tag in without]:
        root.remove(section)
    make_absolute(root, file.parent)
    return mujoco.MjSpec.from_string(ElementTree.tostring(root, encoding="unicode"))


def _free_joints(spec: mujoco.MjSpec) -> list[mujoco.MjsJoint]:
    return [joint for joint in spec.joints if joint.type == mujoco.mjtJoint.mjJNT_FREE]


def _endless(spec: mujoco.MjSpec) -> list[mujoco.MjsGeom]:
    """Floors of a scene round the gripper."""
    return [geom for geom in spec.worldbody.geoms if geom.type == mujoco.mjtGeom.mjGEOM_PLANE]


def _place(spec: mujoco.MjSpec, mounting: Mounting, arm: pathlib.Path) -> mujoco.MjsSite | mujoco.MjsBody:
    sites, bodies = {s.name: s for s in spec.sites if s.name}, {b.name: b for b in spec.bodies[1:] if b.name}
    if mounting.on is not None:
        found = sites.get(mounting.on) or bodies.get(mounting.on)
        if found is None:
            raise UnknownNameError(f"site or body of {arm}", mounting.on, [*sites, *bodies])
        return found
    for name in FLANGES:
        if name in sites:
            return sites[name]
    if not bodies:
        raise InputError(arm, "has no body with a name to mount a gripper on", element="--gripper", fix="name a body")

    def depth(body: mujoco.MjsBody) -> int:
        return 0 if body.name == "world" else 1 + depth(body.parent)

    return max(bodies.values(), key=depth)
