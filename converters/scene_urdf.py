"""Scene URDF (the pseudo-URDF of iGibson's scenes) -> `SceneDescription` (dataset_format.md 2.1)."""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Collection

from .description import SceneDescription


@dataclasses.dataclass(frozen=True)
class SceneOptions:
    """What of a scene is read.

    Attributes:
      seed: for models named "random".
      fixed_furniture: fix the 12 categories that BEHAVIOR's `_fixed_furniture` variants fix.
      only_rooms: room instances or room types; an object stays if one of its rooms is named. Building parts stay.
      only_categories: an object stays if its category is named. Building parts stay.
      without_categories: dropped, building parts too.
      random_index: read `<scene>_random_<index>.urdf` instead of `<scene>_best.urdf`.
    """

    seed: int = 0
    fixed_furniture: bool = False
    only_rooms: Collection[str] | None = None
    only_categories: Collection[str] | None = None
    without_categories: Collection[str] = ()
    random_index: int | None = None


def read_scene(file: str | os.PathLike, name: str) -> SceneDescription:
    """Reads a scene URDF: every instance, models still as written (may be "random"); no maps, no filters.

    Raises:
      InputError: naming the file and the element.
    """
    raise NotImplementedError


def parse_object_scope(text: str) -> dict[str, str | None]:
    """BDDL instances an object is bound to -> the room of each, None where it names none.

    "book.n.02_1" gives {"book.n.02_1": None}; on floors "floor.n.01_1:room_floor_kitchen_0" gives
    {"floor.n.01_1": "kitchen_0"}.
    """
    raise NotImplementedError
