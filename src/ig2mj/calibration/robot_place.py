"""Places of a home where a robot is tried, touching nothing (`find_place`)."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy import ndimage

from ig2mj.agents.urdf import UrdfRobot
from ig2mj.errors import EngineError
from ig2mj.scene.scene import Scene, load_scene


def find_place(robot: UrdfRobot, home: str, candidates: int = 24, seed: int = 0) -> UrdfRobot:
    """The robot where it touches nothing and has the most free floor before it.

    Raises EngineError: there is no such place.
    """
    rooms = load_scene(home).rooms
    assert rooms is not None and rooms.traversable is not None
    room, size = np.asarray(ndimage.distance_transform_edt(np.pad(rooms.traversable, 1))), len(rooms.traversable)
    room = room[1:-1, 1:-1] * rooms.trav_resolution
    rng, found = np.random.default_rng(seed), []
    cells = np.argwhere(room > 0.3)
    for row, column in cells[rng.permutation(len(cells))[:400]]:
        x, y = (np.array([column, row]) + 0.5 - size / 2) * rooms.trav_resolution
        for yaw in np.arange(8) * (np.pi / 4):
            way = [(x + d * np.cos(yaw), y + d * np.sin(yaw)) for d in np.arange(0, 1.5, 0.1)]
            at = [
                (int(b / rooms.trav_resolution + size / 2), int(a / rooms.trav_resolution + size / 2)) for a, b in way
            ]
            inside = [room[i, j] if 0 <= i < size and 0 <= j < size else 0.0 for i, j in at]
            found.append((min(inside) + 0.3 * room[row, column], x, y, float(yaw)))
    for _, x, y, yaw in sorted(found, reverse=True)[:candidates]:
        placed = robot.at(float(x), float(y), yaw)
        if not collisions(load_scene(home, agents=[placed])):
            return placed
    raise EngineError(f"robot '{robot.name}' touches something at {candidates} places of '{home}'")


def collisions(scene: Scene, data: Any = None) -> bool:
    """The first robot touches something that is not a floor."""
    data = scene.start_data() if data is None else data
    tables = scene.tables
    agent = tables.body_agent[scene.model.geom_bodyid] == 0
    floors = np.array([c in ("floors", "carpet") for c in tables.object_categories])
    ground = (tables.geom_object >= 0) & floors[tables.geom_object]
    for contact in data.contact:
        one, two = contact.geom
        if agent[one] != agent[two] and contact.dist < 0 and not ground[two if agent[one] else one]:
            return True
    return False
