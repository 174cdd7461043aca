"""An object of a home: a model of the catalogue, put somewhere. Its hulls and boxes in the world."""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Sequence

import numpy as np

from ..objects.catalogue import build_model, find
from ..objects.model import HouseholdObject
from ..objects.stable_poses import stable_orientations
from ..shapes.sweeps import Hull, face_normals, opened, swept


@dataclasses.dataclass(frozen=True, eq=False)
class Shape:
    """What placing needs to know of one model, in its base frame with all joints at 0.

    Attributes:
      hulls: collision hulls, [n, 3] each; links: the link number of each.
      normals: outward face normals of each hull, [m, 3], without repeats.
      low, high: corners of the box around all hulls.
      swept: hulls around all that the moving parts go through (see sweeps.py), with their normals.
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
    normals = tuple(face_normals(h) for h in hulls)
    low, high = model.bounds()
    return Shape(model, tuple(hulls), tuple(links), normals, low, high, tuple(swept(model)))


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
class Placed:
    """An object at its place.

    Attributes:
      name: in the scene. category, index: which model. scale: one number for all axes.
      position: of the base frame, m. rotation: [3, 3].
      fixed: to the house. rooms: instances.
      host: the object it stands on or in, or None.
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

    def open_boxes(self) -> np.ndarray:
        """[n, 2, 3] world boxes of the hulls of its doors, lids and drawers where they are wide open."""
        hulls = [self.world(points) for points in opened(self.shape.model)]
        return np.array([[p.min(0), p.max(0)] for p in hulls]).reshape(-1, 2, 3)

    def parts(self) -> list[Hull]:
        """Its hulls in the world, with their normals."""
        return [(points, n @ self.rotation.T) for points, n in zip(self.hulls(), self.shape.normals, strict=True)]

    def swept(self) -> list[Hull]:
        """Hulls in the world that its moving parts fill on their ways."""
        return [(self.world(points), normals @ self.rotation.T) for points, normals in self.shape.swept]


def boxes_of(hulls: Sequence[Hull]) -> np.ndarray:
    """[n, 2, 3] boxes around hulls."""
    return np.array([[points.min(0), points.max(0)] for points, _ in hulls]).reshape(-1, 2, 3)


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
