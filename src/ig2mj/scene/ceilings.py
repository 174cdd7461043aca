"""The solid ceiling of a home: one invisible box on its walls, so that no object leaves the home over them.

Converted ceilings have no collision geometry. This one belongs to the compiled model only
(`scene/invisible_colliders.py`). `docs/notes/lost.md`.
"""

from __future__ import annotations

import itertools

import mujoco
import numpy as np
from jaxtyping import Float

from ig2mj.scene.floors import DEPTH, building_parts, rotation_of
from ig2mj.scene.invisible_colliders import add_invisible_colliders
from ig2mj.scene.manifest import Manifest, ObjectEntry

CEILING = "solid_ceiling"
"""Name of its body."""

LOWER = 0.1
"""Metres by which the top of a wall may be below the highest one's to count as one that bears the ceiling. Rails of
porches and parapets of balconies are lower."""

CLEARANCE = 0.05
"""Metres between the ceiling and the highest thing that can move, where the walls end lower than that."""


def add_ceiling(spec: mujoco.MjSpec, manifest: Manifest) -> None:
    """Puts a static box of `DEPTH` on the walls of a scene that is not compiled yet.

    It covers the rectangle about all walls that are as high as the highest one, and lies on them, or higher where
    something that can move would stand in it. There is none where a ceiling of the scene collides, where no floor has
    its middle in that rectangle, or where walls or floors are no boxes or meshes turned by a `quat`.
    """
    if any(True for _ in building_parts(spec, manifest, "ceilings")):
        return
    walls = [part for part in building_parts(spec, manifest, "walls") if len(part.corners)]
    if not walls:
        return
    top = max(part.corners[:, 2].max() for part in walls)
    bearing = np.concatenate([part.corners for part in walls if part.corners[:, 2].max() > top - LOWER])[:, :2]
    low, high = bearing.min(0), bearing.max(0)
    floors = [part.corners[:, :2] for part in building_parts(spec, manifest, "floors") if len(part.corners)]
    if not any(_meet(low, high, *2 * ((floor.min(0) + floor.max(0)) / 2,)) for floor in floors):
        return
    movable = [entry for entry in manifest.objects if entry.joints or not entry.fixed]
    for corners in (corners_of(spec, entry) for entry in movable):
        if _meet(low, high, corners.min(0)[:2], corners.max(0)[:2]):
            top = max(top, corners[:, 2].max() + CLEARANCE)
    box = np.array([[*low, top], [*high, top + DEPTH]])
    add_invisible_colliders(spec, CEILING, [box], walls[0].geom)


def corners_of(spec: mujoco.MjSpec, entry: ObjectEntry) -> Float[np.ndarray, "8 3"]:
    """Corners of an object's box where the scene has it, world frame."""
    signs = np.array(list(itertools.product((-0.5, 0.5), repeat=3)))
    body = spec.body(entry.bodies[0])
    local = entry.base_link_offset + signs * entry.bounding_box
    return local @ rotation_of(body.quat).T + body.pos


def _meet(low: np.ndarray, high: np.ndarray, other_low: np.ndarray, other_high: np.ndarray) -> bool:
    """Whether two rectangles do."""
    return bool(((other_high > low) & (other_low < high)).all())
