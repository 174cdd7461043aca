"""`MotionPlanner`: ways of a robot's base over the floor of a home.

    planner = MotionPlanner(simulation.scene)
    plan = planner.plan_base(simulation.view, (1.0, -2.0))
    plan.points            # [N, 2] m, the first is where the robot is
    plan.reason            # "" or why there is no way

Axes: N points of a way, h and w cells of the map along y and x.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Collection, Sequence
from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Int

from ig2mj.engine.view import PhysicsView
from ig2mj.planning.clearance import Obstacles, PlacedPieces
from ig2mj.planning.footprint import BaseFootprint
from ig2mj.planning.occupancy import RESOLUTION, Occupancy, door_objects
from ig2mj.scene.scene import Scene
from ig2mj.tasks.navigation.floor import FloorMap

Point = Sequence[float] | np.ndarray
"""World x and y, m."""

NEAR_GOAL, NEAR_START = 0.15, 0.5
"""m from the goal within which a free cell will do, and from the robot within which the way may begin."""

COMFORT, CAUTION = 0.15, 3.0
"""m of spare room from which on a way is not lengthened by nearness, and by how much it is where there is none."""

FLOORS_KEPT = 8
"""Free floors that are kept with their fields."""

LOOKAHEAD = 120
"""Cells of a way that one straight line may replace."""


@dataclasses.dataclass(frozen=True, eq=False)
class BasePlan:
    """A way over the floor, or why there is none.

    Attributes:
      points: [N, 2] m, world frame; the first is the robot's position. yaw: rad, at the end; None: any.
      length: m. reason: "" for a way, "no_base": the goal is not free, "no_path": no way leads there.
      detail: the reason in words. doors: shut doors without which there would be a way.
    """

    points: Float[np.ndarray, "N 2"]
    yaw: float | None = None
    length: float = 0.0
    reason: str = ""
    detail: str = ""
    doors: tuple[str, ...] = ()


@dataclasses.dataclass(frozen=True, eq=False)
class FreeFloor:
    """Where a robot can stand in one world.

    Attributes:
      free: cells. spare: m by which each is farther from obstacles than it has to be.
    """

    occupancy: Occupancy
    free: Bool[np.ndarray, "h w"]
    spare: Float[np.ndarray, "h w"]

    def nearest(self, xy: Point, within: float) -> Int[np.ndarray, "2"] | None:
        """The free cell nearest to a point, m; None: there is none within `within`."""
        reach = int(np.ceil(within / RESOLUTION))
        row, column = self.occupancy.cells(np.asarray(xy, float))
        low = np.maximum([row - reach, column - reach], 0)
        part = self.free[low[0] : max(row + reach + 1, 0), low[1] : max(column + reach + 1, 0)]
        cells = np.argwhere(part) + low
        if not len(cells):
            return None
        apart = np.linalg.norm(self.occupancy.middles(cells) - np.asarray(xy, float), axis=1)
        best = int(np.argmin(apart))
        return cells[best] if apart[best] <= within else None

    def within(self, xy: Point, reach: float) -> Int[np.ndarray, "n 2"]:
        """Free cells whose middles are within `reach` (m) of a point."""
        point = np.asarray(xy, float)
        low = np.clip(self.occupancy.cells(point - reach), 0, self.free.shape)
        high = np.clip(self.occupancy.cells(point + reach) + 1, 0, self.free.shape)
        cells = np.argwhere(self.free[low[0] : high[0], low[1] : high[1]]) + low
        return cells[np.linalg.norm(self.occupancy.middles(cells) - point, axis=1) < reach]

    def distances(self, xy: Point, within: float = NEAR_GOAL) -> Float[np.ndarray, "h w"]:
        """m along the floor from each cell to the free one nearest to a point, with the surcharge of narrow places;
        infinite without a way.

        Args:
          within: m from the point that the free cell is at most.
        """
        start = self.nearest(xy, within)
        return np.full(self.free.shape, np.inf) if start is None else self._field(start)[0]

    def way(self, start: Point, goal: Point) -> Float[np.ndarray, "N 2"] | None:
        """Points of a way between two positions, straightened; None where there is none."""
        begin, end = self.nearest(start, NEAR_START), self.nearest(goal, NEAR_GOAL)
        if begin is None or end is None:
            return None
        distance, before = self._field(begin)
        if not np.isfinite(distance[tuple(end)]):
            return None
        width, cells = self.free.shape[1], [end]
        while (cell := before[tuple(cells[-1])]) >= 0:
            cells.append(np.array(divmod(int(cell), width)))
        return np.concatenate(
            [np.asarray(start, float)[None], self.occupancy.middles(self._straightened(np.array(cells[::-1])))]
        )

    def _field(self, start: Int[np.ndarray, "2"]) -> tuple[Float[np.ndarray, "h w"], Int[np.ndarray, "h w"]]:
        """Distance of every cell from a free one, and the cell before it on the way (row times width and column; -1:
        none). The last one is kept: a robot asks for many ways from where it is."""
        from scipy.sparse import csgraph

        key = (int(start[0]), int(start[1]))
        if key not in self._fields:
            places = np.flatnonzero(self.free.ravel())
            distance, before = np.full(self.free.shape, np.inf), np.full(self.free.shape, -1)
            away, came = csgraph.dijkstra(
                self._graph,
                directed=False,
                indices=int(np.searchsorted(places, key[0] * self.free.shape[1] + key[1])),
                return_predecessors=True,
            )
            distance.ravel()[places] = away
            before.ravel()[places] = np.where(came >= 0, places[np.maximum(came, 0)], -1)
            self._fields.clear()
            self._fields[key] = distance, before
        return self._fields[key]

    @functools.cached_property
    def _fields(self) -> dict[tuple[int, int], tuple[np.ndarray, np.ndarray]]:
        return {}

    @functools.cached_property
    def _graph(self) -> Any:
        """Steps between free cells; rows are free cells in order."""
        places = np.flatnonzero(self.free.ravel())
        number = np.full(self.free.shape, -1)
        number.ravel()[places] = np.arange(len(places))
        graph = FloorMap(self.free, self.occupancy.origin, RESOLUTION).graph(number).tocoo()
        slow = 1 + CAUTION * np.clip(1 - self.spare.ravel()[places] / COMFORT, 0.0, 1.0)
        graph.data = graph.data * (slow[graph.row] + slow[graph.col]) / 2
        return graph.tocsr()

    def _straightened(self, cells: Int[np.ndarray, "n 2"]) -> Int[np.ndarray, "N 2"]:
        """The way without points that a straight line over cells as free as those of the way can do without."""
        kept = [cells[0]]
        k = 0
        while k < len(cells) - 1:
            ahead = min(k + LOOKAHEAD, len(cells) - 1)
            while ahead > k + 1 and not self._sees(cells[k], cells[ahead], cells[k : ahead + 1]):
                ahead -= max(1, (ahead - k) // 8)
            k = ahead
            kept.append(cells[k])
        return np.array(kept)

    def _sees(self, one: np.ndarray, other: np.ndarray, between: np.ndarray) -> bool:
        count = 2 * int(np.abs(other - one).max()) + 1
        line = np.round(one + np.linspace(0, 1, count)[:, None] * (other - one)).astype(int)
        rows, columns = line.T
        if not self.free[rows, columns].all():
            return False
        own = min(COMFORT, float(self.spare[tuple(between.T)].min()))
        return bool(self.spare[rows, columns].min() >= own - 1e-9)


class MotionPlanner:
    """Plans for one robot of a scene, in any world of any batch of it.

    Attributes:
      scene: with the robot. agent: its number.
    """

    def __init__(self, scene: Scene, agent: int = 0):
        self.scene, self.agent = scene, agent
        self.occupancy = Occupancy(scene)
        self._pieces = PlacedPieces(scene)
        self._floors: list[FreeFloor] = []

    def floor(
        self,
        view: PhysicsView,
        footprint: BaseFootprint | None = None,
        without: Collection[int] = (),
        world: int = 0,
    ) -> FreeFloor:
        """Where the robot can stand.

        Args:
          footprint: None: that of the robot as it stands. without: objects that do not count, such as what it holds.
        """
        footprint = footprint or BaseFootprint.of_robot(self.scene, view, self.agent, world)
        held = np.flatnonzero(np.asarray(view.held)[world].any(0)) if np.asarray(view.held).size else np.zeros(0, int)
        free, spare = self.occupancy.free(view, footprint, {*without, *held.tolist()}, world)
        for kept in self._floors:
            if np.array_equal(kept.spare, spare):
                return kept
        floor = FreeFloor(self.occupancy, free, spare)
        self._floors = [floor, *self._floors[: FLOORS_KEPT - 1]]
        return floor

    def obstacles(self, view: PhysicsView, without: Collection[int] = (), world: int = 0) -> Obstacles:
        """What hands keep clear of: pieces of everything but some objects."""
        return Obstacles(self.scene, view, world, without, self._pieces)

    def plan_base(
        self,
        view: PhysicsView,
        goal: Point,
        *,
        yaw: float | None = None,
        footprint: BaseFootprint | None = None,
        without: Collection[int] = (),
        world: int = 0,
    ) -> BasePlan:
        """A way from where the robot is to a point of the floor.

        Args:
          view: with a world axis; `world` of it is planned in. goal: x and y, m. yaw: rad, at the end; None: any.
          footprint, without: see `floor`.

        Returns:
          The way. `reason` is "no_base" where the goal is not free, and "no_path" where no way leads there; then
          `doors` names shut doors that are in the way.
        """
        start = np.asarray(view.agent.base_pos)[world, self.agent, :2].astype(float)
        floor = self.floor(view, footprint, without, world)
        here = start[None]
        end = floor.nearest(goal, NEAR_GOAL)
        if end is None:
            return BasePlan(here, reason="no_base", detail=f"({goal[0]:.2f}, {goal[1]:.2f}) m is not free floor")
        way = floor.way(start, goal)
        if way is None:
            return self._blocked(view, here, goal, footprint, without, world)
        length = float(np.linalg.norm(np.diff(way, axis=0), axis=1).sum())
        return BasePlan(way, yaw, length)

    def _blocked(
        self,
        view: PhysicsView,
        here: Float[np.ndarray, "1 2"],
        goal: Point,
        footprint: BaseFootprint | None,
        without: Collection[int],
        world: int,
    ) -> BasePlan:
        """What keeps the robot from its goal: shut doors, where there is a way without them."""
        doors = [int(d) for d in door_objects(self.scene.tables) if d not in without]
        said = f"no way leads to ({goal[0]:.2f}, {goal[1]:.2f}) m"
        way = self.floor(view, footprint, {*without, *doors}, world).way(here[0], goal) if doors else None
        if way is None:
            return BasePlan(here, reason="no_path", detail=said)
        names = self.scene.tables.object_names

        def bars(door: int) -> bool:
            floor = self.floor(view, footprint, {*without, *doors} - {door}, world)
            return floor.way(here[0], goal) is None

        shut = tuple(names[d] for d in ([d for d in doors if bars(d)] or doors))
        return BasePlan(here, reason="no_path", detail=f"{said}: {', '.join(shut)} shut", doors=shut)
