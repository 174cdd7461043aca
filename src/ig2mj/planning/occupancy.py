"""`Occupancy`: which cells of a home's floor are free, from collision pieces, by height.

A cell is taken at a height where a convex piece of an object comes nearer than half a cell to its middle. A robot can
stand where each disc of its footprint is as far from what is taken at its heights as it is wide. Pieces of objects
that cannot move are drawn once for each range of heights, others where they have moved.

Axes: K pieces, V vertices, h and w cells along y and x.
"""

from __future__ import annotations

import collections
import functools
import itertools
from collections.abc import Collection

import numpy as np
from jaxtyping import Bool, Float, Int

from ig2mj.engine.view import PhysicsView
from ig2mj.geometry.poses import matrices_on_host
from ig2mj.planning.footprint import SLICES, BaseFootprint
from ig2mj.scene.scene import Scene
from ig2mj.scene.tables import SceneTables
from ig2mj.tasks.task import GROUND

RESOLUTION, MARGIN = 0.05, 0.5
"""m: of a cell, and around the home's floor."""

DIRECTIONS = 16
"""Sides of the polygons by which pieces are drawn, at most."""

SEAM = 0.001
"""m beyond its edge that a floor still counts, so that no gap stays where the floors of two rooms meet."""

CLEARANCE = 0.02
"""m between the footprint and what is taken."""

FIELDS_KEPT = 16
"""Distance transforms that are kept."""

_ANGLES = np.arange(DIRECTIONS) * (2 * np.pi / DIRECTIONS)
_NORMALS = np.stack([np.cos(_ANGLES), np.sin(_ANGLES)])


class Occupancy:
    """Cells of one home. What stays the same in all worlds is kept.

    Attributes:
      origin: [2] m, world x and y of the corner of cell (0, 0). shape: h, w.
    """

    def __init__(self, scene: Scene):
        self.scene = scene
        tables = scene.tables
        ground = np.isin(np.array(tables.object_categories), GROUND)
        owner = tables.piece_object
        self._solid = (owner >= 0) & ~ground[owner]
        self._floor = (owner >= 0) & tables.object_is_floor[owner]
        self._covering = (owner >= 0) & ground[owner] & ~self._floor
        moving = scene.model.body_weldid[tables.piece_body] != 0
        self._still = self._solid & ~moving
        self._moving = np.flatnonzero(self._solid & moving)
        self._vertices = (
            np.einsum("kij,kvj->kvi", matrices_on_host(tables.piece_quat), tables.piece_vertices)
            + tables.piece_pos[:, None]
        )
        self._kept: dict[tuple[float, float], np.ndarray] = {}
        self._drawn: dict[tuple[int, float, float], dict[int, tuple[bytes, np.ndarray]]] = {}
        self._away: collections.OrderedDict[bytes, np.ndarray] = collections.OrderedDict()
        self._of_body = {
            int(b): self._moving[body == b] for body in (tables.piece_body[self._moving],) for b in set(body)
        }
        start = scene.start_data()
        rotation = np.array(start.xmat).reshape(-1, 3, 3)
        still = np.flatnonzero(self._still | self._floor | self._covering)
        self._placed_still = dict(zip(still.tolist(), self._placed(still, np.array(start.xpos), rotation), strict=True))
        bounds = np.concatenate([v for v in self._placed_still.values()] or [np.zeros((1, 3))])
        inside = np.concatenate([self._placed_still[k] for k in np.flatnonzero(self._floor).tolist()] or [bounds])
        low, high = inside[:, :2].min(0) - MARGIN, inside[:, :2].max(0) + MARGIN
        self.origin: Float[np.ndarray, "2"] = np.floor(low / RESOLUTION) * RESOLUTION
        size = np.ceil((high - self.origin) / RESOLUTION).astype(int)
        self.shape: tuple[int, int] = (int(size[1]), int(size[0]))

    def _placed(
        self, pieces: Int[np.ndarray, "K"], pos: Float[np.ndarray, "B 3"], turn: Float[np.ndarray, "B 3 3"]
    ) -> Float[np.ndarray, "K V 3"]:
        """World positions of the vertices of pieces, where bodies are at these poses."""
        body = self.scene.tables.piece_body[pieces]
        return np.einsum("kij,kvj->kvi", turn[body], self._vertices[pieces]) + pos[body][:, None]

    @functools.cached_property
    def floor(self) -> Bool[np.ndarray, "h w"]:
        """Cells whose middles are over the home's floor; all, where it has none. Floors of rooms that meet are one."""
        pieces = [self._placed_still[k] for k in np.flatnonzero(self._floor).tolist()]
        if not pieces:
            return np.ones(self.shape, bool)
        found = np.zeros(self.shape, bool)
        for vertices in pieces:
            self._draw(found, vertices[:, :2], SEAM)
        return found

    @functools.cached_property
    def covered(self) -> Bool[np.ndarray, "h w"]:
        """Cells that carpets, mats and rugs cover, where the home has them."""
        found = np.zeros(self.shape, bool)
        for piece in np.flatnonzero(self._covering).tolist():
            self._draw(found, self._placed_still[piece][:, :2])
        return found

    def _taken_by_still(self, low: float, high: float) -> Bool[np.ndarray, "h w"]:
        if (low, high) in self._kept:
            return self._kept[low, high]
        self._kept[low, high] = found = np.zeros(self.shape, bool)
        for piece in np.flatnonzero(self._still).tolist():
            self._draw(found, _between(self._placed_still[piece], low, high))
        return found

    def still(self, low: float, high: float) -> Bool[np.ndarray, "h w"]:
        """Cells that things which cannot move take between two heights, m."""
        found = np.zeros(self.shape, bool)
        for band in _bands(low, high):
            found |= self._taken_by_still(*band)
        return found

    def taken(
        self, view: PhysicsView, low: float, high: float, without: Collection[int] = (), world: int = 0
    ) -> Bool[np.ndarray, "h w"]:
        """Cells that are taken between two heights, m.

        Args:
          view: with a world axis; `world` of it. without: objects that do not count (those that are held, doors).
        """
        found = np.zeros(self.shape, bool)
        owner, without = self.scene.tables.piece_object, set(without)
        pose = np.concatenate([np.asarray(view.body_pos)[world], np.asarray(view.body_quat)[world]], axis=1)
        for band in _bands(low, high):
            found |= self._taken_by_still(*band)
            drawn = self._drawn.setdefault((world, *band), {})
            for body, pieces in self._of_body.items():
                if int(owner[pieces[0]]) in without:
                    continue
                now = pose[body].tobytes()
                if (before := drawn.get(body)) is None or before[0] != now:
                    drawn[body] = before = now, self._cells_of(pieces, pose[body].astype(float), *band)
                found.ravel()[before[1]] = True
        return found

    def _cells_of(self, pieces: np.ndarray, pose: np.ndarray, low: float, high: float) -> Int[np.ndarray, "n"]:
        """Flat numbers of the cells that pieces of one body take between two heights."""
        turn = matrices_on_host(pose[None, 3:])[0]
        vertices = self._vertices[pieces] @ turn.T + pose[:3]
        z = vertices[..., 2]
        there = np.flatnonzero((z.min(1) < high) & (z.max(1) > low))
        if not len(there):
            return np.zeros(0, int)
        grid = np.zeros(self.shape, bool)
        for k in there:
            self._draw(grid, _between(vertices[k], low, high))
        return np.flatnonzero(grid)

    def free(
        self,
        view: PhysicsView,
        footprint: BaseFootprint,
        without: Collection[int] = (),
        world: int = 0,
        others: Collection[int] = (),
    ) -> tuple[Bool[np.ndarray, "h w"], Float[np.ndarray, "h w"]]:
        """Where a robot can stand, and how much farther than that it is from what is taken, m.

        Args:
          without: objects that do not count. others: numbers of robots that stand in the way.
        """
        spare = np.full(self.shape, np.inf)
        for disc in footprint.discs:
            taken = self.taken(view, disc.low, disc.high, without, world)
            spare = np.minimum(spare, self._distance_to(taken) - disc.radius - CLEARANCE)
        for other in others:
            spare = np.minimum(spare, self._spare_of(view, footprint, other, world))
        if footprint.wheels and self.covered.any():
            spare = np.minimum(spare, self._distance_to(self.covered) - footprint.wheels)
        return (spare >= 0) & self.floor, spare

    def _spare_of(
        self, view: PhysicsView, footprint: BaseFootprint, other: int, world: int
    ) -> Float[np.ndarray, "h w"] | float:
        """How much farther than it has to be from another robot a robot is, m."""
        spare = [
            disc.radius + its.radius
            for disc in footprint.discs
            for its in BaseFootprint.of_robot(self.scene, view, other, world).discs
            if disc.low < its.high and its.low < disc.high
        ]
        if not spare:
            return np.inf
        rows, columns = np.indices(self.shape)
        middles = self.middles(np.stack([rows, columns], axis=-1))
        xy = np.asarray(view.agent.base_pos)[world, other, :2]
        return np.linalg.norm(middles - xy, axis=-1) - max(spare) - CLEARANCE

    def _distance_to(self, taken: Bool[np.ndarray, "h w"]) -> Float[np.ndarray, "h w"]:
        """m from the middle of each cell to that of the nearest taken one; kept for the grids asked for last."""
        import scipy.ndimage

        key = np.packbits(taken).tobytes()
        if key in self._away:
            self._away.move_to_end(key)
            return self._away[key]
        away = np.asarray(scipy.ndimage.distance_transform_edt(np.pad(~taken, 1, constant_values=True)))
        self._away[key] = found = away[1:-1, 1:-1] * RESOLUTION
        if len(self._away) > FIELDS_KEPT:
            self._away.popitem(last=False)
        return found

    def cells(self, xy: Float[np.ndarray, "*n 2"]) -> Int[np.ndarray, "*n 2"]:
        """Row and column of the cells that hold points; may lie outside."""
        return np.floor((np.asarray(xy, float)[..., ::-1] - self.origin[::-1]) / RESOLUTION).astype(int)

    def middles(self, cells: Int[np.ndarray, "*n 2"]) -> Float[np.ndarray, "*n 2"]:
        """World x and y of the middles of cells, m."""
        return self.origin + (np.asarray(cells)[..., ::-1] + 0.5) * RESOLUTION

    def _draw(
        self, taken: Bool[np.ndarray, "h w"], points: Float[np.ndarray, "P 2"], margin: float = RESOLUTION / 2
    ) -> None:
        """Marks cells whose middles are within `margin` of the convex hull of points."""
        if not len(points):
            return
        low, high = self.cells(points.min(0) - margin), self.cells(points.max(0) + margin) + 1
        low, high = np.maximum(low, 0), np.minimum(high, self.shape)
        if (low >= high).any():
            return
        reach = (points @ _NORMALS).max(0) + margin
        rows, columns = np.arange(low[0], high[0]), np.arange(low[1], high[1])
        x = self.origin[0] + (columns + 0.5) * RESOLUTION
        y = self.origin[1] + (rows + 0.5) * RESOLUTION
        along = x[None, :, None] * _NORMALS[0] + y[:, None, None] * _NORMALS[1]
        taken[low[0] : high[0], low[1] : high[1]] |= (along <= reach).all(-1)


def _between(vertices: Float[np.ndarray, "V 3"], low: float, high: float) -> Float[np.ndarray, "P 2"]:
    """Points whose convex hull is the part of a convex piece between two heights, seen from above."""
    z = vertices[:, 2]
    if z.max() <= low or z.min() >= high:
        return np.zeros((0, 2))
    found = [vertices[(z >= low) & (z <= high), :2]]
    for height in (low, high):
        below, above = vertices[z < height], vertices[z > height]
        if len(below) and len(above):
            share = (height - below[:, None, 2]) / (above[None, :, 2] - below[:, None, 2])
            cut = below[:, None, :2] + share[..., None] * (above[None, :, :2] - below[:, None, :2])
            found.append(cut.reshape(-1, 2))
    return np.concatenate(found)


def _bands(low: float, high: float) -> list[tuple[float, float]]:
    """A range of heights, cut where footprints are, so that all footprints share what is drawn."""
    edges = [low, *(e for e in SLICES.tolist() if low < e < high), high]
    return list(itertools.pairwise(edges))


def door_objects(tables: SceneTables) -> Int[np.ndarray, "n"]:
    """Doors between rooms."""
    return np.flatnonzero(np.array(tables.object_categories) == "door")
