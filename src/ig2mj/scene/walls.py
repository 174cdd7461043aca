"""Collision geometry of outer walls: a metre deep, to the outside, with softer contacts than inner walls.

An object that a hand presses into a thin wall, or that hits it at an angle, is pushed out on the nearest side, and
leaves the house. A deep wall pushes it back inside. Contacts of a deep solid must be softer than others', or they throw
thin objects (`scene/floors.py`). Windows are closed on the outside by invisible panes. `docs/notes/lost.md`.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator

import mujoco
import numpy as np
from jaxtyping import Float

from ig2mj.scene.ceilings import corners_of
from ig2mj.scene.floors import DEPTH, LEVEL, TIME_CONSTANT, BuildingPart, building_parts, rotation_of
from ig2mj.scene.invisible_colliders import add_invisible_colliders
from ig2mj.scene.manifest import Manifest, ObjectEntry

THIN = 0.5
"""Metres: walls are no thicker. A box that is thicker both ways is a pillar."""

PANES = "solid_panes"
"""Name of their body."""

Box = Float[np.ndarray, "2 3"]


def deepen_walls(spec: mujoco.MjSpec, manifest: Manifest) -> None:
    """Gives outer walls `DEPTH` and `TIME_CONSTANT`, in a scene that is not compiled yet; for boxes along x and y.

    A wall is made deeper on a side where within `DEPTH` no floor begins and nothing loose stands. Its other side stays
    where it is, and so does what only draws it. Between two walls of which one stands over the other and that were made
    deeper to the same side, at a window, a pane closes that depth, unless a sash opens to the outside.
    """
    floors = [part.corners for part in building_parts(spec, manifest, "floors") if len(part.corners)]
    if not floors:
        return
    loose = [corners_of(spec, entry) for entry in manifest.objects if not entry.fixed]
    kept_free = [np.array([corners.min(0), corners.max(0)]) for corners in (*floors, *loose)]
    added: dict[tuple[int, int], list[Box]] = {}
    pattern = None
    for part in list(building_parts(spec, manifest, "walls")):
        box = _deepened(part, kept_free, added)
        if box is not None:
            pattern = part.geom
            _resize(part, box)
    panes = [
        pane
        for (axis, side), boxes in added.items()
        for pane in _between(boxes)
        if not any(_opens_into(spec, entry, pane, axis, side) for entry in manifest.objects if entry.joints)
    ]
    if pattern is not None and panes:
        add_invisible_colliders(spec, PANES, panes, pattern)


def _deepened(part: BuildingPart, kept_free: list[Box], added: dict[tuple[int, int], list[Box]]) -> Box | None:
    """The wall as it is to be; None: as it is. What it is deeper by is added by axis and side."""
    aligned = np.allclose(np.abs(part.turn).max(0), 1.0, atol=LEVEL)
    if part.geom.type != mujoco.mjtGeom.mjGEOM_BOX or not len(part.corners) or not aligned:
        return None
    extent, box = part.corners[1] - part.corners[0], part.corners.copy()
    for axis in (0, 1):
        if extent[axis] > THIN or extent[1 - axis] < extent[axis]:
            continue
        for side in (0, 1):
            beyond = part.corners.copy()
            beyond[1 - side, axis] = box[side, axis]
            beyond[side, axis] += DEPTH if side else -DEPTH
            if not any(_overlap(beyond, other) for other in kept_free):
                added.setdefault((axis, side), []).append(beyond)
                box[side, axis] = beyond[side, axis]
    return box if (box != part.corners).any() else None


def _overlap(box: Box, other: Box) -> bool:
    """Whether two boxes do, seen from above."""
    return bool((np.minimum(box[1], other[1]) - np.maximum(box[0], other[0]) > LEVEL)[:2].all())


def _resize(part: BuildingPart, box: Box) -> None:
    geom = part.geom
    geom.pos = geom.pos + rotation_of(part.body.quat).T @ (box.mean(0) - part.corners.mean(0))
    geom.size = np.abs(part.turn.T).round() @ (box[1] - box[0]) / 2
    geom.solref = [max(geom.solref[0], TIME_CONSTANT), geom.solref[1]]


def _between(boxes: list[Box]) -> Iterator[Box]:
    """What is free between boxes that stand over each other."""
    columns: dict[bytes, list[Box]] = {}
    for box in boxes:
        columns.setdefault(box[:, :2].round(6).tobytes(), []).append(box)
    for column in columns.values():
        column.sort(key=lambda box: box[0, 2])
        for low, high in itertools.pairwise(column):
            if high[0, 2] - low[1, 2] > LEVEL:
                yield np.array([[*low[0, :2], low[1, 2]], [*low[1, :2], high[0, 2]]])


def _opens_into(spec: mujoco.MjSpec, entry: ObjectEntry, pane: Box, axis: int, side: int) -> bool:
    """Whether a part of the object is in front of the pane, and reaches into its depth where it stands open."""
    sign, face = (1 if side else -1), pane[1 - side, axis]
    across = [k for k in range(3) if k != axis]
    for body in (spec.body(name) for name in entry.bodies):
        frame, at = _frame_of(body)
        centres = np.array([geom.pos for geom in body.geoms]).reshape(-1, 3)
        closed = centres @ frame.T + at
        inside = ((closed > pane[0] - LEVEL) & (closed < pane[1] + LEVEL))[:, across].all(1)
        if not (inside & (np.abs(closed[:, axis] - face) < THIN)).any():
            continue
        for joint in body.joints:
            for value in joint.range:
                if joint.type == mujoco.mjtJoint.mjJNT_HINGE:
                    quat = np.zeros(4)
                    mujoco.mju_axisAngle2Quat(quat, joint.axis, np.radians(value) if spec.compiler.degree else value)
                    moved = (centres - joint.pos) @ rotation_of(quat).T + joint.pos
                else:
                    moved = centres + value * joint.axis
                if (sign * ((moved @ frame.T + at)[:, axis] - face) > 0).any():
                    return True
    return False


def _frame_of(body: mujoco.MjsBody) -> tuple[Float[np.ndarray, "3 3"], Float[np.ndarray, "3"]]:
    """Rotation and place of a body's frame in the world."""
    frame, at = rotation_of(body.quat), np.array(body.pos)
    while (body := body.parent).name != "world":
        turn = rotation_of(body.quat)
        frame, at = turn @ frame, body.pos + turn @ at
    return frame, at
