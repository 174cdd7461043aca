"""Solid ground below a home: one invisible box just under its lowest floor, so that nothing sinks where floors end.

A floor pushes out what is pressed into it on the nearest side. Next to its edge that is sideways: into the next floor,
which pushes it back, or below a wall; nothing holds it against its weight, and it sinks or falls. The box belongs to
the compiled model only (`scene/invisible_colliders.py`). Nothing that rests on a floor touches it.
`docs/notes/lost.md`.
"""

from __future__ import annotations

import mujoco
import numpy as np

from ig2mj.scene.ceilings import corners_of
from ig2mj.scene.floors import DEPTH, building_parts
from ig2mj.scene.invisible_colliders import add_invisible_colliders
from ig2mj.scene.manifest import BUILDING, Manifest

GROUND = "solid_ground"
"""Name of its body."""

BELOW = 0.03
"""Metres from the surface of the lowest floor down to it: more than what rests, falls or is set down reaches into a
floor."""

BESIDE = 1.0
"""Metres by which it is larger than the rectangle about all floors, which is as deep as outer walls are."""


def add_ground(spec: mujoco.MjSpec, manifest: Manifest) -> None:
    """Puts a static box of `DEPTH` below the floors of a scene that is not compiled yet.

    It is lower where an object of the scene reaches deeper. There is none where no floor is a box or mesh turned by a
    `quat`.
    """
    floors = [part for part in building_parts(spec, manifest, "floors") if len(part.corners)]
    if not floors:
        return
    corners = np.concatenate([part.corners for part in floors])
    low, high = corners.min(0)[:2] - BESIDE, corners.max(0)[:2] + BESIDE
    top = min(part.corners[:, 2].max() for part in floors) - BELOW
    heights = [corners_of(spec, entry)[:, 2] for entry in manifest.objects if entry.category not in BUILDING]
    for lowest, highest in sorted(((z.min(), z.max()) for z in heights), reverse=True):
        if lowest < top < highest:
            top = lowest - BELOW
    add_invisible_colliders(spec, GROUND, [np.array([[*low, top - DEPTH], [*high, top]])], floors[0].geom)
