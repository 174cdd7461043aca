"""Object URDF -> `ObjectModel`."""

from __future__ import annotations

import os
import pathlib
from collections.abc import Sequence

import numpy as np

from ig2mj.callbacks import ProgressCallback, no_progress
from ig2mj.errors import InputError

from ..base import inputs
from ..base.description import ROBOT_CATEGORY, Inertial, Joint, Link, Mimic, ObjectModel
from ..base.file_access import FileGuard
from ..base.transforms import read_origin
from ..base.xml_reader import Element, is_huge, number, numbers, read_xml, where
from .mesh_files import FORMATS
from .urdf_geometry import GeometryReader
from .urdf_leftovers import read_leftovers, warn_of_degrees, warn_of_macros, warn_of_repetitions
from .urdf_materials import UrdfMaterials
from .urdf_tree import check_counts, check_name, find_tree

JOINT_TYPES = ("fixed", "revolute", "prismatic", "continuous", "floating")
MOVING = ("revolute", "prismatic", "continuous")


def read_urdf(
    file: str | os.PathLike,
    category: str,
    model: str,
    root: pathlib.Path | None = None,
    *,
    mesh_folder: pathlib.Path | None = None,
    allow_outside: bool = False,
    mesh_root: pathlib.Path | None = None,
    package_path: Sequence[pathlib.Path] = (),
    progress: ProgressCallback = no_progress,
) -> ObjectModel:
    """Reads an object's URDF and its meshes (unscaled, link frames); metadata is left empty.

    Args:
      file: the URDF. If `<stem>_simplified.urdf` stands next to it, that one is read (iGibson's dataset format).
      category, model: what the object is called.
      root: the dataset root (dataset mode): every mesh must lie below it, absolute paths are refused.
        None (plain URDF): meshes may lie below the URDF's folder or its package's root.
      mesh_folder: what relative mesh paths start from; default the URDF's folder.
      allow_outside: plain URDF only: read meshes from anywhere.
      mesh_root, package_path: plain URDF only: see `FileGuard`.

    Raises:
      InputError: naming the file and the element.
    """
    path = pathlib.Path(file)
    simplified = path.with_name(f"{path.stem}_simplified{path.suffix}")
    if inputs.is_file(simplified):
        path = simplified
    if path.suffix.lower() in FORMATS:
        fix = f'write a URDF that names it: <mesh filename="{path.name}"/> in <visual> and <collision>'
        raise InputError(file, "is a mesh, not a URDF", fix=fix)
    warnings: list[str] = []
    robot = read_xml(path, "robot", warnings)
    read_leftovers(robot, warnings)
    warn_of_degrees(robot, warnings)
    warn_of_macros(robot, warnings)
    warn_of_repetitions(robot, warnings)
    guard = FileGuard(path, root, mesh_folder, allow_outside, mesh_root=mesh_root, package_path=package_path)
    reader = GeometryReader(guard, UrdfMaterials(robot, guard, warnings), warnings)
    check_counts(robot, path)
    links: dict[str, Link] = {}
    elements = robot.findall("link")
    for done, element in enumerate(elements):
        progress(done, len(elements), f"reading link {element.get('name', '')}")
        link = _read_link(element, reader)
        if link.name in links:
            raise InputError(path, "this name occurs twice", element=where(element))
        links[link.name] = link
    joints: dict[str, Joint] = {}
    for element in robot.iterfind("joint"):
        joint = _read_joint(element, path, warnings, category == ROBOT_CATEGORY)
        if joint.name in joints:
            raise InputError(path, "this name occurs twice", element=where(element))
        joints[joint.name] = joint
    base, links, joints = find_tree(links, joints, path, warnings)
    _drop_broken_mimics(joints, warnings)
    title = (robot.get("name") or "").strip()
    return ObjectModel(category, model, path, links, joints, base, warnings=warnings, title=title)


def _read_link(element: Element, reader: GeometryReader) -> Link:
    file = reader.guard.file
    link = Link(check_name(element, file, reader.warnings))
    link.collisions = [s for c in element.iterfind("collision") if (s := reader.collision(c)) is not None]
    link.visuals = [shape for v in element.iterfind("visual") for shape in reader.visual(v)]
    inertial = element.find("inertial")
    if inertial is not None:
        link.inertial = _read_inertial(inertial, file, reader.warnings)
    return link


def _read_inertial(element: Element, file: pathlib.Path, warnings: list[str]) -> Inertial | None:
    """An <inertial>; a missing <inertia> is zero (to be computed), a missing <mass> means there is none."""
    mass_element = element.find("mass")
    if mass_element is None:
        if len(element):
            warnings.append(f"{where(element)}: has no <mass>: it is left out")
        return None
    mass = number(mass_element, "value", file)
    if mass < 0:
        raise InputError(file, f"mass {mass:g} is negative", element=where(mass_element))
    inertia = np.zeros((3, 3))
    tensor = element.find("inertia")
    if tensor is not None:
        for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)):
            inertia[i, j] = inertia[j, i] = number(tensor, f"i{'xyz'[i]}{'xyz'[j]}", file, 0.0)
    return Inertial(mass, inertia, read_origin(element, file))


def _read_joint(element: Element, file: pathlib.Path, warnings: list[str], robot: bool) -> Joint:
    name = check_name(element, file, warnings)
    kind = (element.get("type") or "").strip()
    if kind == "planar" and robot:  # by which planners move a base
        warnings.append(f"joint '{name}' is planar: it is read as floating")
        kind = "floating"
    if kind not in JOINT_TYPES:
        raise InputError(
            file, f"joint type '{kind}' is not supported", element=where(element), fix=f"use {', '.join(JOINT_TYPES)}"
        )
    ends = []
    for tag in ("parent", "child"):
        end = element.find(tag)
        if end is None or end.get("link") is None:
            raise InputError(file, f"has no {tag} link", element=where(element))
        ends.append(end.get("link").strip())
    joint = Joint(name, kind, ends[0], ends[1], read_origin(element, file), np.array([1.0, 0.0, 0.0]))
    axis = element.find("axis")
    if axis is not None and kind in MOVING:
        vector = numbers(axis, "xyz", 3, file, (1.0, 0.0, 0.0))
        length = float(np.linalg.norm(vector))
        if length < 1e-9:
            raise InputError(file, "the axis has no direction", element=where(axis))
        joint.axis = vector / length
    if kind in ("revolute", "prismatic"):
        _read_limits(joint, element, file, warnings)
    limit = element.find("limit")
    if limit is not None and kind in MOVING:
        joint.effort, joint.velocity = (_positive_or_none(limit, a, file) for a in ("effort", "velocity"))
    _read_dynamics(joint, element, file, warnings)
    mimic = element.find("mimic")
    if mimic is not None and kind in MOVING:
        target = mimic.get("joint")
        if target is None:
            raise InputError(file, "attribute 'joint' is missing", element=where(mimic))
        joint.mimic = Mimic(target.strip(), number(mimic, "multiplier", file, 1.0), number(mimic, "offset", file, 0.0))
    return joint


def _read_limits(joint: Joint, element: Element, file: pathlib.Path, warnings: list[str]) -> None:
    """Limits as Bullet takes them: none at all where lower > upper."""
    limit = element.find("limit")
    if limit is None or (limit.get("lower") is None and limit.get("upper") is None):
        warnings.append(f"{where(element)}: a {joint.type} joint without limits can move without end")
    else:
        lower, upper = _limit(limit, "lower", file), _limit(limit, "upper", file)
        if lower is None or upper is None:
            if lower is not upper:
                warnings.append(f"{where(limit)}: only one limit is finite; the joint can move without end")
        elif lower > upper:
            warnings.append(f"{where(limit)}: lower {lower:g} > upper {upper:g}; the joint can move without end")
        else:
            joint.lower, joint.upper = lower, upper


def _limit(element: Element, attribute: str, file: pathlib.Path) -> float | None:
    """A limit of a joint; None for "no limit", which real files write as inf or as a number beyond all use."""
    word = (element.get(attribute) or "").strip()
    if word.lower().lstrip("+-") in ("inf", "infinity") or is_huge(word):
        return None
    return number(element, attribute, file, 0.0)


def _positive_or_none(element: Element, attribute: str, file: pathlib.Path) -> float | None:
    """Real files write effort="inf", "1e+30" or "0" for "no limit"."""
    word = (element.get(attribute) or "").strip()
    if word.lower().lstrip("+") in ("inf", "infinity") or is_huge(word):
        return None
    value = number(element, attribute, file, 0.0)
    return value if value > 0 else None


def _read_dynamics(joint: Joint, element: Element, file: pathlib.Path, warnings: list[str]) -> None:
    dynamics = element.find("dynamics")
    if dynamics is None:
        return
    joint.damping, joint.friction = number(dynamics, "damping", file, 0.0), number(dynamics, "friction", file, 0.0)
    if joint.damping < 0 or joint.friction < 0:
        warnings.append(f"{where(dynamics)}: negative damping or friction was set to 0")
        joint.damping, joint.friction = max(joint.damping, 0.0), max(joint.friction, 0.0)


def _drop_broken_mimics(joints: dict[str, Joint], warnings: list[str]) -> None:
    """Bullet ignores mimic, so a broken one is a warning: it names no moving joint, or leads back to itself."""
    for joint in joints.values():
        seen = {joint.name}
        target = joint.mimic
        while target is not None:
            goal = joints.get(target.joint)
            if goal is None or goal.type not in MOVING or goal.name in seen:
                warnings.append(f"joint '{joint.name}': mimics '{target.joint}', which is no movable joint; ignored")
                joint.mimic = None
                break
            seen.add(goal.name)
            target = goal.mimic
