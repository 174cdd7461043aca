"""Views into rooms from the eye height of a person who stands in them."""

from __future__ import annotations

import math

import mujoco
import numpy as np
from jaxtyping import Float

from ig2mj.errors import UnknownNameError
from ig2mj.scene.scene import Scene
from ig2mj.viewer.offscreen import FreeView

EYE_HEIGHT, FIELD_OF_VIEW, TILT = 1.55, 70.0, -13.0
"""m above the floor; degrees, vertical; degrees below the horizon."""

FROM_WALLS, ABOVE = 0.42, 0.55
"""m that the eye keeps from walls and furniture; what is lower than `ABOVE` the floor does not block the view."""

FROM_DOORS = 0.75
"""m that the eye keeps from doors, which may be opened."""

DIRECTIONS = 24
"""Directions of view that are tried, around the circle."""


def room_view(scene: Scene, room: str, fovy: float = FIELD_OF_VIEW) -> FreeView:
    """Where a person stands who wants to see most of a room.

    Of the positions in the room that keep clear of walls and tall furniture, and of directions around the circle, the
    pair is taken in whose image most of the room's furniture and most of its floor lie.

    Raises UnknownNameError: the scene has no such room.
    """
    rooms = scene.rooms
    if rooms is None or room not in rooms.names:
        raise UnknownNameError("room", room, rooms.names if rooms is not None else ())
    cells, targets = _cells(scene, room), _furniture(scene, room)[1]
    eyes = standing_places(scene, room)
    points = np.concatenate([cells[:: max(1, len(cells) // 200)], np.repeat(targets, 12, axis=0)])
    best = (-1.0, eyes[0], 0.0)
    for eye in eyes:
        offset = points - eye
        far, angle = np.linalg.norm(offset, axis=1), np.arctan2(offset[:, 1], offset[:, 0])
        for k in range(DIRECTIONS):
            turn = 2 * math.pi * k / DIRECTIONS
            seen = (np.abs((angle - turn + math.pi) % (2 * math.pi) - math.pi) < math.radians(0.62 * fovy)) & (
                far > 0.9
            )
            score = float((seen / (1 + 0.25 * far)).sum())
            if score > best[0]:
                best = score, eye, turn
    _, eye, turn = best
    at = np.array([*eye, EYE_HEIGHT]) + 2.0 * np.array(
        [
            math.cos(turn) * math.cos(math.radians(TILT)),
            math.sin(turn) * math.cos(math.radians(TILT)),
            math.sin(math.radians(TILT)),
        ]
    )
    return FreeView(tuple(at.tolist()), 2.0, math.degrees(turn), TILT, fovy=fovy)


def standing_places(scene: Scene, room: str) -> Float[np.ndarray, "n 2"]:
    """Positions (m) in a room that keep clear of walls and tall furniture, at most 300."""
    rooms = scene.rooms
    assert rooms is not None
    mask, cells = rooms.room_map == rooms.names.index(room) + 1, _cells(scene, room)
    free = np.ones(len(cells), bool)
    for low, high, margin in _furniture(scene, room)[0]:
        if high[2] > ABOVE:
            free &= ((cells < low[:2] - margin) | (cells > high[:2] + margin)).any(axis=1)
    inside = _from_border(mask, rooms.resolution)[mask] > FROM_WALLS
    eyes = cells[free & inside] if (free & inside).any() else cells[inside] if inside.any() else cells
    return eyes[:: max(1, len(eyes) // 300)]


def _cells(scene: Scene, room: str) -> Float[np.ndarray, "n 2"]:
    """Middles of the cells of a room in the map of rooms, m."""
    rooms = scene.rooms
    assert rooms is not None
    rows, columns = np.nonzero(rooms.room_map == rooms.names.index(room) + 1)
    return (np.stack([columns, rows], 1) + 0.5 - rooms.room_map.shape[0] / 2) * rooms.resolution


def _furniture(scene: Scene, room: str) -> tuple[list[tuple[np.ndarray, np.ndarray, float]], np.ndarray]:
    """World boxes of objects of the home with the distance to keep from them, and the middles of fixed ones in the
    room."""
    data = scene.start_data()
    boxes, middles = [], []
    for entry in scene.manifest.objects:
        if not entry.in_household or entry.category in ("carpet", "window"):
            continue
        body = mujoco.mj_name2id(scene.model, mujoco.mjtObj.mjOBJ_BODY, entry.bodies[0])
        turn = data.xmat[body].reshape(3, 3)
        middle = data.xpos[body] + turn @ np.asarray(entry.base_link_offset)
        half = np.abs(turn) @ np.asarray(entry.bounding_box) / 2
        door = entry.category == "door"
        boxes.append((middle - half, middle + half, FROM_DOORS if door else FROM_WALLS))
        if entry.fixed and not door and room in entry.rooms:
            middles.append(middle[:2])
    return boxes, np.array(middles).reshape(-1, 2)


def _from_border(mask: np.ndarray, resolution: float) -> np.ndarray:
    """Distance in m of each cell of a mask from the nearest cell outside it, by steps along the axes."""
    found, rest = np.zeros(mask.shape), mask.copy()
    while rest.any():
        found[rest] += resolution
        inner = rest.copy()
        for axis in (0, 1):
            for way in (1, -1):
                inner &= np.roll(rest, way, axis)
        rest = inner
    return found
