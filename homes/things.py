"""An object of a home: a model of the catalogue, put somewhere. Its hulls and boxes in the world."""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Sequence

import numpy as np

from .catalogue import build_model, find
from .model import HouseholdObject, hull_mesh
from .poses import stable_orientations

Hull = tuple[np.ndarray, np.ndarray]
"""Points [n, 3], outward face normals [m, 3] without repeats."""


@dataclasses.dataclass(frozen=True, eq=False)
class Shape:
    """What placing needs to know of one model, in its base frame with all joints at 0.

    Attributes:
      hulls: collision hulls, [n, 3] each; links: the link number of each.
      normals: outward face normals of each hull, [m, 3], without repeats.
      low, high: corners of the box around all hulls.
      swept: hulls around the moving parts between each two steps of each joint's range, with their normals.
    """

    model: HouseholdObject
    hulls: tuple[np.ndarray, ...]
    links: tuple[int, ...]
    normals: tuple[np.ndarray, ...]
    low: np.ndarray
    high: np.ndarray
    swept: tuple[Hull, ...]

    @property
    def size(self) -> np.ndarray:
        return self.high - self.low


SWEEP_AT = (0.02, 0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0)
"""Shares of a joint's range at which what it moves is looked at; dense where a door's far corner swings widest."""


@functools.cache
def shape(category: str, index: int, seed: int = 0) -> Shape:
    """The model number `index` of a category of the catalogue. Raises UnknownNameError."""
    entry = find(category)
    model = build_model(entry, index % entry.count, seed)
    hulls = [points + link.origin for link in model.links for points in link.hulls]
    links = [k for k, link in enumerate(model.links) for _ in link.hulls]
    for area in model.areas.values():
        if area.size is not None:
            half = np.array(area.size) / 2
            signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
            hulls.append(signs * half @ _rpy(area.rpy).T + area.xyz)
            links.append(0)
    normals = tuple(_normals(h) for h in hulls)
    low, high = model.bounds()
    return Shape(model, tuple(hulls), tuple(links), normals, low, high, _swept(model))


def lying(category: str, index: int, which: int, seed: int = 0) -> np.ndarray:
    """Rotation [3, 3] of the model's stable orientation number `which` (0 is the most probable)."""
    found = stable_orientations(shape(category, index, seed).model)
    x, y, z, w = found[which % len(found)].quat
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


@dataclasses.dataclass(eq=False)
class Thing:
    """An object at its place.

    Attributes:
      name: in the scene. category, index: which model. scale: one number for all axes.
      position: of the base frame, m. rotation: [3, 3].
      fixed: to the house. rooms: instances.
      host: the thing it stands on or in, or None.
    """

    name: str
    category: str
    index: int
    position: np.ndarray
    rotation: np.ndarray
    fixed: bool
    rooms: tuple[str, ...] = ()
    scale: float = 1.0
    host: str | None = None
    seed: int = 0

    @property
    def shape(self) -> Shape:
        return shape(self.category, self.index, self.seed)

    @property
    def size(self) -> np.ndarray:
        """Of its box in its own axes."""
        return self.shape.size * self.scale

    @property
    def centre(self) -> np.ndarray:
        """World place of its box's centre: what a scene file gives."""
        return self.position + self.rotation @ ((self.shape.low + self.shape.high) / 2 * self.scale)

    @property
    def front(self) -> np.ndarray:
        """World direction x, y that its front looks to."""
        return self.rotation[:2, 0]

    def world(self, local: np.ndarray) -> np.ndarray:
        """Points [..., 3] of its own frame (at scale 1) in the world."""
        return np.asarray(local) * self.scale @ self.rotation.T + self.position

    def hulls(self) -> list[np.ndarray]:
        return [self.world(points) for points in self.shape.hulls]

    def boxes(self) -> np.ndarray:
        """[n, 2, 3] world boxes of its hulls."""
        return np.array([[p.min(0), p.max(0)] for p in self.hulls()])

    def box(self) -> np.ndarray:
        """[2, 3] world box of all of it."""
        boxes = self.boxes()
        return np.array([boxes[:, 0].min(0), boxes[:, 1].max(0)])

    def parts(self) -> list[Hull]:
        """Its hulls in the world, with their normals."""
        return [(points, n @ self.rotation.T) for points, n in zip(self.hulls(), self.shape.normals, strict=True)]

    def swept(self) -> list[Hull]:
        """Hulls in the world that its moving parts fill on their ways."""
        return [(self.world(points), normals @ self.rotation.T) for points, normals in self.shape.swept]


def boxes_of(hulls: Sequence[Hull]) -> np.ndarray:
    """[n, 2, 3] boxes around hulls."""
    return np.array([[points.min(0), points.max(0)] for points, _ in hulls]).reshape(-1, 2, 3)


def _normals(points: np.ndarray) -> np.ndarray:
    return np.unique(np.asarray(hull_mesh(points).face_normals).round(5), axis=0)


def yaw(degrees: float) -> np.ndarray:
    """Rotation [3, 3] about z; exact at right angles."""
    if degrees % 90 == 0:
        c, s = ((1, 0), (0, 1), (-1, 0), (0, -1))[round(degrees / 90) % 4]
    else:
        c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]], float)


def rpy_of(rotation: np.ndarray) -> tuple[float, float, float]:
    """URDF's fixed-axis roll, pitch, yaw of a rotation matrix."""
    r = rotation
    pitch = math.asin(max(-1.0, min(1.0, -r[2, 0])))
    if abs(r[2, 0]) < 1 - 1e-9:
        return math.atan2(r[2, 1], r[2, 2]), pitch, math.atan2(r[1, 0], r[0, 0])
    return math.atan2(-r[1, 2], r[1, 1]), pitch, 0.0


def _rpy(rpy: tuple[float, float, float]) -> np.ndarray:
    cr, cp, cy = (math.cos(a) for a in rpy)
    sr, sp, sy = (math.sin(a) for a in rpy)
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def _swept(model: HouseholdObject) -> tuple[Hull, ...]:
    """Hulls of each moving link (with all that hangs on it) at steps of its joint, base frame."""
    children: dict[str, list[str]] = {}
    for joint in model.joints:
        children.setdefault(joint.parent, []).append(joint.child)
    links = {link.name: link for link in model.links}
    found: list[Hull] = []
    for joint in model.joints:
        if joint.kind not in ("revolute", "prismatic"):
            continue
        moved = [joint.child]
        for name in moved:
            moved += children.get(name, [])
        hulls = [points + links[name].origin for name in moved for points in links[name].hulls]
        pivot, axis = links[joint.child].origin, np.array(joint.axis) / np.linalg.norm(joint.axis)
        earlier: list[np.ndarray] = []
        for share in SWEEP_AT:
            q = joint.limits[0] + (joint.limits[1] - joint.limits[0]) * share
            turn = np.eye(3) if joint.kind == "prismatic" else _about(axis, q)
            shift = axis * q if joint.kind == "prismatic" else pivot - turn @ pivot
            now = [points @ turn.T + shift for points in hulls]
            between = [np.concatenate(pair) for pair in zip(earlier, now, strict=True)] if earlier else []
            found += [(points, _normals(points)) for points in between]
            earlier = now
    return tuple(found)


def _about(axis: np.ndarray, angle: float) -> np.ndarray:
    x, y, z = axis
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + math.sin(angle) * k + (1 - math.cos(angle)) * k @ k
