"""Where a robot starts to solve a problem, and doors between rooms, which stand open or shut."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Any

import numpy as np

from ig2mj.agents.registry import find_robot
from ig2mj.agents.task_robot import TaskRobot
from ig2mj.engine.base import Write
from ig2mj.engine.view import PhysicsView
from ig2mj.engine.writes import joints
from ig2mj.errors import EngineError
from ig2mj.planning.footprint import LOWEST, BaseFootprint, Disc
from ig2mj.planning.occupancy import Occupancy, door_objects
from ig2mj.planning.problem import Problem, start_of
from ig2mj.sampling.query import SceneQuery
from ig2mj.scene.scene import Scene, load_scene
from ig2mj.worlds.pool import Pool

ROOM, TALL = 0.34, 1.3
"""m: radius of the free floor on which a robot starts, and height up to which it is free."""


def start_place(scene: Scene, view: PhysicsView, near: Sequence[str]) -> tuple[float, float]:
    """World x and y (m) of free floor as near as can be to the middle of some objects, in the largest free part.

    Args:
      scene: without robots. view: of one world of it. near: names of objects; none: the roomiest place.

    Raises:
      EngineError: no floor is free.
    """
    import scipy.ndimage

    occupancy = Occupancy(scene)
    doors = door_objects(scene.tables).tolist()
    free, spare = occupancy.free(view, BaseFootprint((Disc(LOWEST, TALL, ROOM),)), doors)
    labels = np.asarray(scipy.ndimage.label(free)[0])  # pyright: ignore[reportIndexIssue]
    if not labels.any():
        raise EngineError(f"'{scene.name}' has no free floor for a robot to start on")
    cells = np.argwhere(labels == 1 + np.argmax(np.bincount(labels.ravel())[1:]))
    if near:
        centres = np.asarray(view.object_com)[0, [scene.object_index(n) for n in near], :2]
        apart = np.linalg.norm(occupancy.middles(cells)[:, None] - centres[None], axis=-1)
        best = int(np.argmin(np.median(apart, axis=1)))
    else:
        best = int(np.argmax(spare[tuple(cells.T)]))
    x, y = occupancy.middles(cells[best])
    return float(x), float(y)


def scene_with_robot(problem: Problem, robot: str | TaskRobot, pool: Pool | None = None) -> Scene:
    """A problem's scene with a robot on free floor near what the goal is about.

    Args:
      pool: start states, the first of which counts; None: the scene's own start.

    Raises:
      UnknownNameError: no such robot. EngineError: no floor is free.
    """
    query = SceneQuery(problem.scene)
    if pool is not None:
        query.load(start_of(pool, 0)[0])
    tables, names = problem.scene.tables, problem.scene.object_names
    near = [n for n in problem.named if n in names and not tables.object_is_floor[names.index(n)]]
    x, y = start_place(problem.scene, query.view, near)
    body: Any = find_robot(robot)[1]
    return load_scene(problem.scene.folder, agents=[body.at(x, y, 0.0)], objects=problem.objects)


def open_doors(scene: Scene, without: Collection[str] = ()) -> Write | None:
    """A write that opens all doors between rooms wide, but for some objects; None: there are none."""
    tables = scene.tables
    doors = [d for d in door_objects(tables) if tables.object_names[d] not in without]
    moved = np.isin(tables.openable_object, doors)
    if not moved.any():
        return None
    return joints(scene.model.nq, tables.openable_qposadr[moved], tables.openable_open[moved])
