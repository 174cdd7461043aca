"""A home of one's own as a scene of a dataset in iGibson's layout, and what is to be added once that is converted."""

from __future__ import annotations

import dataclasses
import math
import pathlib
import random
import re

import numpy as np

from ..dataset.root import write_models
from ..dataset.scene_writer import write_scene
from ..furnish.ground import Ground
from ..furnish.placed import Placed
from ..furnish.room import HomeInProgress
from ..objects.catalogue import build_model, find
from ..objects.folder_model import folder_model, is_folder
from .description import HomeDescription, LooseSpec, category_of, copies
from .own_furniture import folder_of, furnish_own, is_own, resolve
from .own_plan import make_own_plan

SMALL_MODELS = 2
"""So many models of a category are used where the file names none."""


@dataclasses.dataclass(frozen=True)
class OwnPiece:
    """Furniture from a folder.

    Attributes:
      name: in the scene. folder: of its model. pose: x, y, z (m) of its frame, and degrees about the vertical.
      fixed: to the house. rooms: that it stands in.
    """

    name: str
    folder: pathlib.Path
    pose: tuple[float, float, float, float]
    fixed: bool
    rooms: tuple[str, ...]


@dataclasses.dataclass(frozen=True)
class LooseObject:
    """A loose object.

    Attributes:
      name: in the scene; key: in the file. category, model: what it is.
      source: the folder of a converted model, or the URDF of one that must be converted.
      conditions: that hold at the start, with its name for its key.
    """

    name: str
    key: str
    category: str
    model: str
    source: pathlib.Path
    conditions: tuple[str, ...]


@dataclasses.dataclass(frozen=True)
class OwnHome:
    """A home whose dataset has been written.

    Attributes:
      description: the file. made: its plan and furniture. pieces: furniture from folders, which the dataset lacks.
      loose: loose objects, in the order of the file.
    """

    description: HomeDescription
    made: HomeInProgress
    pieces: tuple[OwnPiece, ...]
    loose: tuple[LooseObject, ...]

    @property
    def rooms(self) -> list[str]:
        """Their names in the scene."""
        return [room.name for room in self.made.plan.rooms]


def build_own(home: HomeDescription, root: pathlib.Path) -> OwnHome:
    """Writes `scenes/<name>` and its models into a dataset root. Raises InputError."""
    made = furnish_own(home, make_own_plan(home))
    loose, requested = _loose(home, root)
    things = list(made.things.things.values())
    pieces = tuple(_own_piece(thing) for thing in things if is_own(thing))
    for thing in things:
        if not is_own(thing):
            requested.setdefault(thing.category, set()).add(thing.index % find(thing.category).count)
    write_models(root, requested, home.seed)
    write_scene(root, made.plan, made.things, home.seed, skipped=[piece.name for piece in pieces])
    return OwnHome(home, made, pieces, tuple(loose))


def unreachable(home: OwnHome, boxes: np.ndarray) -> str:
    """The first room or doorway that a robot cannot reach once loose objects lie in the home, or ''.

    Args:
      boxes: [n, 2, 3] around the loose objects, world frame, m.
    """
    ground = Ground(home.made.plan)
    for thing in home.made.things.things.values():
        ground.occupy(thing)
    return ground.cut_off_by(boxes)


def _own_piece(thing: Placed) -> OwnPiece:
    yaw = math.degrees(math.atan2(thing.rotation[1, 0], thing.rotation[0, 0]))
    x, y, z = (round(float(v), 6) for v in thing.position)
    return OwnPiece(thing.name, folder_of(thing), (x, y, z, round(yaw, 6)), thing.fixed, thing.rooms)


def _loose(home: HomeDescription, root: pathlib.Path) -> tuple[list[LooseObject], dict[str, set[int]]]:
    """Loose objects, and the models of the catalogue that they need: category -> numbers."""
    found: list[LooseObject] = []
    requested: dict[str, set[int]] = {}
    rng = random.Random(f"{home.seed}/{home.name}/objects")
    for key, spec in home.objects.items():
        element = f"objects.{key}"
        category, number = resolve(home, category_of(key, spec), f"{element}.model" if spec.model else element)
        if is_folder(category):
            manifest = folder_model(category)
            source, kind, model = pathlib.Path(category), manifest.entry.category, manifest.entry.model
            if manifest.entry.fixed:
                raise home.error(element, "its model is fixed", "convert it without --fixed, or make it furniture")
        else:
            index = rng.randrange(min(find(category).count, SMALL_MODELS)) if number is None else number
            requested.setdefault(category, set()).add(index)
            kind, model = category, build_model(find(category), index, home.seed).model
            source = root / "objects" / category / model / f"{model}.urdf"
        for name in copies(key, spec):
            found.append(LooseObject(name, key, kind, model, source, _conditions(spec, key, name)))
    return found, requested


def _conditions(spec: LooseSpec, key: str, name: str) -> tuple[str, ...]:
    """Its conditions, with the name of this copy for the object's own."""
    texts = [spec.where] if isinstance(spec.where, str) else spec.where
    own = re.compile(rf"(?<![\w-]){re.escape(key)}(?![\w-])")
    return tuple(own.sub(name, text) for text in texts)
