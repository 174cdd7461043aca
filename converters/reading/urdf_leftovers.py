"""What is no URDF and yet stands in URDFs: vectors of more than three numbers, and xacro's defaults.

Bullet reads the first three numbers of a vector and passes over the rest. `$(optenv NAME default)` stays where a file
of xacro or roslaunch was not expanded; the default is read, never the environment.
"""

from __future__ import annotations

import re

from ..base.xml_reader import Element, shortened, where

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
