"""A walk through a home: the home from above, then room after room from eye height, through open doors.

The camera walks over the free floor and looks along its way, or over the room in which it stands, unless a wall or
furniture would fill the image (`gaze`).
"""

from __future__ import annotations

import collections
import dataclasses
import math
import os
from collections.abc import Callable, Iterator, Sequence

import mujoco
import numpy as np
from jaxtyping import Bool, Float

from ig2mj.callbacks import ProgressCallback
from ig2mj.errors import Ig2mjError
from ig2mj.looks import visual_of
from ig2mj.scene.scene import Scene
from ig2mj.viewer.captions import caption
from ig2mj.viewer.gaze import plan_gaze
from ig2mj.viewer.offscreen import FreeView, render
from ig2mj.viewer.overview import home_overview
from ig2mj.viewer.room_views import EYE_HEIGHT, TILT, room_view
from ig2mj.viewer.sight_lines import SightLines
from ig2mj.viewer.video import FRAME_RATE, VIDEO_SIZE, VideoWriter

ABOVE, ABOVE_TURN, ABOVE_TILT = 2.5, 30.0, -52.0
"""s of the first shot, degrees by which the camera goes around meanwhile, and below the horizon."""

PAN, TURN_RATE = 75.0, 28.0
"""Degrees of each room that are seen by turning, and degrees in a second."""

SPEED, START, FIELD_OF_VIEW = 1.1, 0.8, 68.0
"""m/s of walking; s that starting and stopping take more; degrees, vertical."""

AHEAD = 1.2
"""m along the way to what a walker looks at."""

STATIONS = 6
"""Stations in a second for which a direction of view is chosen."""

WEIGHT_WAY, WEIGHT_ROOM = 2.0, 5.0
"""Cost in each second of looking 90 degrees off the way, and off what shows a room (see `gaze`)."""


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
    lines = SightLines(scene.model, through_glass=False)
    for stations in _walks(scene):
        yield from _looking_around(lines, data, stations, rate)


@dataclasses.dataclass(frozen=True)
class _Station:
    """A place (x, y, m) of the camera, which way it would look (azimuth, degrees), how much that matters, and the
    room's name."""

    eye: Float[np.ndarray, "2"]
    wish: float
    weight: float
    words: str


def _walks(scene: Scene) -> Iterator[list[_Station]]:
    """Stations of the camera, `STATIONS` in a second: a walk, and another one from each room to which no way leads."""
    stations: list[_Station] = []
    rooms = scene.rooms
    assert rooms is not None
    for name in _order(scene):
        view = room_view(scene, name, FIELD_OF_VIEW)
        eye, words = _eye(view), _title(name)
        way = path(scene, stations[-1].eye, eye) if stations else None
        if way is not None:
            stations += _walk(way, lambda at, words=words: _title(room) if (room := rooms.room_at(at)) else words)
        elif stations:
            yield stations
            stations = []
        count = round(PAN / TURN_RATE * STATIONS)
        for k in range(count):
            stations.append(_Station(eye, view.azimuth + PAN * (_eased(k / count) - 0.5), WEIGHT_ROOM, words))
    yield stations


def _walk(way: Float[np.ndarray, "n 2"], words: Callable[[np.ndarray], str]) -> list[_Station]:
    """Stations along a way (m), slow at both ends."""
    lengths = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(way, axis=0), axis=1))])
    total = float(lengths[-1])
    count = max(2, round((total / SPEED + START) * STATIONS))
    walked = []
    for k in range(count):
        at = total * _started(k / count, START * STATIONS / count)
        here, there = (_along(way, lengths, s) for s in (at, min(at + AHEAD, total)))
        if total - at < AHEAD:
            there = here + way[-1] - _along(way, lengths, total - AHEAD)
        wish = math.degrees(math.atan2(there[1] - here[1], there[0] - here[0]))
        walked.append(_Station(here, wish, WEIGHT_WAY, words(here)))
    return walked


def _along(way: Float[np.ndarray, "n 2"], lengths: Float[np.ndarray, "n"], at: float) -> Float[np.ndarray, "2"]:
    """The point (m) of a way at a length (m) from its start."""
    return np.array([np.interp(at, lengths, way[:, axis]) for axis in (0, 1)])


def _looking_around(
    lines: SightLines, data: mujoco.MjData, stations: Sequence[_Station], rate: float | int
) -> Iterator[Shot]:
    """The shots of a walk, `rate` in a second."""
    eyes = np.array([station.eye for station in stations])
    wide = 2 * math.degrees(math.atan(math.tan(math.radians(FIELD_OF_VIEW / 2)) * VIDEO_SIZE[0] / VIDEO_SIZE[1]))
    turns = plan_gaze(
        lines,
        data,
        np.concatenate([eyes, np.full((len(eyes), 1), EYE_HEIGHT)], axis=1),
        np.array([station.wish for station in stations]),
        np.array([station.weight for station in stations]),
        rate=STATIONS,
        field=wide,
    )
    times = np.arange(len(stations)) / STATIONS
    for time in np.arange(0.0, len(stations) / STATIONS, 1.0 / rate):
        eye = np.array([np.interp(time, times, eyes[:, axis]) for axis in (0, 1)])
        number = min(int(time * STATIONS), len(stations) - 1)
        yield Shot(_looking(eye, float(np.interp(time, times, turns))), stations[number].words)


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


def _started(share: float, part: float) -> float:
    """0..1: speed grows over the first `part` / 2 of the time and falls over the last."""
    part, near = min(part / 2, 0.5), min(share, 1 - share)
    gone = near * near / (2 * part) if near < part else near - part / 2
    return (gone if share < 0.5 else 1 - part - gone) / (1 - part)


def _eased(share: float) -> float:
    """0..1, slow at both ends."""
    return share * share * (3 - 2 * share)


def _title(room: str) -> str:
    """ "living_room_0" -> "living room"."""
    return room.rpartition("_")[0].replace("_", " ")
