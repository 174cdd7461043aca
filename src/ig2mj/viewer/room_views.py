"""Views into rooms from the eye height of a person who stands in them."""

from __future__ import annotations

import math

import mujoco
import numpy as np
from jaxtyping import Float

from ig2mj.errors import UnknownNameError
from ig2mj.scene.scene import Scene
from ig2mj.viewer.gaze import DIRECTIONS as NEARNESS_DIRECTIONS
from ig2mj.viewer.gaze import nearness
from ig2mj.viewer.offscreen import FreeView
from ig2mj.viewer.sight_lines import SightLines

EYE_HEIGHT, FIELD_OF_VIEW, TILT = 1.55, 70.0, -13.0
"""m above the floor; degrees, vertical; degrees below the horizon."""

FROM_WALLS, ABOVE = 0.42, 0.55
"""m that the eye keeps from walls and furniture; what is lower than `ABOVE` the floor does not block the view."""

FROM_DOORS = 0.75
"""m that the eye keeps from doors, which may be opened."""

DIRECTIONS = 24
"""Directions of view that are tried, around the circle."""

PER_METRE = 8.0
"""Points on the floor that a metre of a piece of furniture (its diagonal, 1 to 4 m) is worth."""

CANDIDATES, OPEN = 32, 1.0
"""Positions whose views are compared by what is near, and the power of the share of an image that is not near."""


def room_view(scene: Scene, room: str, fovy: float = FIELD_OF_VIEW) -> FreeView:
    """Where a person stands who wants to see most of a room.

    Of the positions in the room that keep clear of walls and tall furniture, and of directions around the circle, the
    pair is taken in whose image most of the room's furniture and most of its floor lie, and little of which
    is filled by what is near.

    Raises UnknownNameError: the scene has no such room.
    """
    rooms = scene.rooms
    if rooms is None or room not in rooms.names:
        raise UnknownNameError("room", room, rooms.names if rooms is not None else ())
    cells, (_, targets, sizes) = _cells(scene, room), _furniture(scene, room)
    eyes = standing_places(scene, room)
    points = np.concatenate(
        [
            cells[:: max(1, len(cells) // 200)],
            np.repeat(targets, np.round(PER_METRE * np.clip(sizes, 1.0, 4.0)).astype(int), axis=0),
        ]
    )
    offset = points[None] - eyes[:, None]
    far, angle = np.linalg.norm(offset, axis=2), np.arctan2(offset[..., 1], offset[..., 0])
    turns = 2 * math.pi * np.arange(DIRECTIONS) / DIRECTIONS
    weight = np.where(far > 0.9, 1 / (1 + 0.25 * far), 0.0)
    scores = np.stack(
        [
            (weight * (np.abs((angle - turn + math.pi) % (2 * math.pi) - math.pi) < math.radians(0.62 * fovy))).sum(1)
            for turn in turns
        ],
        axis=1,
    )
    looked = np.argsort(-scores.max(axis=1), kind="stable")[:CANDIDATES]
    stands = np.concatenate([eyes[looked], np.full((len(looked), 1), EYE_HEIGHT)], axis=1)
    lines, skipped = SightLines(scene.model, through_glass=False), NEARNESS_DIRECTIONS // DIRECTIONS
    near = nearness(lines, scene.start_data(), stands, 1.3 * fovy)[:, ::skipped]
    best, k = np.unravel_index(int(np.argmax(scores[looked] * (1.0 - near) ** OPEN)), near.shape)
    eye, turn = eyes[looked[best]], float(turns[k])
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


def _furniture(scene: Scene, room: str) -> tuple[list[tuple[np.ndarray, np.ndarray, float]], np.ndarray, np.ndarray]:
    """World boxes of objects of the home with the distance to keep from them; of fixed ones in the room the middles
    [n, 2] and the diagonals [n], m."""
    data = scene.start_data()
    boxes, middles, sizes = [], [], []
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
            sizes.append(2 * float(np.linalg.norm(half)))
    return boxes, np.array(middles).reshape(-1, 2), np.array(sizes)


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
