"""Collision geometry of floors: one metre deep, however thin the visual is, with softer contacts than other objects.

Contacts push a body out of a solid on the nearest side. What is dropped from shoulder height, at an angle, reaches
several centimetres into the floor before it is pushed; where the floor is thin, part of it is then nearer to the
underside and is pushed out there. In a deep floor it stays, but with contacts as stiff as others' (0.02 s, 2.4 physics
steps) what is long and light is turned by a radian in a step, gains energy with each, and is thrown out.
`docs/notes/lost.md`.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator

import mujoco
import numpy as np
from jaxtyping import Float

from ig2mj.scene.convex_pieces import mesh_corners
from ig2mj.scene.manifest import Manifest

DEPTH = 1.0
"""Metres from a floor's surface to its underside, at least, where no room is below it."""

TIME_CONSTANT = 0.04
"""Seconds (MuJoCo's `solref`), at least. Contacts take the mean of both geoms': 0.03, or 3.6 physics steps."""

LEVEL = 1e-6
"""How far a box may be out of level, as a share of its sides, and how little floors may overlap to be apart (m)."""

UNEVEN = 1e-4
"""Metres by which the corners of a mesh's surface may differ in height."""


def deepen_floors(spec: mujoco.MjSpec, manifest: Manifest) -> None:
    """Gives the collision boxes and meshes of floors `DEPTH` and `TIME_CONSTANT`, in a scene that is not compiled yet.

    Surfaces stay where they are, and so does what only draws a floor. One that is not level, that is turned otherwise
    than by a `quat` (as no converter writes it), or that has another floor somewhere below it, keeps its depth: in the
    last case there is a room between them.
    """
    level = []
    for part in building_parts(spec, manifest, "floors"):
        part.geom.solref = [max(part.geom.solref[0], TIME_CONSTANT), part.geom.solref[1]]
        if part.is_level():
            level.append(part)
    boxes = np.array([(part.corners.min(0), part.corners.max(0)) for part in level]).reshape(-1, 2, 3)
    for number, (part, box) in enumerate(zip(level, boxes, strict=True)):
        missing = DEPTH - (box[1] - box[0])[2]
        if missing > 0 and not _above_another(box, boxes):
            if part.geom.type == mujoco.mjtGeom.mjGEOM_BOX:
                part.geom.size = part.geom.size + missing / 2 * np.round(np.abs(part.turn[2]))
                part.geom.pos = part.geom.pos + rotation_of(part.body.quat).T @ np.array([0.0, 0.0, -missing / 2])
            else:
                _extend_mesh(spec, part, box, f"deep_floor_{number}")


@dataclasses.dataclass
class BuildingPart:
    """A collision geom of a floor or wall.

    Attributes:
      body: it stands in the world. turn: of the geom's frame, to the world.
      corners: world frame, the outermost two of a box; none where it is no box or mesh, or not turned by a `quat`.
    """

    body: mujoco.MjsBody
    geom: mujoco.MjsGeom
    turn: Float[np.ndarray, "3 3"]
    corners: Float[np.ndarray, "n 3"]

    def is_level(self) -> bool:
        """Whether its surface is, and covers all of it."""
        if not len(self.corners):
            return False
        if self.geom.type == mujoco.mjtGeom.mjGEOM_BOX:
            return bool((np.abs(self.turn[2]) > 1.0 - LEVEL).any())
        top = self.corners[self.corners[:, 2] > self.corners[:, 2].max() - UNEVEN]
        return _area(top) > (1.0 - UNEVEN) * _area(self.corners)


def building_parts(spec: mujoco.MjSpec, manifest: Manifest, category: str) -> Iterator[BuildingPart]:
    """All collision geoms of a category of the building, in a scene that is not compiled yet."""
    found = [
        (body, number, geom)
        for entry in manifest.objects
        if entry.category == category
        for body in (spec.body(name) for name in entry.bodies)
        for number, geom in enumerate(body.geoms)
        if geom.contype or geom.conaffinity
    ]
    compiled = None
    for body, number, geom in found:
        turn, corners = rotation_of(body.quat) @ rotation_of(geom.quat), np.zeros((0, 3))
        if {body.alt.type, geom.alt.type} == {mujoco.mjtOrientation.mjORIENTATION_QUAT}:
            if geom.type == mujoco.mjtGeom.mjGEOM_BOX:
                half = np.abs(turn) @ geom.size
                corners = body.pos + rotation_of(body.quat) @ geom.pos + np.array([-half, half])
            elif geom.type == mujoco.mjtGeom.mjGEOM_MESH:
                copy, model = compiled = compiled or _compiled(spec)
                g = copy.body(body.name).geoms[number].id
                turned = rotation_of(body.quat) @ rotation_of(model.geom_quat[g])
                middle = body.pos + rotation_of(body.quat) @ model.geom_pos[g]
                corners = mesh_corners(model, int(model.geom_dataid[g])) @ turned.T + middle
        yield BuildingPart(body, geom, turn, corners)


def _compiled(spec: mujoco.MjSpec) -> tuple[mujoco.MjSpec, mujoco.MjModel]:
    """A compiled copy of the scene: needed for the positions of mesh corners."""
    copy = spec.copy()
    return copy, copy.compile()


def _extend_mesh(spec: mujoco.MjSpec, part: BuildingPart, box: Float[np.ndarray, "2 3"], name: str) -> None:
    """Gives the geom a mesh of its own, which reaches down to `DEPTH` below its surface."""
    below = part.corners * (1, 1, 0) + (0, 0, box[1, 2] - DEPTH)
    local = (np.concatenate([part.corners, below]) - part.body.pos) @ rotation_of(part.body.quat)
    spec.add_mesh(name=name, uservert=local.ravel())
    part.geom.meshname, part.geom.pos, part.geom.quat = name, (0, 0, 0), (1, 0, 0, 0)


def _area(points: Float[np.ndarray, "n 3"]) -> float:
    """Of the outline of points, seen from above (m2)."""
    import scipy.spatial  # not needed where all floors are boxes

    if len(points) < 3 or np.linalg.matrix_rank(points[:, :2] - points[0, :2], tol=LEVEL) < 2:
        return 0.0
    return scipy.spatial.ConvexHull(points[:, :2]).volume


def _above_another(box: Float[np.ndarray, "2 3"], boxes: Float[np.ndarray, "n 2 3"]) -> bool:
    """Whether one of the boxes is below the box."""
    beside = np.minimum(box[1], boxes[:, 1])[:, :2] - np.maximum(box[0], boxes[:, 0])[:, :2] <= LEVEL
    return bool((~beside.any(1) & (boxes[:, 1, 2] <= box[0, 2] + LEVEL)).any())


def rotation_of(quat: Float[np.ndarray, "4"]) -> Float[np.ndarray, "3 3"]:
    """The matrix that turns as a quaternion of any length does."""
    matrix = np.zeros(9)
    mujoco.mju_quat2Mat(matrix, np.asarray(quat) / np.linalg.norm(quat))
    return matrix.reshape(3, 3)
