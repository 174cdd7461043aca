"""The tree of an URDF's links: its base, and what makes it no tree."""

from __future__ import annotations

import pathlib

from ig2mj.errors import InputError

from ..base.description import Joint, Link
from ..base.read_limits import check_limit
from ..base.xml_reader import Element, where

MAX_NAME = 200


def check_name(element: Element, file: pathlib.Path, warnings: list[str]) -> str:
    """The element's name. Raises InputError where it has none; odd characters are a warning."""
    name = (element.get("name") or "").strip()
    if not name:
        raise InputError(file, "has no name", element=where(element))
    if len(name) > MAX_NAME or any(ord(c) < 32 or ord(c) == 127 for c in name):
        raise InputError(
            file, f"its name is longer than {MAX_NAME} or holds control characters", element=where(element)
        )
    if any(c in "/\\ " or ord(c) > 126 for c in name):
        warnings.append(f"{where(element)}: blanks, slashes or non-ASCII letters in a name")
    return name


def check_counts(robot: Element, file: pathlib.Path) -> None:
    """Raises InputError for more links, moving joints or shapes than the limits allow, before any of them is read."""
    check_limit("links", len(robot.findall("link")), file, "links")
    moving = sum((joint.get("type") or "").strip() != "fixed" for joint in robot.iterfind("joint"))
    check_limit("joints", moving, file, "moving joints")
    for link in robot.iterfind("link"):
        for tag in ("collision", "visual"):
            check_limit("link_shapes", len(link.findall(tag)), file, f"{tag}s", element=where(link))


def find_tree(
    links: dict[str, Link], joints: dict[str, Joint], file: pathlib.Path, warnings: list[str]
) -> tuple[str, dict[str, Link], dict[str, Joint]]:
    """(base link, links, joints) of the tree that hangs on the base.

    The base is the first link in document order that is not a joint's child (iGibson's dataset format). Links
    that do not hang on it are left out with a warning.

    Raises:
      InputError: no links, a joint between links that do not exist, a link with two parents, a cycle.
    """
    if not links:
        raise InputError(file, "has no link")
    parent_joint: dict[str, Joint] = {}
    children: dict[str, list[Joint]] = {name: [] for name in links}
    for joint in joints.values():
        element = f"joint '{joint.name}'"
        for end, name in (("parent", joint.parent), ("child", joint.child)):
            if name not in links:
                raise InputError(file, f"its {end} link '{name}' does not exist", element=element)
        if joint.child in parent_joint:
            other = parent_joint[joint.child].name
            raise InputError(
                file, f"link '{joint.child}' has another parent already (joint '{other}')", element=element
            )
        parent_joint[joint.child] = joint
        children[joint.parent].append(joint)
    _check_cycles(links, parent_joint, file)
    base = next(name for name in links if name not in parent_joint)
    depth, queue = {base: 0}, [base]
    while queue:
        parent = queue.pop()
        for joint in children[parent]:
            depth[joint.child] = depth[parent] + (joint.type not in ("fixed", "floating"))
            queue.append(joint.child)
    check_limit("link_depth", max(depth.values()), file, "moving joints in a row")
    reached = depth.keys()
    if lost := [name for name in links if name not in reached]:
        warnings.append(f"links without a parent joint are left out: {', '.join(lost[:10])}")
    kept = {name: link for name, link in links.items() if name in reached}
    return base, kept, {name: joint for name, joint in joints.items() if joint.parent in reached}


def _check_cycles(links: dict[str, Link], parent_joint: dict[str, Joint], file: pathlib.Path) -> None:
    """Walks up from every link, over links that no earlier walk has seen."""
    done: set[str] = set()
    for name in links:
        walk: set[str] = set()
        while name in parent_joint and name not in done:
            walk.add(name)
            joint = parent_joint[name]
            if joint.parent in walk:
                raise InputError(file, f"links form a cycle through '{joint.parent}'", element=f"joint '{joint.name}'")
            name = joint.parent
        done |= walk
