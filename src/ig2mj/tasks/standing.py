"""Where a robot starts that no task has a position for: on free floor, near what the task is about."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from ig2mj.agents.turtlebot import TurtleBot
from ig2mj.scene.scene import load_scene
from ig2mj.tasks.navigation.starts import DOORS, Places
from ig2mj.worlds.pool import Pool

CLEARANCE = 0.45
"""m around the robot that are free of furniture."""

TURN = 5.0
"""Degrees: a robot is turned by a multiple of it, so that the last digits of a start state do not matter."""


def standing_place(home: str, added: Sequence[str], names: Sequence[str], pool: Pool) -> tuple[float, float, float]:
    """World x and y (m) of free floor with room to turn, near objects in the pool's first row; and degrees by which a
    robot is turned that faces them. Doors between rooms stand open, but for those that are named; where they part the
    floor, the robot stands where most of the objects are in reach.

    Args:
      home, added: the household, as of `load_scene`. names: the objects; others are ignored, such as rooms.

    Raises:
      EngineError: the home has no map, or no such floor.
    """
    import scipy.ndimage

    probe = load_scene(home, agents=[TurtleBot()], objects=added)
    own = probe.start_data().qpos.copy()
    row = np.asarray(pool.physics.scene.qpos)[0]
    own[: len(row)] = row
    tables = probe.tables
    doors = np.isin(np.array(tables.object_categories), DOORS) & ~np.isin(np.array(tables.object_names), names)
    open_now = doors[tables.openable_object]
    own[tables.openable_qposadr[open_now]] = tables.openable_open[open_now]
    places = Places(probe, own)
    there = [name for name in names if name in probe.object_names]
    centres = places.object_positions(tuple(there))[:, :2]
    floor = places.floor(centres)
    padded = np.pad(floor.free, 1)
    away = np.asarray(scipy.ndimage.distance_transform_edt(padded))[1:-1, 1:-1] * floor.resolution
    cells = np.argwhere(away >= min(CLEARANCE, away.max()))
    spots = floor.centres(cells)
    centres = centres if there else spots.mean(0, keepdims=True)
    apart = np.linalg.norm(spots[:, None] - centres[None], axis=-1)
    x, y = spots[int(np.argmin(np.median(apart, axis=1)))]
    ahead = centres.mean(0) - (x, y)
    return float(x), float(y), TURN * round(math.degrees(math.atan2(ahead[1], ahead[0])) / TURN)
