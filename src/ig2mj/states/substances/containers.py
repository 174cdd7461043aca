"""Containers: what stays in at each tilt, and where the rest flows out.

Axes: C containers, U substances, R = 8 corners of a rim, A tilts, B directions, W worlds.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float, Int

from ig2mj.engine.view import Array, PhysicsView
from ig2mj.geometry.frames import Frames, Numbers, dot, numbers, sums
from ig2mj.scene.manifest import InsideEntry
from ig2mj.scene.tables import SceneTables

TILTS, DIRECTIONS, CORNERS = 19, 8, 8
"""Rows and columns of `Containers.capacity`: tilts from 0 to 180 degrees, directions of it about the opening's axis;
and corners that every rim has."""

LOWEST = 0.005
"""m above the lowest corner of a rim up to which others count as lowest, too, the less the higher they are."""

SMALL = 1e-2
"""Weight, 1/m, of the way to the lowest place next to the direction of the opening."""

FINENESS = 18
"""Points along each edge of the box of an inside with which its volumes are measured."""


@dataclasses.dataclass(frozen=True, eq=False)
class Containers:
    """The containers of a scene; lengths in m in the frame of the container's main body.

    Attributes:
      object, body: of each. litres: what it holds when its opening faces up.
      rim: corners of the opening, in order. centre: their mean. normal: unit, out of the opening. side: unit, in the
        plane of the opening, from which directions are counted.
      capacity: litres that stay in, by tilt and direction. drains: it has a drain. filling: points spread evenly over
        the inside of each.
    """

    object: Int[np.ndarray, "C"]
    body: Int[np.ndarray, "C"]
    litres: Float[np.ndarray, "C"]
    rim: Float[np.ndarray, "C R 3"]
    centre: Float[np.ndarray, "C 3"]
    normal: Float[np.ndarray, "C 3"]
    side: Float[np.ndarray, "C 3"]
    capacity: Float[np.ndarray, "C A B"]
    drains: Bool[np.ndarray, "C"]
    filling: tuple[np.ndarray, ...]

    @classmethod
    def build(
        cls, tables: SceneTables, insides: Mapping[int, InsideEntry], drains: Bool[np.ndarray, "O"]
    ) -> Containers:
        """Those of a scene. `insides`: of the objects that have one. `drains`: objects with a drain."""
        found = list(insides.items())
        objects = np.array([o for o, _ in found], int)
        shapes: dict[bytes, _Shape] = {}
        rows = []
        for _, inside in found:
            key = np.array([*inside.vertices, *inside.rim]).tobytes()
            if key not in shapes:
                shapes[key] = _shape(inside)
            rows.append(shapes[key])
        return cls(
            object=objects,
            body=tables.object_root[objects],
            litres=np.array([inside.litres for _, inside in found], np.float32),
            rim=_stacked([r.rim for r in rows], (CORNERS, 3)),
            centre=_stacked([r.rim.mean(0) for r in rows], (3,)),
            normal=_stacked([r.normal for r in rows], (3,)),
            side=_stacked([r.side for r in rows], (3,)),
            capacity=_stacked([r.capacity for r in rows], (TILTS, DIRECTIONS)),
            drains=drains[objects],
            filling=tuple(r.filling for r in rows),
        )

    def row_of(self, obj: int) -> int | None:
        """The row of an object; None: it is no container."""
        found = np.flatnonzero(self.object == obj)
        return int(found[0]) if len(found) else None

    def frames(self, view: PhysicsView) -> Frames:
        """Poses of their bodies [W, C]."""
        return Frames.of(view.body_pos, view.body_quat, self.body)

    @property
    def across(self) -> Float[np.ndarray, "C 3"]:
        """Unit, in the plane of the opening, at right angles to `side`."""
        return np.cross(self.normal, self.side).astype(np.float32)

    def tilted(self, up: Numbers) -> tuple[Float[Array, "W C"], Float[Array, "W C"]]:
        """Rows and columns of `capacity`, with parts of them, of containers as they stand; a column is from 0 to
        `DIRECTIONS`. `up`: the direction upwards in the frames of their bodies."""
        along, x, y = (dot(up, numbers(axis)) for axis in (self.normal, self.side, self.across))
        tilt = jnp.arctan2(jnp.sqrt(x * x + y * y), along) * ((TILTS - 1) / np.pi)
        return tilt, jnp.mod(jnp.arctan2(y, x) * (DIRECTIONS / (2 * np.pi)), DIRECTIONS)

    def holds(self, view: PhysicsView) -> Float[Array, "W C"]:
        """Litres that stay in each container as it stands."""
        tilt, turn = self.tilted(self.frames(view).up())
        row = jnp.clip(jnp.floor(tilt), 0, TILTS - 2).astype(int)
        column = jnp.clip(jnp.floor(turn), 0, DIRECTIONS - 1).astype(int)
        table, own = self.capacity.reshape(len(self.body), -1), np.arange(len(self.body))
        parts = []
        for beside in (0, 1):
            place = jnp.mod(column + beside, DIRECTIONS)
            low, high = (jnp.asarray(table)[own, (row + step) * DIRECTIONS + place] for step in (0, 1))
            parts.append(low + (tilt - row) * (high - low))
        return parts[0] + (turn - column) * (parts[1] - parts[0])

    def stays_in(self, row: int, up: Float[np.ndarray, "3"]) -> float:
        """Litres that stay in one container. `up`: the direction upwards in the frame of its body."""
        x, y = up @ self.side[row], up @ self.across[row]
        tilt = float(np.arctan2(np.hypot(x, y), up @ self.normal[row])) * ((TILTS - 1) / np.pi)
        turn = float(np.arctan2(y, x)) * (DIRECTIONS / (2 * np.pi)) % DIRECTIONS
        low, part = min(int(tilt), TILTS - 2), int(turn) % DIRECTIONS
        rows = self.capacity[row, low : low + 2][:, [part, (part + 1) % DIRECTIONS]]
        rows = rows[0] + (tilt - low) * (rows[1] - rows[0])
        return float(rows[0] + (turn - int(turn)) * (rows[1] - rows[0]))

    def openings(self, view: PhysicsView) -> Openings:
        """Where the openings are."""
        frames = self.frames(view)
        rim = frames.with_axes(2).points(numbers(self.rim))
        return Openings(rim, frames.points(numbers(self.centre)), frames.turned(numbers(self.normal)))


class Openings(NamedTuple):
    """Number by number, world frame, m: corners of the rims [W, C, R], their means, and unit normals that point out
    [W, C]."""

    rim: Numbers
    centre: Numbers
    normal: Numbers

    def lowest(self) -> Numbers:
        """The lowest place of each rim: the mean of its lowest corners, of an edge its middle."""
        height = self.rim[2]
        weight = jnp.maximum(LOWEST - (height - jnp.min(height, axis=-1, keepdims=True)), 0.0)
        *weighted, weights = sums([*(weight * n for n in self.rim), weight], axis=-1)
        return [w / weights for w in weighted]

    def outwards(self) -> Numbers:
        """Horizontal unit vectors in which the openings point; of one that points up or down, to its lowest place."""
        lowest = self.lowest()
        way = [self.normal[i] + SMALL * (lowest[i] - self.centre[i]) for i in range(2)]
        length = jnp.maximum(jnp.sqrt(dot(way, way)), 1e-6)
        return [n / length for n in way]


@dataclasses.dataclass(frozen=True, eq=False)
class _Shape:
    rim: Float[np.ndarray, "R 3"]
    normal: Float[np.ndarray, "3"]
    side: Float[np.ndarray, "3"]
    capacity: Float[np.ndarray, "A B"]
    filling: Float[np.ndarray, "P 3"]


def _shape(inside: InsideEntry) -> _Shape:
    rim = np.array(inside.rim, float)
    centre = rim.mean(0)
    product = np.cross(rim - centre, np.roll(rim, -1, axis=0) - centre).sum(0)
    normal = product / np.linalg.norm(product)
    if normal @ (centre - np.mean(inside.vertices, axis=0)) < 0:
        normal, rim = -normal, rim[::-1]
    side = np.array([1.0, 0.0, 0.0]) if abs(normal[0]) < 0.9 else np.array([0.0, 1.0, 0.0])
    side -= normal * (side @ normal)
    side /= np.linalg.norm(side)
    points = _filling(np.array(inside.vertices, float))
    return _Shape(_with_corners(rim), normal, side, _capacity(inside.litres, points, rim, normal, side), points)


def _with_corners(rim: Float[np.ndarray, "M 3"]) -> Float[np.ndarray, "R 3"]:
    """A rim with `CORNERS` corners: the first is repeated, or some are left out."""
    if len(rim) <= CORNERS:
        return np.concatenate([rim, np.repeat(rim[:1], CORNERS - len(rim), axis=0)])
    return rim[np.linspace(0, len(rim), CORNERS, endpoint=False).astype(int)]


def _capacity(
    litres: float,
    points: Float[np.ndarray, "P 3"],
    rim: Float[np.ndarray, "M 3"],
    normal: Float[np.ndarray, "3"],
    side: Float[np.ndarray, "3"],
) -> Float[np.ndarray, "A B"]:
    """Litres below the lowest corner of the rim, by tilt and direction. `points`: of the inside."""
    tilt = np.linspace(0, np.pi, TILTS)[:, None, None]
    turn = (np.arange(DIRECTIONS) * (2 * np.pi / DIRECTIONS))[None, :, None]
    across = np.cross(normal, side)
    up = np.cos(tilt) * normal + np.sin(tilt) * (np.cos(turn) * side + np.sin(turn) * across)
    level = (up @ rim.T).min(-1)
    share = ((up @ points.T) <= level[..., None] + 1e-9).mean(-1)
    share[0] = 1.0
    return (litres * share).astype(np.float32)


def _filling(vertices: Float[np.ndarray, "V 3"]) -> Float[np.ndarray, "P 3"]:
    """Points spread evenly over a convex body."""
    import scipy.spatial  # takes as long as all of this package

    low, high = vertices.min(0), vertices.max(0)
    axes = [np.linspace(a, b, FINENESS + 1)[1:] - (b - a) / (2 * FINENESS) for a, b in zip(low, high, strict=True)]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    try:
        planes = scipy.spatial.ConvexHull(vertices).equations
    except scipy.spatial.QhullError:
        return grid
    return grid[np.all(grid @ planes[:, :3].T + planes[:, 3] <= 1e-9, axis=1)]


def _stacked(rows: Sequence[np.ndarray], shape: tuple[int, ...]) -> np.ndarray:
    return np.array(rows, np.float32).reshape(-1, *shape)
