"""What is no URDF and yet stands in URDFs: vectors of more than three numbers, xacro's defaults, degrees, repetitions.

Bullet reads the first three numbers of a vector and passes over the rest. `$(optenv NAME default)` stays where a file
of xacro or roslaunch was not expanded; the default is read, never the environment.
"""

from __future__ import annotations

import math
import re

from lxml import etree  # pyright: ignore[reportAttributeAccessIssue]  it has no stubs

from ..base.xml_reader import Element, local_name, parse_number, shortened, where

VECTORS = (("origin", "xyz"), ("origin", "rpy"), ("axis", "xyz"), ("mesh", "scale"), ("box", "size"))
"""Elements and attributes of three numbers."""

_OPTIONAL = re.compile(r"\$\(\s*optenv\s+[^\s()]+\s*([^()]*)\)")


def read_leftovers(robot: Element, warnings: list[str]) -> None:
    """Replaces them in the element of a URDF by what they mean, each with a warning."""
    tags = {tag for tag, _ in VECTORS}
    for element in robot.iter(*tags):
        for attribute, text in element.attrib.items():
            plain = _OPTIONAL.sub(lambda found: found[1].strip(), text)
            if plain != text:
                warnings.append(f"{where(element)}: {attribute}: {shortened(text, 60)} is read as its default")
            words = plain.split()
            if (element.tag, attribute) in VECTORS and len(words) > 3:
                said = f"{attribute}='{shortened(plain, 40)}' has {len(words)} numbers"
                if not any("$" in word for word in words):
                    warnings.append(f"{where(element)}: {said}: the first 3 are read, as Bullet does")
                    plain = " ".join(words[:3])
            if plain != text:
                element.set(attribute, plain)


def warn_of_macros(robot: Element, warnings: list[str]) -> None:
    """What xacro would have replaced by links and joints is no part of a URDF."""
    elements = (e for e in robot.iter(etree.Element) if "xacro" in (e.prefix, e.tag.partition(":")[0]))
    names = {local_name(element) for element in elements}
    if names:
        listed = ", ".join(f"<xacro:{shortened(name.rpartition(':')[2], 40)}>" for name in sorted(names)[:10])
        warnings.append(f"elements of xacro are left out: {listed} (expand the file with xacro)")


UNLIMITED = 1000.0
"""rad: limits from here on are written for "no limit"."""

MOST_TURN, MOST_LIMIT = 2.0 * math.pi + 0.01, 4.0 * math.pi + 0.01
"""rad: a roll, pitch or yaw beyond the first, or a revolute joint's limit beyond the second, may be in degrees."""


def warn_of_degrees(robot: Element, warnings: list[str]) -> None:
    """Angles of a URDF are in radians; those that are hardly meant so are read as they stand, with a warning."""
    angles = [(e, "rpy", MOST_TURN) for e in robot.iter("origin")]
    limits = (e for joint in robot.iterfind("joint[@type='revolute']") for e in joint.iterfind("limit"))
    angles += [(e, side, MOST_LIMIT) for e in limits for side in ("lower", "upper")]
    for element, attribute, most in angles:
        values = [parse_number(word.removesuffix(",")) for word in (element.get(attribute) or "").split()]
        if any(most < abs(v) < UNLIMITED for v in values if v is not None):
            text = f"{attribute}='{shortened(element.get(attribute), 40)}' is read as radians; is it in degrees?"
            warnings.append(f"{where(element)}: {text}")


ONCE = {
    "link": ("inertial",),
    "inertial": ("origin", "mass", "inertia"),
    "joint": ("origin", "parent", "child", "axis", "limit", "dynamics", "mimic"),
    "visual": ("origin", "geometry", "material"),
    "collision": ("origin", "geometry"),
}
"""Elements, and those in them of which there may be one. (A second shape in a geometry is an error.)"""


def warn_of_repetitions(robot: Element, warnings: list[str]) -> None:
    """Of elements that may stand once the first is read, as urdfdom and Bullet do; the others are lost."""
    for element in robot.iter(*ONCE):
        for tag in ONCE[element.tag]:
            if (count := len(element.findall(tag))) > 1:
                warnings.append(f"{where(element)}: has {count} {tag} elements: the first is read")
