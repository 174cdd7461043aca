"""`PlannedWorld`: one world of a stage as primitives plan in it: the robot's pose, its hands, what is where."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable, Collection, Iterator, Sequence
from typing import Any

import numpy as np
from jaxtyping import Bool, Float

from ig2mj.agents.humanoid.frames import BODY_HEIGHT
from ig2mj.agents.humanoid.robot import BODY_RADIUS
from ig2mj.engine.view import PhysicsView
from ig2mj.geometry.host_rotations import matrix_to_quat, quat_conjugate, quat_multiply
from ig2mj.geometry.poses import matrices_on_host
from ig2mj.planning.arm_orientations import ARM_TURNS, level_orientations
from ig2mj.planning.bodies import ALONG, CORNER, Follower, HandedBody, Senses, grip_of, sense
from ig2mj.planning.clearance import Obstacles
from ig2mj.planning.domain import Domain
from ig2mj.planning.facts import Facts
from ig2mj.planning.footprint import BaseFootprint
from ig2mj.planning.motion_planner import NEAR_START, FreeFloor, MotionPlanner
from ig2mj.planning.occupancy import RESOLUTION
from ig2mj.planning.stage import Stage
from ig2mj.predicates.literals import object_index, room_index
from ig2mj.sampling.placement import Placer
from ig2mj.sampling.query import SceneQuery
from ig2mj.sampling.rules import PLACEMENTS
from ig2mj.states.definitions.dust import DUST
from ig2mj.states.definitions.stain import STAIN
from ig2mj.states.particles import world_normals, world_positions

HELD_POINTS, HELD_MARGIN, LATTICE = 60, 0.012, 0.04
"""Corners of what a hand holds that keep clear, and points within it, about; m by which they do, and between them."""

BODY_SPARE = 0.04
"""m that are left between the body and what it carries."""

APART = 0.12
"""m between stances for the same point, at least."""

SIDEWAYS = 0.4
"""Cost of standing with a hand's side to a point. The hand's shoulder, the middle of the sphere that bounds its reach
(iGibson's behavior_robot.py), is behind the body's axis and to the side, so that the hand reaches 0.3 m farther than
ahead."""

TUCKED = (0.5, 0.85, 0.22)
"""m: heights of floating hands whose fingers point up, and how far from the body's axis they reach."""

EFFORT = 1.0
"""m of way that a metre by which the body stoops, or stretches, counts as."""

AWAY, FARTHEST = 0.55, 0.95
"""m, horizontal, that a base would like to be from what its hand does, and from where it puts what is large."""

EASY = 0.35
"""m, horizontal, from the floor where a robot can stand up to which no spot is harder to reach than another."""

WALL = 0.02
"""m before a point from which on a wall does not count: a switch is on it."""

EACH, SPREAD = 4, 0.04
"""Spots of a placement in each area of its rule, and m between them, at least."""

ROOFED, COLUMN = 1.0, np.arange(0.15, 0.8, 0.08)
"""m of way that a spot counts as farther which nothing can be let down to, and heights above it that are looked at."""

LATER_SPOTS = 12
"""Candidates of an area of which the predicate is asked, at most."""

TURNS = (0.0, np.pi / 2, -np.pi / 2, np.pi)
"""rad about the vertical that an object may be turned by, from how it is held in front of the robot."""

ORIENTATIONS, ORIENTATION_SPREAD = 2, 1.7
"""Orientations at rest that are tried, and rad by which they may be farther from the present one than the nearest."""

UP = np.array([0.0, 0.0, 1.0])

Vector = Float[np.ndarray, "3"]
Rotation = Float[np.ndarray, "3 3"]


@dataclasses.dataclass(frozen=True)
class Stance:
    """Where a robot stands to do something: x, y (m), yaw (rad), and how far it stretches or stoops (m)."""

    xy: tuple[float, float]
    yaw: float
    rise: float = 0.0


@dataclasses.dataclass(frozen=True, eq=False)
class Spot:
    """Where an object is to be: position (m) and orientation (w-x-y-z) of its main body, world frame; `roofed`: inside
    something, with a part of it above."""

    pos: Vector
    quat: Float[np.ndarray, "4"]
    roofed: bool = False


@dataclasses.dataclass(frozen=True, eq=False)
class DirtSpot:
    """A particle of dust or of a stain: its number, where it is, and the normal of the face; world frame."""

    number: int
    pos: Vector
    normal: Vector


@dataclasses.dataclass(eq=False)
class PlannedWorld:
    """See the module's text.

    Attributes:
      stage, body, domain, planner: of all worlds. query: a world of the scene on the native engine, to sample spots in.
      world: number. rng: of this primitive.
    """

    stage: Stage
    body: Any  # HoveringBody; a robot that only drives has a WheeledBody
    domain: Domain
    planner: MotionPlanner
    query: SceneQuery
    world: int
    rng: np.random.Generator
    _points: dict[str, np.ndarray] = dataclasses.field(default_factory=dict)
    _sensed: tuple[PhysicsView, Senses] | None = dataclasses.field(default=None, init=False)

    @property
    def view(self) -> PhysicsView:
        return self.stage.view

    @property
    def senses(self) -> Senses:
        view = self.view
        if self._sensed is None or self._sensed[0] is not view:
            self._sensed = view, sense(view, self.stage.agent, self.body.hands)
        return self._sensed[1]

    @property
    def facts(self) -> Facts:
        """What holds now."""
        return Facts(self.domain, self.stage.states, self.view, self.world, held=[n for n in self.held if n])

    @property
    def held(self) -> list[str]:
        """Name of what each hand holds, "" for an empty one. A link that a hand holds counts as its object."""
        names = self.domain.model.tables.object_names
        rows = self.senses.held[self.world]
        return [names[int(np.argmax(row))] if row.any() else "" for row in rows]

    @property
    def base(self) -> tuple[Float[np.ndarray, "2"], float]:
        """Position and direction of the robot's base."""
        senses = self.senses
        return senses.base_pos[self.world, :2].astype(float), float(senses.yaw[self.world])

    def index(self, name: str) -> int:
        """Number of an object."""
        return object_index(self.domain.model, name)

    def grip(self, hand: int) -> Vector:
        """Where a hand's grasp point is."""
        return grip_of(self.senses, hand, self.body.grips[hand])[self.world].astype(float)

    def hand_quat(self, hand: int) -> Float[np.ndarray, "4"]:
        """Orientation of a hand."""
        return self.senses.hand_quat[self.world, hand].astype(float)

    def pose(self, name: str) -> tuple[Vector, Float[np.ndarray, "4"]]:
        """Frame of an object's main body."""
        o = self.index(name)
        return (
            np.asarray(self.view.object_pos)[self.world, o].astype(float),
            np.asarray(self.view.object_quat)[self.world, o].astype(float),
        )

    def com(self, name: str) -> Vector:
        """Centre of mass of an object."""
        return np.asarray(self.view.object_com)[self.world, self.index(name)].astype(float)

    def obstacles(self, without: Collection[str] = (), at: Stance | None = None) -> Obstacles:
        """Pieces of everything but some objects; `at`: and the robot's body, if it stood there."""
        found = self.planner.obstacles(self.view, [self.index(n) for n in without], self.world)
        return found if at is None else found.about(at.xy, *self.body.trunk)

    @property
    def stance(self) -> Stance:
        """Where the robot stands now."""
        (x, y), yaw = self.base
        return Stance((float(x), float(y)), yaw, float(self.senses.base_pos[self.world, 2]) - self.body.stands)

    def vertices(self, name: str) -> Float[np.ndarray, "V 3"]:
        """Corners of an object's collision pieces, world frame."""
        tables = self.domain.model.tables
        pieces = np.flatnonzero(tables.piece_object == self.index(name))
        return self.vertices_of_pieces(pieces)

    def rim(self, name: str) -> Float[np.ndarray, "n 3"]:
        """Corners of an object that are farthest from its centre of mass to each side, the nearest to the robot first,
        at the height of its centre: what of a wide object is in reach from the floor around it."""
        corners, centre = self.vertices(name), self.com(name)
        angles = np.arange(8) * (np.pi / 4)
        sides = np.stack([np.cos(angles), np.sin(angles)])
        found = corners[np.unique((corners[:, :2] @ sides).argmax(axis=0))]
        found[:, 2] = centre[2]
        here, _ = self.base
        return found[np.argsort(np.linalg.norm(found[:, :2] - here, axis=1))]

    def vertices_of_pieces(self, pieces: np.ndarray) -> Float[np.ndarray, "V 3"]:
        """Corners of collision pieces, world frame."""
        tables = self.domain.model.tables
        own = matrices_on_host(tables.piece_quat[pieces])
        points = np.einsum("kij,kvj->kvi", own, tables.piece_vertices[pieces]) + tables.piece_pos[pieces][:, None]
        body = tables.piece_body[pieces]
        turn = matrices_on_host(np.asarray(self.view.body_quat)[self.world, body])
        pos = np.asarray(self.view.body_pos)[self.world, body].astype(float)
        return (np.einsum("kij,kvj->kvi", turn, points) + pos[:, None]).reshape(-1, 3)

    def spheres(
        self,
        fingers: Sequence[float] | np.ndarray,
        palm: Sequence[float] | np.ndarray = (0.0, 0.0, -1.0),
        holding: str = "",
        hand: int = 0,
        rotation: Rotation | None = None,
    ) -> np.ndarray:
        """What keeps clear about a hand's grasp point: `HandedBody.hand_spheres`, and corners of what it holds.

        Args:
          fingers, palm: where they point, and it faces. holding: what it holds, whose corners keep clear, too.
          rotation: by which that is turned, world frame.
        """
        found = self.body.hand_spheres(fingers, palm)
        if holding:
            points = self.points(holding) - self.grip(hand)
            points = points if rotation is None else points @ rotation.T
            found = np.concatenate([found, np.column_stack([points, np.full(len(points), HELD_MARGIN)])])
        return found

    def points(self, name: str) -> Float[np.ndarray, "n 3"]:
        """Points of an object by which it is kept clear: corners of its pieces, and a lattice within them."""
        pos, quat = self.pose(name)
        frame = matrices_on_host(quat[None])[0]
        if name not in self._points:
            corners = self.vertices(name)
            low, high = corners.min(0), corners.max(0)
            spacing = max(LATTICE, float(np.prod(np.maximum(high - low, LATTICE)) / HELD_POINTS) ** (1 / 3))
            ranges = [
                np.arange(a + spacing / 2, b, spacing) if b - a > spacing else [(a + b) / 2]
                for a, b in zip(low, high, strict=True)
            ]
            grid = np.stack(np.meshgrid(*ranges), axis=-1).reshape(-1, 3)
            others = set(range(len(self.domain.model.tables.object_names))) - {self.index(name)}
            own = self.planner.obstacles(self.view, others, self.world)
            inside = grid[own.distance(grid) < LATTICE / 4]
            step = max(1, len(corners) // HELD_POINTS)
            self._points[name] = (np.concatenate([corners[::step], inside]) - pos) @ frame
        return self._points[name] @ frame.T + pos

    def hand_axes(self, hand: int, rotation: Rotation | None = None) -> tuple[Vector, Vector]:
        """Where a hand's fingers point, and its palm faces, if it were turned, world frame."""
        frame = matrices_on_host(self.hand_quat(hand)[None])[0]
        frame = frame if rotation is None else rotation @ frame
        return self.body.axes(hand, frame)

    def floor(self, holding: bool = False, reaching: bool = False) -> FreeFloor:
        """Where the robot can stand, without regard to what it holds.

        Args:
          holding: in any direction with what it holds. reaching: empty hands are where they rest, not tucked.
        """
        view, number, hands = self.view, self.world, self.body.hands
        held = [n if n and not self.domain.fixed(n) else "" for n in self.held]
        counts = hands.tolist() if isinstance(self.body, HandedBody) else []
        arm = [] if not counts or holding else self.body.arm.tolist()
        footprint = BaseFootprint.of_robot(self.stage.scene, view, self.stage.agent, number, counts, arm)
        if counts and not all(held) and self.body.resting is not None:
            footprint = footprint.holding(*(self.body.resting if reaching else TUCKED))
        here, _ = self.base
        for hand, name in enumerate(held):
            if holding and name:
                corners = np.concatenate(
                    [self.vertices(name), self.body.hand_spheres(*self.hand_axes(hand))[:, :3] + self.grip(hand)]
                )
                away = float(np.linalg.norm(corners[:, :2] - here, axis=1).max())
                footprint = footprint.holding(float(corners[:, 2].min()), float(corners[:, 2].max()), away)
        return self.planner.floor(view, footprint, without=[self.index(n) for n in held if n], world=number)

    def clear_with_held(self, stances: Sequence[Stance]) -> bool:
        """Whether what the robot holds, carried as it is now, meets nothing where the robot stands."""
        held = [(h, n) for h, n in enumerate(self.held) if n and not self.domain.fixed(n)]
        obstacles = self.obstacles([n for _, n in held])
        here, now = self.base
        for hand, name in held:
            spheres = self.spheres(*self.hand_axes(hand), holding=name, hand=hand)
            points = spheres[:, :3] + self.grip(hand) - np.array([*here, 0.0])
            for stance in stances:
                there = points @ about_vertical(stance.yaw - now).T + np.array([*stance.xy, 0.0])
                if not obstacles.clear(np.concatenate([there, spheres[:, 3:]], axis=1)):
                    return False
        return True

    def away(self, spheres: Float[np.ndarray, "S 4"]) -> float:
        """m, horizontal, that a base would like to be from where a hand puts what it holds, whose spheres these are."""
        return float(min(AWAY + max(np.linalg.norm(spheres[:, :2], axis=1).max() - ALONG[-1], 0.0), FARTHEST))

    def carry(self, hand: int, name: str = "") -> Vector:
        """Where a hand carries an object, "": what it holds, in the body's frame: as far ahead as that is wide."""
        x, y, z = self.body.carry[hand]
        if name := name or self.held[hand]:
            low, high = self.vertices(name).min(0), self.vertices(name).max(0)
            x = max(x, self.body.trunk[0] + BODY_SPARE + float(np.linalg.norm((high - low)[:2])) / 2)
        return np.array([x, y, z])

    def from_body(self, point: Vector) -> Vector:
        """A point of the body's frame, where the robot stands now; world frame."""
        return self._from(point, self.stance)

    def resting(self, hand: int, stance: Stance) -> Vector:
        """Where an empty hand's grasp point rests, if the robot stood there; world frame."""
        return self._from(self.body.rest[hand], stance)

    def carried(self, hand: int, stance: Stance) -> Vector:
        """Where a hand's grasp point is carried, if the robot stood there; world frame."""
        return self._from(self.carry(hand), stance)

    def follows(
        self, hand: int, quat: Sequence[float] | np.ndarray, obstacles: Obstacles, stance: Stance | None = None
    ) -> Follower | None:
        """Whether an arm takes its hand along ways, turned to `quat`; None: the hand floats.

        Args:
          stance: of the robot, whose empty hands rest then; None: as it is.
        """
        joints, z = self.senses.joints, float(self.senses.base_pos[self.world, 2])
        at = self.stance if stance is None else stance
        resting = stance is not None and not self.held[hand]
        row = np.zeros(0) if joints is None else joints[self.world].astype(float)
        return self.body.follower(row, resting, (np.array([*at.xy, z]), at.yaw), quat, obstacles)

    def _from(self, point: Vector, stance: Stance) -> Vector:
        """A point of the body's frame, if the robot stood there."""
        c, s = np.cos(stance.yaw), np.sin(stance.yaw)
        x, y, z = point
        height = self.body.stands + stance.rise
        return np.array([stance.xy[0] + c * x - s * y, stance.xy[1] + s * x + c * y, height + z])

    def reaches(self, hand: int, stance: Stance, point: Vector) -> bool:
        """Whether a hand reaches a point from a stance."""
        return bool(np.linalg.norm(point - self._from(self.body.shoulders[hand], stance)) <= self.body.reach)

    def stances(
        self,
        hand: int,
        point: Vector,
        floor: FreeFloor,
        away: float,
        most: int = 10,
        held: Vector | None = None,
    ) -> Iterator[Stance]:
        """Where the robot can stand so that a hand reaches a point, the nearest and most comfortable first.

        Args:
          away: m, horizontal, that the base would like to be from the point.
          held: what is brought to the point is a part of what the hand holds, and this leads from it to the hand's
            grasp point, m, in the body's frame.
        """
        here, _ = self.base
        side = self.body.carry[hand][1]
        away = max(away, self.body.away)
        cells = floor.within(point[:2], self.body.reach + abs(float(self.body.shoulders[hand][1])))
        middles = floor.occupancy.middles(cells)
        offset = point[:2] - middles
        apart = np.linalg.norm(offset, axis=1)
        bearing = np.arctan2(offset[:, 1], offset[:, 0])
        yaw = np.concatenate(
            [bearing - np.arctan2(0.6 * side, np.maximum(apart, 0.3)), bearing - np.sign(side) * np.pi / 2]
        )
        way = floor.distances(here, NEAR_START)[tuple(cells.T)]
        cost = 0.6 * way + 2.0 * np.abs(apart - away) - 0.5 * np.minimum(floor.spare[tuple(cells.T)], 0.2)
        cost, middles = np.concatenate([cost, cost + SIDEWAYS]), np.concatenate([middles, middles])
        target = point if held is None else point + _turned_vectors(yaw, held)
        rise = self._rise_from(hand, middles, yaw, target)
        cost += np.where(np.isnan(rise), np.inf, EFFORT * np.abs(rise))
        count, obstacles = 0, self.obstacles()
        while len(cost) and np.isfinite(cost[best := int(np.argmin(cost))]):
            if self.behind_wall(obstacles, middles[best], point) or not self._stretches(
                obstacles, middles[best], rise[best]
            ):
                cost[best] = np.inf
                continue
            cost[np.linalg.norm(middles - middles[best], axis=1) < APART] = np.inf
            yield Stance((float(middles[best][0]), float(middles[best][1])), float(yaw[best]), float(rise[best]))
            count += 1
            if count == most:
                return

    def _stretches(self, obstacles: Obstacles, xy: Float[np.ndarray, "2"], rise: float) -> bool:
        """Whether there is room above a body that stretches."""
        if rise <= 0.0:
            return True
        top = self.body.stands + BODY_HEIGHT - BODY_RADIUS
        points = np.array([[*xy, top], [*xy, top + rise]])
        return bool((obstacles.distance(points) > BODY_RADIUS).all())

    def behind_wall(self, obstacles: Obstacles, xy: Float[np.ndarray, "2"], point: Vector) -> bool:
        """Whether a wall stands between a robot and a point."""
        start = np.array([*xy, point[2]])
        apart = float(np.linalg.norm(point - start))
        way = (point - start)[None] / max(apart, 1e-9)
        return any(obstacles.entries(start[None], way, wall)[0] < apart - WALL for wall in self._walls)

    def turned_hand(self, hand: int, rotation: Rotation) -> tuple[float, float, float, float]:
        """Orientation of a hand, w-x-y-z, after a rotation."""
        w, x, y, z = matrix_to_quat(rotation @ matrices_on_host(self.hand_quat(hand)[None])[0])
        return (float(w), float(x), float(y), float(z))

    @functools.cached_property
    def _walls(self) -> list[int]:
        tables = self.domain.model.tables
        return [o for o, c in enumerate(tables.object_categories) if c == "walls"]

    def _rise_from(
        self, hand: int, xy: Float[np.ndarray, "n 2"], yaw: Float[np.ndarray, "n"], point: Float[np.ndarray, "*n 3"]
    ) -> Float[np.ndarray, "n"]:
        """How far the body rises so that a hand reaches a point from each of some stances, m; NaN: it does not."""
        x, y, z = self.body.shoulders[hand]
        c, s = np.cos(yaw), np.sin(yaw)
        shoulder = np.stack([xy[:, 0] + c * x - s * y, xy[:, 1] + s * x + c * y], axis=1)
        away = np.linalg.norm(point[..., :2] - shoulder, axis=1)
        above = point[..., 2] - (self.body.stands + z)
        span = np.sqrt(np.maximum(self.body.reach**2 - away**2, 0.0))
        rise = np.sign(above) * np.maximum(np.abs(above) - span, 0.0)
        return np.where(
            (away <= self.body.reach) & (rise >= self.body.rises[0]) & (rise <= self.body.rises[1]), rise, np.nan
        )

    def dirt(self, predicate: str, name: str) -> list[DirtSpot]:
        """Particles that are left on an object: of dust for "dusty", of stains for "stained"; the nearest first."""
        kind = DUST if predicate == "dusty" else STAIN
        row = kind.row_of(self.domain.model, self.index(name))
        if row is None:
            return []
        rows = getattr(self.stage.states, kind.name)
        pos = np.asarray(world_positions(rows, self.view))[self.world, row].astype(float)
        normal = np.asarray(world_normals(rows, self.view))[self.world, row].astype(float)
        alive = np.flatnonzero(np.asarray(rows.alive)[self.world, row])
        here, _ = self.base
        order = sorted(alive.tolist(), key=lambda n: float(np.linalg.norm(pos[n, :2] - here)))
        return [DirtSpot(n, pos[n], normal[n]) for n in order]

    def spots(self, predicate: str, name: str, where: str) -> Iterator[Spot]:
        """Poses of an object's main body that make a placement true. Orientations in which it rests come first, those
        nearest to how it is held before others, each turned about the vertical."""
        self.query.load(self.stage.snapshot(self.world))
        index = self.index(name)
        second = room_index(self.domain.model, where) if predicate == "on_floor" else self.index(where)
        areas = PLACEMENTS[predicate](self.query, index, second)
        placer, farther = Placer(self.query), self._out_of_reach()
        middle = self._middle_of_fixed_part(where) if predicate == "inside" else None
        around = self.obstacles([name])
        turned = [(quat, angle) for quat in self._upright(name) for angle in TURNS]
        if self.body.opening is not None:
            level = level_orientations(self, name) if predicate in ("inside", "under") else []
            turned = [(quat, angle) for angle in ARM_TURNS for quat in (*level, *self._upright(name))]
        for quat, angle in turned:
            new = _yawed(quat, angle)
            for support in ("full", "balanced", "loose") if predicate == "inside" else ("full", "balanced"):
                found, asked = list[Vector](), 0
                positions = np.array(list(placer.spots(index, areas, new, self.rng, support))).reshape(-1, 3)
                cost = farther(positions)
                roofed = np.zeros(len(positions), bool)
                if middle is not None:  # below openings, and away from where doors shut
                    roofed = self._roofed(positions, around)
                    cost += np.linalg.norm((positions - middle)[:, :2], axis=1) + ROOFED * roofed
                for k in np.argsort(cost, kind="stable"):
                    pos = positions[k]
                    if not np.isfinite(cost[k]) or len(found) == EACH or asked == LATER_SPOTS:
                        break
                    if any(np.linalg.norm(pos - other) < SPREAD for other in found):
                        continue
                    asked += 1
                    if predicate in ("on_top", "on_floor") or self._would_hold(predicate, name, where, pos, new):
                        found.append(pos)
                        yield Spot(pos, new, bool(roofed[k]))
                if found:
                    break

    def _roofed(self, positions: Float[np.ndarray, "n 3"], around: Obstacles) -> Bool[np.ndarray, "n"]:
        """Above which positions something is in the way of what is let down to them."""
        if not len(positions):
            return np.zeros(0, bool)
        points = positions[:, None] + np.stack([np.zeros(len(COLUMN)), np.zeros(len(COLUMN)), COLUMN], axis=1)
        return np.any(around.distance(points.reshape(-1, 3)).reshape(points.shape[:2]) < CORNER, axis=1)

    def _out_of_reach(self) -> Callable[[Float[np.ndarray, "n 3"]], Float[np.ndarray, "n"]]:
        """How far positions are from where a hand is comfortable, m, for a robot on floor that it has a way to;
        infinite: no hand reaches there."""
        import scipy.ndimage  # takes long to import

        floor, (here, _) = self.floor(), self.base
        reached = np.isfinite(floor.distances(here, NEAR_START))
        apart = np.full(reached.shape, np.inf)
        if reached.any():
            apart = RESOLUTION * np.asarray(scipy.ndimage.distance_transform_edt(~reached))
        _, aside, height = np.abs(self.body.shoulders[0])
        shoulder = self.body.stands + height

        def farther(pos: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n"]:
            if not len(pos):
                return np.zeros(0)
            cells = np.clip(floor.occupancy.cells(pos[:, :2]), 0, np.array(reached.shape) - 1)
            away = apart[tuple(np.moveaxis(cells, -1, 0))]
            above = pos[:, 2] - shoulder
            level = np.maximum(away - aside, 0.0)
            far = np.hypot(level, above - np.clip(above, *self.body.rises)) > self.body.reach
            return np.where(far, np.inf, np.maximum(away - EASY, 0.0))

        return farther

    def _middle_of_fixed_part(self, name: str) -> Vector:
        """Of an object without its doors, drawers and lids: middle of its box, m."""
        tables, model = self.domain.model.tables, self.stage.scene.model
        index = self.index(name)
        joints = np.isin(model.jnt_qposadr, tables.openable_qposadr[tables.openable_object == index])
        own = tables.piece_object == index
        fixed = np.flatnonzero(own & ~np.isin(tables.piece_body, model.jnt_bodyid[joints]))
        corners = self.vertices_of_pieces(fixed if len(fixed) else np.flatnonzero(own))
        return (corners.min(0) + corners.max(0)) / 2

    def _upright(self, name: str) -> list[Float[np.ndarray, "4"]]:
        """Orientations in which an object rests, each the nearest to its present one; that, where none is known."""
        _, now = self.pose(name)
        frame = matrices_on_host(now[None])[0]
        found = []
        for entry in self.stage.scene.manifest.objects[self.index(name)].orientations:
            up = frame @ matrices_on_host(np.array([entry.quat], float))[0][2]  # the vertical of that orientation, now
            axis, angle = np.cross(up, UP), float(np.arccos(np.clip(up[2], -1.0, 1.0)))
            axis = axis / np.linalg.norm(axis) if np.linalg.norm(axis) > 1e-6 else np.array([1.0, 0.0, 0.0])
            tilt = np.concatenate([[np.cos(angle / 2)], np.sin(angle / 2) * axis])
            found.append((angle, np.asarray(quat_multiply(tilt, now), float)))
        found.sort(key=lambda pair: pair[0])
        kept = [quat for angle, quat in found if angle < found[0][0] + ORIENTATION_SPREAD][:ORIENTATIONS]
        return kept or [now]

    def _would_hold(self, predicate: str, name: str, where: str, pos: Vector, quat: np.ndarray) -> bool:
        """Whether a placement that does not depend on contact would be true."""
        before = self.query.save()
        self.query.place(self.index(name), pos, quat)
        states = Facts(self.domain, self.stage.states, self.view, self.world).states
        holds = Facts(self.domain, states, self.query.view).holds(predicate, name, where)
        self.query.load(before)
        return holds

    def grip_for(self, hand: int, name: str, spot: Spot) -> tuple[Vector, Float[np.ndarray, "4"], Rotation]:
        """Grasp point and orientation of a hand that holds an object, if the object were at a spot, and the rotation
        that brings both there."""
        own_pos, own_quat = self.pose(name)
        turn = np.asarray(quat_multiply(spot.quat, quat_conjugate(own_quat)), float)
        rotation = matrices_on_host(turn[None])[0]
        target = spot.pos + rotation @ (self.grip(hand) - own_pos)
        return target, np.asarray(quat_multiply(turn, self.hand_quat(hand)), float), rotation


def _turned_vectors(yaw: Float[np.ndarray, "n"], vector: Vector) -> Float[np.ndarray, "n 3"]:
    """A vector turned about the vertical by each of some angles, rad."""
    c, s = np.cos(yaw), np.sin(yaw)
    x, y, z = vector
    return np.stack([c * x - s * y, s * x + c * y, np.full(len(yaw), z)], axis=1)


def about_vertical(angle: float) -> Rotation:
    """Rotation matrix."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def turn_onto(one: Vector, other: Vector) -> Rotation:
    """The least rotation from one direction to another."""
    a, b = one / np.linalg.norm(one), other / np.linalg.norm(other)
    axis, cos = np.cross(a, b), float(a @ b)
    if cos < -0.999:
        side = np.cross(a, UP) if abs(a @ UP) < 0.9 else np.array([1.0, 0.0, 0.0])
        side = side / np.linalg.norm(side)
        return 2 * np.outer(side, side) - np.eye(3)
    k = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    return np.eye(3) + k + k @ k / (1 + cos)


def _turn(angle: float) -> Float[np.ndarray, "4"]:
    return np.array([np.cos(angle / 2), 0.0, 0.0, np.sin(angle / 2)])


def _yawed(quat: Float[np.ndarray, "4"], angle: float) -> Float[np.ndarray, "4"]:
    turned = np.asarray(quat_multiply(_turn(angle), quat), float)
    return turned / np.linalg.norm(turned)
