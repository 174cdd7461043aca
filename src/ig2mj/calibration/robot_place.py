"""Places of a home where a robot is tried, touching nothing (`find_place`)."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from scipy import ndimage

from ig2mj.agents.urdf import UrdfRobot
from ig2mj.errors import EngineError
from ig2mj.scene.scene import Scene, load_scene

FREE_AHEAD, FREE_ASIDE = 1.5, 0.9
"""m of free floor that a place is to have in front of the robot, and on the side to which its arm reaches."""

ASIDE = 0.2
"""m from the base's middle at which a hand is on one side of it."""


def find_place(robot: UrdfRobot, home: str, candidates: int = 24, seed: int = 0) -> UrdfRobot:
    """The robot where it touches nothing and has the most free floor before it, and next to it where its hand is there.

    Raises EngineError: there is no such place.
    """
    rooms = load_scene(home).rooms
    assert rooms is not None and rooms.traversable is not None
    room, size = np.asarray(ndimage.distance_transform_edt(np.pad(rooms.traversable, 1))), len(rooms.traversable)
    room = room[1:-1, 1:-1] * rooms.trav_resolution
    rng, found, ways = np.random.default_rng(seed), [], [(0.0, FREE_AHEAD)]
    if (aside := _reaches_aside(robot)) is not None:
        ways.append((aside, FREE_ASIDE))
    cells = np.argwhere(room > 0.3)
    for row, column in cells[rng.permutation(len(cells))[:400]]:
        x, y = (np.array([column, row]) + 0.5 - size / 2) * rooms.trav_resolution
        for yaw in np.arange(8) * (np.pi / 4):
            way = [
                (x + d * np.cos(yaw + turn), y + d * np.sin(yaw + turn))
                for turn, far in ways
                for d in np.arange(0, far, 0.1)
            ]
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


def _reaches_aside(robot: UrdfRobot) -> float | None:
    """rad from the robot's front to the left, to where its first hand is at the start; None: in front of it."""
    layout, body = robot.layout, robot.body
    if not layout.hands:
        return None
    start = {name: body.start_of(name, layout) for name in body.scalar_names}
    x, y, _ = body.pose(body.frame(layout.hands[0])[0], body.posed(start))[0]
    angle = math.atan2(y, x)
    return angle if math.hypot(x, y) > ASIDE and abs(angle) > math.pi / 4 else None


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
