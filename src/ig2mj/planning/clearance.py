"""How far points are from the collision pieces of a household, and straight ways of a hand between them.

A hand is some spheres, and what it holds some points. The distance to a convex piece is that to the farthest of its
planes, which is exact in front of a face and too small in front of an edge: a way that is found is free.

Axes: K pieces, N planes, M points.
"""

from __future__ import annotations

import copy
import dataclasses
import functools
import itertools
from collections.abc import Callable, Collection, Sequence

import numpy as np
from jaxtyping import Bool, Float, Int

from ig2mj.engine.view import PhysicsView
from ig2mj.geometry.poses import matrices_on_host
from ig2mj.scene.scene import Scene
from ig2mj.scene.tables import PieceKind, SceneTables

HELD = 0.02
"""m: smaller spheres are points of what a hand holds, larger ones parts of the hand."""

FAR = 0.3
"""m from a point beyond which pieces are not looked at: the distance is then this at least."""

STEP = 0.03
"""m between the points of a way at which it is checked."""

CORE = 0.01
"""m from a point of a hand within which it is in something, and between places of a line of which that is asked."""

LIFTS = (0.1, 0.25, 0.45)
"""m above start and goal at which a hand goes across where the straight way is blocked."""

LEVEL = 1e-12
"""Share of a direction along an axis below which it is at right angles to it."""

FACES, FIRST = 6, 8
"""Planes of a box, which most pieces are: those of others that come after these are looked at last. Spheres of a hand
that are looked at first at each of many places: where these meet something, the others need not be."""


@functools.lru_cache(maxsize=4)
def _planes(tables: SceneTables) -> Float[np.ndarray, "K N 4"]:
    """Half-spaces of all pieces in the frames of their bodies; a round piece has those of its box."""
    count = max(6, tables.piece_planes.shape[1])
    planes = np.tile(np.array([0.0, 0.0, 0.0, 1.0]), (len(tables.piece_geom), count, 1))
    planes[:, : tables.piece_planes.shape[1]] = tables.piece_planes
    sides = np.concatenate([np.eye(3), -np.eye(3)])
    for k in np.flatnonzero(tables.piece_kind != PieceKind.POLYHEDRON):
        planes[k] = (0.0, 0.0, 0.0, 1.0)
        planes[k, :6, :3], planes[k, :6, 3] = sides, (tables.piece_vertices[k] @ sides.T).max(0)
    turn = matrices_on_host(tables.piece_quat)
    normal = np.einsum("kij,knj->kni", turn, planes[..., :3])
    return np.concatenate([normal, planes[..., 3:] + np.einsum("kni,ki->kn", normal, tables.piece_pos)[..., None]], -1)


@functools.lru_cache(maxsize=4)
def _has_more(tables: SceneTables) -> Bool[np.ndarray, "K"]:
    """Pieces with more planes than a box."""
    return np.any(_planes(tables)[:, FACES:, :3] != 0.0, axis=(1, 2))


@functools.lru_cache(maxsize=4)
def _corners(tables: SceneTables) -> Float[np.ndarray, "K V 3"]:
    """Vertices of all pieces in the frames of their bodies."""
    own = matrices_on_host(tables.piece_quat)
    return np.einsum("kij,kvj->kvi", own, tables.piece_vertices) + tables.piece_pos[:, None]


@dataclasses.dataclass(frozen=True, eq=False)
class _Placed:
    """Pieces of one world: half-spaces and boxes, world frame; `pose` of each body when they were placed.

    Attributes:
      bounds: `low` and -`high` of each, one row for each axis: boxes are compared most often.
    """

    pose: Float[np.ndarray, "B 7"]
    normal: Float[np.ndarray, "K N 3"]
    offset: Float[np.ndarray, "K N"]
    low: Float[np.ndarray, "K 3"]
    high: Float[np.ndarray, "K 3"]
    bounds: Float[np.ndarray, "6 K"]


class PlacedPieces:
    """The pieces of the worlds of one scene where they were last asked for; only what has moved is placed again."""

    def __init__(self, scene: Scene):
        self._tables = scene.tables
        self._of_world: dict[int, _Placed] = {}

    def of(self, view: PhysicsView, world: int) -> _Placed:
        """The pieces of a world as they are in a view."""
        pos, quat = (np.asarray(a)[world].astype(float) for a in (view.body_pos, view.body_quat))
        pose = np.concatenate([pos, quat], axis=1)
        tables, old = self._tables, self._of_world.get(world)
        body = tables.piece_body
        moved = np.arange(len(body)) if old is None else np.flatnonzero((pose != old.pose).any(1)[body])
        if old is not None and not len(moved):
            return old
        turn, where = matrices_on_host(quat[body[moved]]), pos[body[moved]]
        planes = _planes(tables)[moved]
        normal = np.einsum("kij,knj->kni", turn, planes[..., :3])
        # A plane (0, 0, 0, 1) is padding: its distance is -1, which never is the largest.
        offset = planes[..., 3] + np.einsum("kni,ki->kn", normal, where)
        corners = np.einsum("kij,kvj->kvi", turn, _corners(tables)[moved]) + where[:, None]
        new = normal, offset, corners.min(1), corners.max(1)
        if old is not None:
            kept = [a.copy() for a in (old.normal, old.offset, old.low, old.high)]
            for whole, part in zip(kept, new, strict=True):
                whole[moved] = part
            new = kept
        normal, offset, low, high = new
        bounds = np.ascontiguousarray(np.concatenate([low, -high], axis=1).T)
        self._of_world[world] = placed = _Placed(pose, normal, offset, low, high, bounds)
        return placed


class Obstacles:
    """The pieces of one world, but for those of some objects."""

    def __init__(
        self,
        scene: Scene,
        view: PhysicsView,
        world: int = 0,
        without: Collection[int] = (),
        pieces: PlacedPieces | None = None,
    ):
        """
        Args:
          without: numbers of objects. pieces: of the scene, asked before; None: all are placed now.
        """
        placed = (pieces or PlacedPieces(scene)).of(view, world)
        self.objects, self._bodies = scene.tables.piece_object, scene.tables.piece_body
        self._keep = (self.objects >= 0) & ~np.isin(self.objects, list(without))
        self._body: tuple[float, ...] | None = None
        self._carried = np.zeros((0, 4))
        self._normal, self._offset, self._low, self._high = placed.normal, placed.offset, placed.low, placed.high
        self._bounds, self._more = placed.bounds, _has_more(scene.tables)

    def _near(self, low: Float[np.ndarray, "3"], high: Float[np.ndarray, "3"]) -> Int[np.ndarray, "n"]:
        """Numbers of pieces whose boxes meet a box."""
        meets = (self._bounds <= np.concatenate([high, -low])[:, None]).all(0)
        return np.flatnonzero(meets & self._keep)

    def _carried_near(self, low: Float[np.ndarray, "3"], high: Float[np.ndarray, "3"]) -> Float[np.ndarray, "n 4"]:
        """Spheres of what other hands hold whose boxes meet a box."""
        if not len(self._carried):
            return self._carried
        centre, radius = self._carried[:, :3], self._carried[:, 3:]
        return self._carried[((centre - radius <= high) & (centre + radius >= low)).all(1)]

    def _pairs(
        self, boxes: Float[np.ndarray, "6 N"], near: Int[np.ndarray, "n"]
    ) -> tuple[Int[np.ndarray, "m"], Int[np.ndarray, "m"]]:
        """Boxes (rows as those of `_Placed.bounds`) and pieces, of some, that overlap."""
        limit = -self._bounds[:, near][[3, 4, 5, 0, 1, 2]]
        box, piece = np.nonzero((boxes[:, :, None] < limit[:, None]).all(0))
        return box, near[piece]

    def within(self, low: Float[np.ndarray, "3"], high: Float[np.ndarray, "3"]) -> Obstacles:
        """Those pieces alone whose boxes meet a box, m: for many questions about the same place."""
        other, near = copy.copy(self), self._near(low, high)
        other.objects, other._bodies, other._keep = self.objects[near], self._bodies[near], self._keep[near]
        other._normal, other._offset, other._more = self._normal[near], self._offset[near], self._more[near]
        other._low, other._high, other._bounds = self._low[near], self._high[near], self._bounds[:, near]
        return other

    def distance(self, points: Float[np.ndarray, "*M 3"]) -> Float[np.ndarray, "*M"]:
        """m from points to the nearest piece, at most `FAR`; negative inside."""
        if not points.size:
            return np.zeros(points.shape[:-1])
        every = points.reshape(-1, 3)
        near = self._near(every.min(0) - FAR, every.max(0) + FAR)
        if not len(near):
            return np.full(points.shape[:-1], FAR)
        found = np.full(len(every), FAR)
        for more, planes in ((False, FACES), (True, self._normal.shape[1])):
            some = near[self._more[near] == more]
            if len(some):
                away = np.einsum("kni,pi->pkn", self._normal[some, :planes], every) - self._offset[some, :planes]
                found = np.minimum(found, away.max(-1).min(-1))
        return found.reshape(points.shape[:-1])

    def about(self, axis: Sequence[float] | np.ndarray, radius: float, height: float) -> Obstacles:
        """The same with the upright body of a robot at x and y, up to a height, all m. Only what it holds keeps clear
        of it, which are spheres smaller than `HELD`: its hands pass through it."""
        other = copy.copy(self)
        other._body = (*(float(v) for v in axis), radius, height)
        return other

    def with_carried(self, carried: Float[np.ndarray, "n 4"]) -> Obstacles:
        """The same with spheres (x, y, z, radius; m) of what a robot's other hands hold."""
        other = copy.copy(self)
        other._carried = carried
        return other

    def clear(self, spheres: Float[np.ndarray, "M 4"]) -> bool:
        """Whether no sphere (x, y, z, radius) enters a piece; there may be none: what was held was lost."""
        return not self._enters(spheres[:, :3], spheres[:, 3]).any()

    def clear_at(
        self, spheres: Float[np.ndarray, "S 4"], points: Float[np.ndarray, "M 3"], together: int = 64
    ) -> Bool[np.ndarray, "M"]:
        """At which points spheres (x, y, z from the point; radius) enter no piece: `clear` for each of many places.

        Args:
          together: points that are looked at at once.
        """
        found = np.ones(len(points), bool)
        for some in (spheres[:FIRST], spheres[FIRST:]):
            left = np.flatnonzero(found)
            for first in range(0, len(left), together) if len(some) else ():
                part = left[first : first + together]
                centre = (points[part, None] + some[None, :, :3]).reshape(-1, 3)
                bad = self._enters(centre, np.tile(some[:, 3], len(part)))
                found[part] = ~bad.reshape(len(part), -1).any(1)
        return found

    def clear_along(
        self,
        spheres: Float[np.ndarray, "S 4"],
        start: np.ndarray,
        ahead: Float[np.ndarray, "3"],
        along: Float[np.ndarray, "T"],
    ) -> bool:
        """Whether spheres (x, y, z from a point; radius) enter no piece, with the point at some places of a line.

        Each sphere is in a piece between two places of the line, which follow from the piece's planes; one of the
        places asked about lies between them, or none does.

        Args:
          start, ahead: a point of the line, m, and its direction, a unit vector. along: m from `start`, ascending.
        """
        if not len(spheres):
            return True
        centre, radius = spheres[:, :3] + start, spheres[:, 3]

        def meets(first: np.ndarray, last: np.ndarray) -> Bool[np.ndarray, "*n"]:
            at = along[np.minimum(np.searchsorted(along, first, side="right"), len(along) - 1)]
            return (first < at) & (at < last)

        if self._body is not None and (held := np.flatnonzero(radius < HELD)).size:
            x, y, wide, high = self._body
            first, last = _within(centre[held, :2] - (x, y), ahead[:2], wide + radius[held])
            below = _where_negative(centre[held, 2] - high, ahead[2])
            if meets(np.maximum(first, below[0]), np.minimum(last, below[1])).any():
                return False
        ends = np.outer((along[0], along[-1]), ahead)
        bottom, top = centre - radius[:, None], centre + radius[:, None]
        swept = np.ascontiguousarray(np.concatenate([bottom + ends.min(0), -(top + ends.max(0))], axis=1).T)
        corners = swept.min(1)
        carried = self._carried_near(corners[:3], -corners[3:])
        if len(carried):
            offset = centre[:, None] - carried[:, :3]
            if meets(*_within(offset, ahead, radius[:, None] + carried[:, 3])).any():
                return False
        near = self._near(corners[:3], -corners[3:])
        if not len(near):
            return True
        sphere, piece = self._pairs(swept, near)
        first, last = np.full(len(sphere), -np.inf), np.full(len(sphere), np.inf)
        for axis in range(3):  # where the boxes of spheres and pieces meet
            enters, leaves = self._low[piece, axis] - top[sphere, axis], self._high[piece, axis] - bottom[sphere, axis]
            if abs(ahead[axis]) < LEVEL:
                last[(enters >= 0.0) | (leaves <= 0.0)] = -np.inf
                continue
            enters, leaves = (enters / ahead[axis], leaves / ahead[axis])[:: 1 if ahead[axis] > 0.0 else -1]
            first, last = np.maximum(first, enters), np.minimum(last, leaves)
        some = meets(first, last)
        first, last, sphere, piece = first[some], last[some], sphere[some], piece[some]
        for planes in (slice(FACES), slice(FACES, None)):
            if not len(sphere):
                break
            normal = self._normal[piece, planes]
            away = np.einsum("pni,pi->pn", normal, centre[sphere]) - self._offset[piece, planes]
            begins, ends = _where_negative(away - radius[sphere, None], normal @ ahead)
            first = np.maximum(first, begins.max(-1, initial=-np.inf))
            last = np.minimum(last, ends.min(-1, initial=np.inf))
            inside = meets(first, last)
            if inside.any() and (~self._more[piece[inside]]).any():
                return False
            first, last, sphere, piece = first[inside], last[inside], sphere[inside], piece[inside]
        return not len(sphere)

    def _enters(self, centre: Float[np.ndarray, "N 3"], radius: Float[np.ndarray, "N"]) -> Bool[np.ndarray, "N"]:
        """Which spheres enter a piece, or the body."""
        bad = np.zeros(len(centre), bool)
        if not len(centre):
            return bad
        if self._body is not None:
            x, y, wide, high = self._body
            held = (radius < HELD) & (centre[:, 2] < high)
            bad |= held & (np.hypot(centre[:, 0] - x, centre[:, 1] - y) < wide + radius)
        middle = np.ascontiguousarray(centre.T)
        box = np.concatenate([middle - radius, -(middle + radius)])  # as `_Placed.bounds`
        ends = box.min(1)
        carried = self._carried_near(ends[:3], -ends[3:])
        if len(carried):
            apart = np.linalg.norm(centre[:, None] - carried[:, :3], axis=-1)
            bad |= (apart < radius[:, None] + carried[:, 3]).any(1)
        near = self._near(ends[:3], -ends[3:])
        if not len(near):
            return bad
        sphere, piece = self._pairs(box, near)
        for planes in (slice(FACES), slice(FACES, None)):
            if not len(sphere):
                break
            away = np.einsum("pni,pi->pn", self._normal[piece, planes], centre[sphere]) - self._offset[piece, planes]
            inside = away.max(-1, initial=-1.0) < radius[sphere]
            sphere, piece = sphere[inside], piece[inside]
            more = self._more[piece]
            bad[sphere if planes.start else sphere[~more]] = True
            sphere, piece = sphere[more], piece[more]
        return bad

    def entries(
        self, origins: Float[np.ndarray, "R 3"], directions: Float[np.ndarray, "R 3"], of: int, body: int | None = None
    ) -> Float[np.ndarray, "R"]:
        """m along rays (unit vectors) to where each enters the first piece of an object, or of one body; infinite: it
        meets none."""
        mine = np.flatnonzero((self.objects == of) & (True if body is None else self._bodies == body))
        return self._entered(origins, directions, mine)

    def stand_between(
        self, origins: Float[np.ndarray, "R 3"], point: Float[np.ndarray, "3"], of: Collection[int], spare: float
    ) -> Bool[np.ndarray, "R"]:
        """Whether pieces of some objects are on the lines from origins to a point, up to `spare` (m) before it."""
        low, high = np.minimum(origins.min(0), point), np.maximum(origins.max(0), point)
        near = ((self._low <= high) & (self._high >= low)).all(1)
        mine = np.flatnonzero(near & np.isin(self.objects, list(of)))
        if not len(mine):
            return np.zeros(len(origins), bool)
        apart = np.linalg.norm(point - origins, axis=1)
        ways = (point - origins) / np.maximum(apart, 1e-9)[:, None]
        return self._entered(origins, ways, mine) < apart - spare

    def _entered(
        self, origins: Float[np.ndarray, "R 3"], directions: Float[np.ndarray, "R 3"], mine: Int[np.ndarray, "n"]
    ) -> Float[np.ndarray, "R"]:
        """m along rays to where each enters the first of some pieces."""
        slope = np.einsum("kni,ri->rkn", self._normal[mine], directions)
        left = self._offset[mine] - np.einsum("kni,ri->rkn", self._normal[mine], origins)
        with np.errstate(divide="ignore", invalid="ignore"):
            at = left / slope
        first = np.where(slope < -1e-9, at, -np.inf).max(-1, initial=-np.inf)
        last = np.where(slope > 1e-9, at, np.inf).min(-1, initial=np.inf)
        outside = ((np.abs(slope) <= 1e-9) & (left < 0)).any(-1)
        meets = (first <= last) & (last >= 0) & ~outside
        return np.where(meets, np.maximum(first, 0.0), np.inf).min(-1, initial=np.inf)

    def below(self, xy: Float[np.ndarray, "2"], height: float, of: Collection[int]) -> float:
        """World z of the highest point below a height, over x and y, of some objects; -inf: there is none."""
        mine = np.flatnonzero(self._keep & np.isin(self.objects, list(of)) & (self._low[:, 2] < height))
        best = -np.inf
        for k in mine:
            if (xy < self._low[k, :2]).any() or (xy > self._high[k, :2]).any():
                continue
            normal, offset = self._normal[k], self._offset[k]
            left = offset - normal[:, :2] @ xy  # n_z z <= left
            down, up, flat = normal[:, 2] < -1e-9, normal[:, 2] > 1e-9, np.abs(normal[:, 2]) <= 1e-9
            top = (left[up] / normal[up, 2]).min(initial=np.inf)
            bottom = (left[down] / normal[down, 2]).max(initial=-np.inf)
            if (left[flat] >= 0).all() and bottom <= top and top <= height:
                best = max(best, float(top))
        return best


def straight(
    obstacles: Obstacles, spheres: Float[np.ndarray, "S 4"], start: np.ndarray, end: np.ndarray, spare: float = 0.0
) -> bool:
    """Whether spheres (x, y, z from a hand's grasp point, world axes; radius) pass along a straight line.

    Args:
      spare: m at both ends of the line within which nothing is checked: a hand touches there what it takes or leaves.
    """
    way = end - start
    apart = float(np.linalg.norm(way))
    count = max(2, int(np.ceil(apart / STEP)) + 1)
    along = np.linspace(0, apart, count)
    along = along[(along >= 0) & (along <= apart - spare)]
    if not len(along) or apart < 1e-6:
        return True
    return obstacles.clear_along(spheres, np.asarray(start, float), way / apart, along)


def passes_wall(obstacles: Obstacles, points: Float[np.ndarray, "S 3"], start: np.ndarray, end: np.ndarray) -> bool:
    """Whether one of a hand's points (from its grasp point, m, world axes), moved along a straight line, comes into
    something after it was off all: walls are passed, what only touches the hand is not."""
    count = max(2, int(np.ceil(np.linalg.norm(end - start) / CORE)) + 1)
    places = start + np.linspace(0.0, 1.0, count)[:, None] * (end - start)
    clear = obstacles.distance(places[:, None] + points) > CORE
    return bool((clear[:-1] & ~clear[1:]).any())


def _where_negative(
    value: Float[np.ndarray, "*n"], slope: Float[np.ndarray, "*#n"] | float
) -> tuple[Float[np.ndarray, "*n"], Float[np.ndarray, "*n"]]:
    """Between which t `value + slope * t` is below 0; the first is not below the second where it never is."""
    with np.errstate(divide="ignore", invalid="ignore"):
        at = -value / slope
    level = np.abs(slope) < LEVEL
    first = np.where(level, np.where(value < 0.0, -np.inf, np.inf), np.where(slope < 0.0, at, -np.inf))
    last = np.where(level, np.where(value < 0.0, np.inf, -np.inf), np.where(slope > 0.0, at, np.inf))
    return first, last


def _within(
    offset: Float[np.ndarray, "*n d"], ahead: Float[np.ndarray, "d"], radius: Float[np.ndarray, "*n"]
) -> tuple[Float[np.ndarray, "*n"], Float[np.ndarray, "*n"]]:
    """Between which t `offset + t * ahead` is nearer to the origin than `radius`; see `_where_negative`."""
    a, b, c = float(ahead @ ahead), offset @ ahead, (offset * offset).sum(-1) - radius * radius
    if a < LEVEL:
        return np.where(c < 0.0, -np.inf, np.inf), np.where(c < 0.0, np.inf, -np.inf)
    root = np.sqrt(np.maximum(b * b - a * c, 0.0))
    never = b * b <= a * c
    return np.where(never, np.inf, (-b - root) / a), np.where(never, -np.inf, (-b + root) / a)


def hand_way(
    obstacles: Obstacles,
    spheres: Float[np.ndarray, "S 4"],
    start: np.ndarray,
    goal: np.ndarray,
    spare: float = 0.0,
    accepts: Callable[[list[np.ndarray]], bool] = lambda way: True,
) -> list[np.ndarray] | None:
    """Points of a hand's way from one point to another, without the first; None: no way was found.

    Tried are the straight line, ways up, across and down, and one that is level first. Of each the last part comes
    first, which is blocked most often.

    Args:
      spheres, spare: see `straight`. accepts: of a way that is free: the arm that carries the hand follows it.
    """

    def free(points: Sequence[np.ndarray]) -> bool:
        ends = spare
        for a, b in itertools.pairwise([goal, *reversed(points), start]):
            if not straight(obstacles, spheres, b, a, ends):
                return False
            ends = 0.0
        return accepts([*points, goal])

    if free([]):
        return [goal]
    level = [np.array([*start[:2], goal[2]])]
    for lift in LIFTS:
        top = max(start[2], goal[2]) + lift
        over = np.array([*goal[:2], top])
        if not straight(obstacles, spheres, over, goal, spare):
            break  # higher ones lead through the same
        if free(way := [np.array([*start[:2], top]), over]):
            return [*way, goal]
    return [*level, goal] if free(level) else None
