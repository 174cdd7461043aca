"""A walk through a home: the home from above, then room after room from eye height, through open doors."""

from __future__ import annotations

import collections
import dataclasses
import math
import os
from collections.abc import Iterator, Sequence

import mujoco
import numpy as np
from jaxtyping import Bool, Float

from ig2mj.callbacks import ProgressCallback
from ig2mj.errors import Ig2mjError
from ig2mj.looks import visual_of
from ig2mj.scene.scene import Scene
from ig2mj.viewer.captions import caption
from ig2mj.viewer.offscreen import FreeView, render
from ig2mj.viewer.overview import home_overview
from ig2mj.viewer.room_views import EYE_HEIGHT, TILT, room_view
from ig2mj.viewer.video import FRAME_RATE, VIDEO_SIZE, VideoWriter

ABOVE, ABOVE_TURN, ABOVE_TILT = 2.5, 30.0, -52.0
"""s of the first shot, degrees by which the camera goes around meanwhile, and below the horizon."""

PAN, TURN_RATE = 75.0, 28.0
"""Degrees of each room that are seen by turning, and degrees in a second."""

SPEED, FIELD_OF_VIEW = 1.1, 68.0
"""m/s of walking; degrees, vertical."""

AHEAD = 0.9
"""m along the way to what a walker looks at."""


@dataclasses.dataclass(frozen=True)
class Shot:
    """One frame: a camera, and what is written."""

    view: FreeView
    words: str


def film_tour(
    scene: Scene,
    file: str | os.PathLike,
    *,
    size: tuple[int, int] = VIDEO_SIZE,
    rate: float | int = FRAME_RATE,
    progress: ProgressCallback | None = None,
) -> int:
    """Writes a walk through a home as a video and returns the number of frames.

    Args:
      file: its ending says the format (.mp4, .gif, .webp). size: pixels, width and height. rate: frames in a second.

    Raises:
      Ig2mjError: the home has no map of rooms. MissingDependencyError: nothing can draw here, or there is no ffmpeg.
      InputError: another ending. EngineError: ffmpeg cannot write the file.
    """
    data = scene.start_data()
    open_doors(scene, data)
    shots = list(tour(scene, data, rate))
    visual = visual_of(scene)
    seen = visual.data(scene.model, data)
    with VideoWriter(file, *size, rate) as video:
        for number, shot in enumerate(shots):
            if progress is not None:
                progress(number, len(shots), shot.words)
            video.add(caption(render(visual.model, seen, shot.view, width=size[0], height=size[1]), shot.words))
    return len(shots)


def open_doors(scene: Scene, data: mujoco.MjData) -> None:
    """Opens the doors of a home in `data`."""
    for entry in scene.manifest.objects:
        for opening in entry.openable if entry.category == "door" else ():
            joint = mujoco.mj_name2id(scene.model, mujoco.mjtObj.mjOBJ_JOINT, opening.joint)
            data.qpos[scene.model.jnt_qposadr[joint]] = opening.closed + 0.9 * (opening.open - opening.closed)
    mujoco.mj_forward(scene.model, data)


def tour(scene: Scene, data: mujoco.MjData, rate: float | int = FRAME_RATE) -> Iterator[Shot]:
    """The shots of a walk, `rate` of them in a second. Raises Ig2mjError: the home has no map of rooms."""
    rooms = scene.rooms
    if rooms is None or not rooms.names:
        raise Ig2mjError(f"{scene.name} has no map of rooms: there is nothing to walk through")
    count = round(ABOVE * rate)
    for k in range(count):
        turn = 90.0 + ABOVE_TURN * (k / count - 0.5)
        yield Shot(home_overview(scene, data, azimuth=turn, elevation=ABOVE_TILT), scene.name)
    views = [(name, room_view(scene, name, FIELD_OF_VIEW)) for name in _order(scene)]
    for number, (name, view) in enumerate(views):
        words, eye = _title(name), _eye(view)
        steps = round(PAN / TURN_RATE * rate)
        for k in range(steps):
            turn = view.azimuth + PAN * (_eased(k / steps) - 0.5)
            yield Shot(_looking(eye, turn), words)
        if number + 1 < len(views):
            last = view.azimuth + PAN / 2
            yield from _walk(scene, eye, last, views[number + 1], rate)


def _walk(
    scene: Scene, start: Float[np.ndarray, "2"], turn: float, target: tuple[str, FreeView], rate: float | int
) -> Iterator[Shot]:
    """From one place to where the next room is seen from; nothing where no way leads there."""
    name, view = target
    way = path(scene, start, _eye(view))
    if way is None:
        return
    lengths = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(way, axis=0), axis=1))])
    total = float(lengths[-1])
    steps = max(2, round(total / SPEED * rate))
    first = view.azimuth - PAN / 2
    rooms = scene.rooms
    assert rooms is not None
    for k in range(steps):
        at = total * k / steps
        here = np.array([np.interp(at, lengths, way[:, axis]) for axis in (0, 1)])
        far = min(at + AHEAD, total)
        there = np.array([np.interp(far, lengths, way[:, axis]) for axis in (0, 1)])
        if total - at < AHEAD:
            wished = first
        else:
            wished = math.degrees(math.atan2(there[1] - here[1], there[0] - here[0]))
        change = (wished - turn + 180.0) % 360.0 - 180.0
        turn += float(np.clip(0.12 * change, -110.0 / rate, 110.0 / rate))
        yield Shot(_looking(here, turn), _title(rooms.room_at(here) or name))
    while abs(change := (first - turn + 180.0) % 360.0 - 180.0) > 1.0:
        turn += float(np.clip(0.2 * change, -90.0 / rate, 90.0 / rate)) + math.copysign(0.2, change)
        yield Shot(_looking(_eye(view), turn), _title(name))


def path(scene: Scene, start: Float[np.ndarray, "2"], end: Float[np.ndarray, "2"]) -> Float[np.ndarray, "n 2"] | None:
    """A way over the floor of a home between two points (m), smoothed; None where there is none."""
    rooms = scene.rooms
    if rooms is None or rooms.traversable is None:
        return None
    free, step = rooms.traversable, rooms.trav_resolution
    half = free.shape[0] / 2
    cost = 1.0 + 6.0 * np.exp(-_clearance(free) * step / 0.25)
    ends = [_nearest(free, np.asarray(p) / step + half) for p in (start, end)]
    found = _cheapest(free, cost, *ends)
    if found is None:
        return None
    points = (np.array([(c + 0.5, r + 0.5) for r, c in found]) - half) * step
    points = np.concatenate([[start], points, [end]])
    for _ in range(12):
        points[1:-1] = 0.25 * points[:-2] + 0.5 * points[1:-1] + 0.25 * points[2:]
    return points


def _cheapest(
    free: Bool[np.ndarray, "n n"], cost: np.ndarray, start: tuple[int, int], end: tuple[int, int]
) -> list[tuple[int, int]] | None:
    """Cells (row, column) from start to end, by Dijkstra's algorithm."""
    import heapq

    best, before = {start: 0.0}, dict[tuple[int, int], tuple[int, int]]()
    queue = [(0.0, start)]
    while queue:
        so_far, cell = heapq.heappop(queue)
        if cell == end:
            way = [cell]
            while cell in before:
                cell = before[cell]
                way.append(cell)
            return way[::-1]
        if so_far > best[cell]:
            continue
        for dr, dc in ((0, 1), (1, 0), (0, -1), (-1, 0), (1, 1), (1, -1), (-1, 1), (-1, -1)):
            r, c = cell[0] + dr, cell[1] + dc
            if not (0 <= r < free.shape[0] and 0 <= c < free.shape[1]) or not free[r, c]:
                continue
            new = so_far + float(cost[r, c]) * math.hypot(dr, dc)
            if new < best.get((r, c), math.inf):
                best[r, c], before[r, c] = new, cell
                heapq.heappush(queue, (new, (r, c)))
    return None


def _clearance(free: Bool[np.ndarray, "n n"]) -> np.ndarray:
    """Steps from each cell to the nearest one that is not free."""
    found, rest = np.zeros(free.shape), free.copy()
    while rest.any():
        found[rest] += 1
        inner = rest.copy()
        for axis in (0, 1):
            for way in (1, -1):
                inner &= np.roll(rest, way, axis)
        rest = inner
    return found


def _nearest(free: np.ndarray, place: np.ndarray) -> tuple[int, int]:
    """The free cell (row, column) nearest to a place (x, y) in cells."""
    rows, columns = np.nonzero(free)
    k = int(np.argmin((columns - place[0]) ** 2 + (rows - place[1]) ** 2))
    return int(rows[k]), int(columns[k])


def _order(scene: Scene) -> Sequence[str]:
    """Rooms, the nearest one next each time, from the lobby or the corridor on."""
    rooms = scene.rooms
    assert rooms is not None
    middles = {}
    for k, name in enumerate(rooms.names):
        r, c = np.nonzero(rooms.room_map == k + 1)
        if len(r):
            middles[name] = np.array([c.mean(), r.mean()])
    ranks = collections.defaultdict(lambda: 2, lobby=0, corridor=0, living_room=1)
    kinds = dict(zip(rooms.names, rooms.types, strict=True))
    left = sorted(middles, key=lambda name: (ranks[kinds[name]], name))
    order = [left.pop(0)]
    while left:
        here = middles[order[-1]]
        left.sort(key=lambda name: float(np.linalg.norm(middles[name] - here)))
        order.append(left.pop(0))
    return order


def _eye(view: FreeView) -> Float[np.ndarray, "2"]:
    """Where the camera of a view stands, on the floor."""
    level, turn = math.cos(math.radians(view.elevation)), math.radians(view.azimuth)
    return np.asarray(view.lookat[:2], float) - view.distance * level * np.array([math.cos(turn), math.sin(turn)])


def _looking(eye: np.ndarray, turn: float) -> FreeView:
    """From the eye height of a person at a place on the floor."""
    tilt, way = math.radians(TILT), math.radians(turn)
    ahead = np.array([math.cos(tilt) * math.cos(way), math.cos(tilt) * math.sin(way), math.sin(tilt)])
    at = np.array([*eye, EYE_HEIGHT]) + ahead
    return FreeView(tuple(at.tolist()), 1.0, turn, TILT, fovy=FIELD_OF_VIEW)


def _eased(share: float) -> float:
    """0..1, slow at both ends."""
    return share * share * (3 - 2 * share)


def _title(room: str) -> str:
    """ "living_room_0" -> "living room"."""
    return room.rpartition("_")[0].replace("_", " ")
