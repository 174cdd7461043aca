"""What `load_scene(objects=...)` and `--object` take for one object: which, and where it starts.

    apple                          of the object library: the first model of a category
    apple/apple_00                 a model of it
    my_objects/mug                 a folder that `ig2mj convert object` wrote
    my_objects/mug@1,2,0.8,90      its frame at x, y, z (m), turned by degrees about the vertical
    mug@on_top:breakfast_table_0   sampled, so that a predicate holds of it and of another object, or a room
    shelf@fixed:1,2,0.8,90         fixed there for good
    mug@loose:1,2,0.8,90           free to move from there

Without `fixed:` or `loose:`, an object of one's own is as it was converted, and one of the library that ships is fixed.
Without a place, an object stands outside the house until it is put somewhere.
"""

from __future__ import annotations

import dataclasses
import math
import os
import re
from typing import Literal

from ig2mj.errors import Ig2mjError
from ig2mj.scene.library import LibraryName, folder_of

Place = tuple[float, float, float, float]
"""x, y, z (m) of an object's frame, and degrees that it is turned about the vertical."""

Pose = tuple[float, float, float, float, float, float, float]
"""x, y, z (m) of an object's frame, and its quaternion, w first."""

FORMS = "x,y,z,yaw in metres and degrees, or PREDICATE:OBJECT such as on_top:breakfast_table_0"

_PREDICATE = re.compile(r"(?P<predicate>[A-Za-z_]\w*):(?P<target>\S+)")


@dataclasses.dataclass(frozen=True)
class ObjectRequest:
    """One object to add.

    Attributes:
      text: as it was given. reference: what `find_model` takes.
      place: where its frame is. kind: "fixed" or "loose" there; None: as the model has it.
      predicate: (name, object or room) that is to hold of it at the start, in place of `place`.
    """

    text: str
    reference: str
    place: Place | Pose | None = None
    kind: Literal["fixed", "loose"] | None = None
    predicate: tuple[str, str] | None = None


def read_request(request: str | os.PathLike) -> ObjectRequest:
    """One value of `objects`. Raises Ig2mjError: it is none."""
    if not isinstance(request, str | os.PathLike) or not os.fspath(request):
        raise Ig2mjError(f"objects: {request!r} is neither a folder nor a name of the object library, such as 'plate'")
    text, of_library = os.fspath(request), isinstance(request, LibraryName)
    reference, mark, where = text.rpartition("@")
    if not mark or (not of_library and folder_of(text) is not None):
        return ObjectRequest(text, text)
    if of_library:
        reference = LibraryName(reference)
    kind, colon, numbers = where.partition(":")
    if colon and kind in ("fixed", "loose"):
        return ObjectRequest(text, reference, _place(text, numbers, 7 if kind == "loose" else 4), kind)
    if match := _PREDICATE.fullmatch(where):
        return ObjectRequest(text, reference, predicate=(match["predicate"], match["target"]))
    return ObjectRequest(text, reference, _place(text, where, 4))


def frame_of(place: Place | Pose) -> Pose:
    """The pose that a place means."""
    if len(place) == 7:
        return place
    half = math.radians(place[3]) / 2
    return (*place[:3], math.cos(half), 0.0, 0.0, math.sin(half))


def _place(text: str, numbers: str, most: int) -> Place | Pose:
    try:
        values = [float(f"{float(v):.9g}") for v in numbers.split(",")]  # as texts of additions have them
    except ValueError:
        values = []
    if len(values) not in (4, most) or not all(map(math.isfinite, values)):
        raise Ig2mjError(f"'{text}': the place of an object is {FORMS}")
    if len(values) == 4:
        x, y, z, yaw = values
        return (x, y, z, yaw)
    x, y, z, qw, qx, qy, qz = values
    if abs(math.hypot(qw, qx, qy, qz) - 1) > 1e-3:
        raise Ig2mjError(f"'{text}': the last four numbers are no unit quaternion")
    return (x, y, z, qw, qx, qy, qz)
