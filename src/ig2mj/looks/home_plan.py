"""Walls, rooms, openings and furniture of a loaded home, as far as decoration needs them.

Faces of walls are read from the visual meshes of the home's walls: rectangles that stand upright along an axis. Walls
of other shapes are left as they are.
"""

from __future__ import annotations

import collections
import dataclasses
import math
import zlib
from collections.abc import Sequence

import mujoco
import numpy as np
from jaxtyping import Float

from ig2mj.scene.rooms import Rooms
from ig2mj.scene.scene import Scene

OUT, STEP, REVEAL = 0.12, 0.05, 0.26
"""m: how far before a face its room is looked up, and how densely along it; narrower faces are those of openings."""


SLIVER = 0.16
"""m: stretches of no room that are shorter belong to the room next to them."""

OFF_GRID = 0.000237
"""m added before coordinates are compared by millimetres: those of plans are multiples of half of one."""


Rectangle = tuple[np.ndarray, np.ndarray, int, int, int, tuple[int, int]]
"""Low and high corner [3], axis of its normal, the normal's sign, its geom, and two triangles of that geom's mesh."""


@dataclasses.dataclass(frozen=True)
class Face:
    """An upright rectangle of a wall.

    Attributes:
      room: whose wall it is; None outdoors, "" inside an opening.
      axis: 0 or 1, of its normal. sign: of its normal. at: coordinate along that axis, m.
      low, high: along the other axis, m. bottom, top: heights, m.
    """

    room: str | None
    axis: int
    sign: int
    at: float | int
    low: float | int
    high: float | int
    bottom: float | int
    top: float | int

    @property
    def turn(self) -> float:
        """Angle about the vertical that turns +y into its normal, rad."""
        return (0.0 if self.axis == 1 else -math.pi / 2) + (0.0 if self.sign > 0 else math.pi)

    def point(self, along: float | int, out: float | int, z: float | int) -> np.ndarray:
        """World position [3] of a point `out` m before the face."""
        pos = np.array([0.0, 0.0, z])
        pos[self.axis], pos[1 - self.axis] = self.at + self.sign * out, along
        return pos


@dataclasses.dataclass(frozen=True)
class Solid:
    """The world box of an object, m."""

    low: Float[np.ndarray, "3"]
    high: Float[np.ndarray, "3"]
    category: str
    name: str = ""
    rooms: tuple[str, ...] = ()
    fixed: bool = True

    @property
    def middle(self) -> np.ndarray:
        return (self.low + self.high) / 2


@dataclasses.dataclass(frozen=True)
class Opening:
    """A window or a door.

    Attributes:
      face: the wall that it is in, on the side of `room`. outside: whether the other side is outdoors.
    """

    solid: Solid
    face: Face
    outside: bool

    @property
    def along(self) -> tuple[float | int, float | int]:
        """Its edges along the wall, m."""
        k = 1 - self.face.axis
        return float(self.solid.low[k]), float(self.solid.high[k])


@dataclasses.dataclass(frozen=True)
class Room:
    """Attributes: low, high: corners of its free rectangle, m. seed: of its decoration."""

    name: str
    kind: str
    low: Float[np.ndarray, "2"]
    high: Float[np.ndarray, "2"]
    seed: int

    @property
    def middle(self) -> np.ndarray:
        return (self.low + self.high) / 2

    @property
    def size(self) -> np.ndarray:
        return self.high - self.low


@dataclasses.dataclass(frozen=True)
class HomePlan:
    """See the module's text. `floors`: low and high corner of each floor slab, its height, and its room or None."""

    name: str
    rooms: tuple[Room, ...]
    faces: tuple[Face, ...]
    floors: tuple[tuple[np.ndarray, np.ndarray, float | int, str | None], ...]
    solids: tuple[Solid, ...]
    windows: tuple[Opening, ...]
    doors: tuple[Opening, ...]
    height: float | int
    low: Float[np.ndarray, "2"]
    high: Float[np.ndarray, "2"]

    def room(self, name: str) -> Room:
        return next(room for room in self.rooms if room.name == name)

    def of_room(self, name: str | None) -> list[Face]:
        return [face for face in self.faces if face.room == name]


def read_plan(scene: Scene) -> HomePlan | None:
    """The plan of a home at its start; None where it has no maps of rooms, or no walls that are understood."""
    rooms = scene.rooms
    if rooms is None or not rooms.names:
        return None
    data = scene.start_data()
    uprights = _rectangles(scene, data, "walls", upright=True)
    if not uprights:
        return None
    faces = [piece for rectangle in uprights for piece in _by_room(rectangle, rooms)]
    faces.sort(key=lambda f: (f.room or "", f.axis, f.sign, f.at, f.low, f.bottom))
    height = float(np.median([f.top for f in faces if f.room] or [max(f.top for f in faces)]))
    floors = []
    for low, high, *_ in _rectangles(scene, data, "floors", upright=False):
        floors.append((low[:2], high[:2], float(high[2]), rooms.room_at((low + high)[:2] / 2)))
    found = tuple(_room(scene, rooms, name, kind) for name, kind in zip(rooms.names, rooms.types, strict=True))
    solids = tuple(_solids(scene, data))
    inside = [f for f in faces if f.room]
    corners = np.array([[*f.point(f.low, 0, 0)[:2], *f.point(f.high, 0, 0)[:2]] for f in faces]).reshape(-1, 2)
    return HomePlan(
        name=scene.name,
        rooms=found,
        faces=tuple(faces),
        floors=tuple(floors),
        solids=solids,
        windows=tuple(_openings(solids, inside, rooms, "window")),
        doors=tuple(_openings(solids, inside, rooms, "door")),
        height=height,
        low=corners.min(0),
        high=corners.max(0),
    )


def covered_triangles(scene: Scene) -> dict[int, np.ndarray]:
    """Geoms of walls and floors, and which of their triangles [F] lie behind what decoration puts on them."""
    rooms = scene.rooms
    if read_plan(scene) is None or rooms is None:
        return {}
    data, covered = scene.start_data(), dict[int, np.ndarray]()
    for upright in (True, False):
        for low, high, _, _, geom, triangles in _rectangles(scene, data, "walls" if upright else "floors", upright):
            if not upright and rooms.room_at((low + high)[:2] / 2) is None:
                continue
            count = int(scene.model.mesh_facenum[scene.model.geom_dataid[geom]])
            covered.setdefault(geom, np.zeros(count, bool))[list(triangles)] = True
    return covered


def seed_of(*names: str) -> int:
    """The same number for the same names, on every machine."""
    return zlib.crc32("/".join(names).encode())


def _rectangles(scene: Scene, data: mujoco.MjData, category: str, upright: bool) -> list[Rectangle]:
    """Rectangles in the visual meshes of a part of the building, upright ones or those that look up: faces along an
    axis that are two triangles."""
    model, tables = scene.model, scene.tables
    objects = [k for k, entry in enumerate(scene.manifest.objects) if entry.category == category]
    geoms = np.flatnonzero(np.isin(tables.geom_object, objects) & (model.geom_type == mujoco.mjtGeom.mjGEOM_MESH))
    found: list[Rectangle] = []
    for geom in geoms:
        if model.geom_group[geom] > 2 or (upright and model.geom_matid[geom] >= 0):
            continue
        mesh = int(model.geom_dataid[geom])
        first, count = int(model.mesh_faceadr[mesh]), int(model.mesh_facenum[mesh])
        start = int(model.mesh_vertadr[mesh])
        corners = model.mesh_vert[start + model.mesh_face[first : first + count]]
        corners = corners @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom]
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
        pairs: dict[tuple, list] = collections.defaultdict(list)
        for number, (triangle, n) in enumerate(zip(corners, normal, strict=True)):
            axis = int(np.argmax(np.abs(n)))
            if abs(n[axis]) < 0.999 or (axis == 2) == upright or (not upright and n[2] < 0):
                continue
            low, high = triangle.min(0), triangle.max(0)
            cells = np.floor((np.array([*low, *high]) + OFF_GRID) * 1000)
            pairs[axis, n[axis] > 0, tuple(cells)].append((low, high, number))
        for (axis, positive, _), members in pairs.items():
            if len(members) == 2:
                low, high, _ = members[0]
                triangles = members[0][2], members[1][2]
                found.append((low, high, axis, 1 if positive else -1, int(geom), triangles))
    return found


def _by_room(rectangle: Rectangle, rooms: Rooms) -> list[Face]:
    """The rectangle in pieces, each before one room."""
    low, high, axis, sign, _, _ = rectangle
    other = 1 - axis
    start, end = float(low[other]), float(high[other])
    if end - start < REVEAL:
        return [Face("", axis, sign, float(low[axis]), start, end, float(low[2]), float(high[2]))]
    steps = max(1, round((end - start) / STEP))
    edges = np.linspace(start, end, steps + 1)
    points = np.zeros((steps, 2))
    points[:, axis], points[:, other] = low[axis] + sign * OUT, (edges[1:] + edges[:-1]) / 2
    index = _without_slivers(rooms.index_at(points), (end - start) / steps)
    pieces, first = [], 0
    for k in range(1, steps + 1):
        if k == steps or index[k] != index[first]:
            room = rooms.names[index[first]] if index[first] >= 0 else None
            pieces.append(
                Face(
                    room,
                    axis,
                    sign,
                    float(low[axis]),
                    float(edges[first]),
                    float(edges[k]),
                    float(low[2]),
                    float(high[2]),
                )
            )
            first = k
    return pieces


def _without_slivers(index: np.ndarray, step: float | int) -> np.ndarray:
    """Rooms along a wall, in which short stretches of no room belong to the room next to them: maps are coarser than
    walls are."""
    index = index.copy()
    first = 0
    for k in range(1, len(index) + 1):
        if k == len(index) or index[k] != index[first]:
            if index[first] < 0 and (k - first) * step < SLIVER:
                near = index[first - 1] if first > 0 else index[k] if k < len(index) else -1
                index[first:k] = near
            first = k
    return index


def _room(scene: Scene, rooms: Rooms, name: str, kind: str) -> Room:
    rows, columns = np.nonzero(rooms.room_map == rooms.names.index(name) + 1)
    n = rooms.room_map.shape[0]
    low = (np.array([columns.min(), rows.min()]) - n / 2) * rooms.resolution if len(rows) else np.zeros(2)
    high = (np.array([columns.max() + 1, rows.max() + 1]) - n / 2) * rooms.resolution if len(rows) else np.zeros(2)
    return Room(name, kind, low, high, seed_of(scene.name, name))


def _solids(scene: Scene, data: mujoco.MjData) -> list[Solid]:
    found = []
    for entry in scene.manifest.objects:
        if not entry.in_household:
            continue
        body = mujoco.mj_name2id(scene.model, mujoco.mjtObj.mjOBJ_BODY, entry.bodies[0])
        turn = data.xmat[body].reshape(3, 3)
        middle = data.xpos[body] + turn @ np.asarray(entry.base_link_offset)
        half = np.abs(turn) @ np.asarray(entry.bounding_box) / 2
        found.append(Solid(middle - half, middle + half, entry.category, entry.name, tuple(entry.rooms), entry.fixed))
    return found


def _openings(solids: Sequence[Solid], faces: list[Face], rooms: Rooms, category: str) -> list[Opening]:
    """Windows or doors, once for each room on whose wall they are."""
    found = []
    for solid in (s for s in solids if s.category == category):
        size = solid.high - solid.low
        axis = int(np.argmin(size[:2]))
        for sign in (1, -1):
            before = solid.middle[:2].copy()
            before[axis] += sign * 0.35
            room = rooms.room_at(before)
            if room is None:
                continue
            behind = solid.middle[:2].copy()
            behind[axis] -= sign * 0.5
            near = [
                f
                for f in faces
                if f.room == room and f.axis == axis and f.sign == sign and abs(f.at - solid.middle[axis]) < 0.35
            ]
            if near:
                at = min(near, key=lambda f: abs(f.at - solid.middle[axis])).at
                k = 1 - axis
                face = Face(
                    room,
                    axis,
                    sign,
                    at,
                    float(solid.low[k]),
                    float(solid.high[k]),
                    float(solid.low[2]),
                    float(solid.high[2]),
                )
                found.append(Opening(solid, face, rooms.room_at(behind) is None))
    return found


def spans(
    plan: HomePlan,
    room: str,
    bottom: float | int,
    top: float | int,
    depth: float | int,
    margin: float | int = 0.05,
    taken: Sequence[Solid] = (),
) -> list[Face]:
    """Stretches of a room's walls that are free between two heights, as far as `depth` m before them."""
    rows: dict[tuple, list[Face]] = collections.defaultdict(list)
    for face in plan.of_room(room):
        if face.bottom <= bottom + 0.02 and face.top >= top - 0.02:
            rows[face.axis, face.sign, round(face.at, 3)].append(face)
    found = []
    for (axis, sign, _), pieces in rows.items():
        pieces.sort(key=lambda f: f.low)
        merged = [[pieces[0].low, pieces[0].high]]
        for piece in pieces[1:]:
            if piece.low <= merged[-1][1] + 0.02:
                merged[-1][1] = max(merged[-1][1], piece.high)
            else:
                merged.append([piece.low, piece.high])
        at = pieces[0].at
        near, far = sorted((at, at + sign * depth))
        blocked = [
            (float(s.low[1 - axis]) - margin, float(s.high[1 - axis]) + margin)
            for s in (*plan.solids, *taken)
            if s.high[axis] > near - 0.02
            and s.low[axis] < far
            and s.high[2] > bottom
            and s.low[2] < top
            and s.category != "carpet"
        ]
        for low, high in merged:
            for a, b in _without(low + 0.03, high - 0.03, blocked):
                found.append(Face(room, axis, sign, at, a, b, bottom, top))
    return found


def _without(
    low: float | int, high: float | int, blocked: list[tuple[float | int, float | int]]
) -> list[tuple[float | int, float | int]]:
    """What is left of an interval."""
    left = [(low, high)]
    for a, b in blocked:
        left = [piece for x, y in left for piece in ((x, min(y, a)), (max(x, b), y)) if piece[1] - piece[0] > 1e-6]
    return left
