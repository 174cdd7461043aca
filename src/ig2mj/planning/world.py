"""`PlannedWorld`: one world of a stage, with the queries that primitives plan with. Positions are in m, world frame."""

from __future__ import annotations

import collections
import dataclasses
import functools
from collections.abc import Callable, Collection, Hashable, Sequence
from typing import Any, TypeVar

import numpy as np
from jaxtyping import Float

from ig2mj.engine.view import PhysicsView
from ig2mj.geometry.host_rotations import about_vertical, matrix_to_quat
from ig2mj.geometry.poses import matrices_on_host
from ig2mj.planning.bodies import ALONG, Follower, HandedBody
from ig2mj.planning.clearance import Obstacles
from ig2mj.planning.domain import Domain
from ig2mj.planning.facts import Facts
from ig2mj.planning.footprint import BaseFootprint, Disc
from ig2mj.planning.free_floor import FreeFloor
from ig2mj.planning.motion_planner import MotionPlanner
from ig2mj.planning.senses import Senses, grip_of, sense
from ig2mj.planning.stage import Stage
from ig2mj.predicates.literals import object_index
from ig2mj.sampling.query import SceneQuery
from ig2mj.states.definitions.dust import DUST
from ig2mj.states.definitions.stain import STAIN
from ig2mj.states.particles import world_normals, world_positions

HELD_POINTS, HELD_MARGIN, LATTICE = 60, 0.012, 0.04
"""Corners of what a hand holds that keep clear, and points within it, about; m by which they do, and between them."""

CARRIED = 0.03
"""m about points of what other hands hold that a hand keeps clear of."""

BODY_SPARE = 0.04
"""m that are left between the body and what it carries."""

TALL, HANGS, RAISED, HIGHEST = 0.2, 0.05, 0.35, 1.85
"""m below a floating hand from which on what it carries is carried higher, and that it then hangs below where others
are carried; by which it is, at most; and height of its top then, at most, which passes below the heads of doors."""

BETWEEN, MOST_APART = 0.03, 0.6
"""m between two things that hands carry, and by which they are carried apart for that at most."""

WIDE = 0.25
"""m, half the diagonal of what a floating hand carries, from which on it is carried in front of the body's middle."""

TUCKED = (0.5, 0.85, 0.22)
"""m: heights of floating hands whose fingers point up, and how far from the body's axis they reach."""

AWAY, FARTHEST = 0.55, 0.95
"""m, horizontal, that a base would like to be from what its hand does, and from where it puts what is large."""

POINTS = 0.2
"""Horizontal part of where a gripper points, from which on it says on which side of it the robot stands."""

Kept = TypeVar("Kept")

Vector = Float[np.ndarray, "3"]
Rotation = Float[np.ndarray, "3 3"]


@dataclasses.dataclass(frozen=True)
class Stance:
    """Where a robot stands to do something: x, y (m), yaw (rad), and how far it stretches or stoops (m)."""

    xy: tuple[float, float]
    yaw: float
    rise: float = 0.0


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
      missed: how often in this episode a gripper has tried something in vain, by what that was (`moves.tries_left`).
      vain: what was tried in vain in this episode to take hold of an object, by its name, and where its corners were
        (`grasping.tried_in_vain`).
      world: number. rng: of this primitive. crosses: a base on wheels drives over edges of carpets, at which it may get
        stuck.
    """

    stage: Stage
    body: Any  # HoveringBody; a robot that only drives has a WheeledBody
    domain: Domain
    planner: MotionPlanner
    query: SceneQuery
    world: int
    rng: np.random.Generator
    crosses: bool = False
    missed: collections.Counter[str] = dataclasses.field(default_factory=collections.Counter)
    vain: dict[str, tuple[Float[np.ndarray, "V 3"], list[Any]]] = dataclasses.field(default_factory=dict)
    _points: dict[str, np.ndarray] = dataclasses.field(default_factory=dict)
    _kept: tuple[PhysicsView, dict[Any, Any]] | None = dataclasses.field(default=None, init=False)
    _sensed: tuple[PhysicsView, Senses] | None = dataclasses.field(default=None, init=False)

    @property
    def view(self) -> PhysicsView:
        return self.stage.view

    @property
    def senses(self) -> Senses:
        view = self.view
        if self._sensed is None or self._sensed[0] is not view:
            self._sensed = view, sense(view, self.stage.agent, self.body.hands, self.body.friction)
        return self._sensed[1]

    def kept(self, key: Hashable, make: Callable[[], Kept]) -> Kept:
        """What `make` gives; asked again with the same key before something has moved, the same object."""
        view = self.view
        if self._kept is None or self._kept[0] is not view:
            self._kept = view, {}
        if key not in self._kept[1]:
            self._kept[1][key] = make()
        return self._kept[1][key]

    @property
    def facts(self) -> Facts:
        """What holds now."""
        return Facts(
            self.domain, self.stage.states, self.view, self.world, held=list(dict.fromkeys(n for n in self.held if n))
        )

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

    def mass(self, name: str) -> float:
        """kg, of the whole object."""
        return float(self.domain.model.tables.object_mass[self.index(name)])

    def obstacles(self, without: Collection[str] = (), at: Stance | None = None, stays: bool = True) -> Obstacles:
        """Pieces of everything but some objects.

        Args:
          at: and the robot's body, if it stood there. stays: the robot stands where it is; else what its hands hold is
            not where it is now (`standing`).
        """
        moved = [] if stays else [n for n in self.held if n and not self.domain.fixed(n)]
        found = self.planner.obstacles(self.view, [self.index(n) for n in (*without, *moved)], self.world)
        return found if at is None else found.about(at.xy, *self.body.trunk)

    def only(self, index: int) -> Obstacles:
        """Pieces of one object alone, by its number."""
        others = set(range(len(self.domain.model.tables.object_names))) - {index}
        return self.planner.obstacles(self.view, others, self.world)

    def standing(self, obstacles: Obstacles, stance: Stance, hand: int, body: bool = True) -> Obstacles:
        """The same with the robot's body, if it stood there, and what hands but one would hold there.

        Args:
          body: False for an empty hand, which passes through the body, however small its spheres are.
        """
        here, yaw = self.base
        now = np.array([*here, self.stance.rise])
        then, turn = np.array([*stance.xy, stance.rise]), about_vertical(stance.yaw - yaw)
        points = [
            (self.points(name) - now) @ turn.T + then
            for other, name in enumerate(self.held)
            if name and other != hand and name != self.held[hand] and not self.domain.fixed(name)
        ]
        found = obstacles.about(stance.xy, *self.body.trunk) if body else obstacles
        if not points:
            return found
        carried = np.concatenate(points)
        return found.with_carried(np.column_stack([carried, np.full(len(carried), CARRIED)]))

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
            own = self.only(self.index(name))
            inside = grid[own.distance(grid) < LATTICE / 4]
            step = max(1, len(corners) // HELD_POINTS)
            self._points[name] = (np.concatenate([corners[::step], inside]) - pos) @ frame
        return self._points[name] @ frame.T + pos

    def hand_axes(self, hand: int, rotation: Rotation | None = None) -> tuple[Vector, Vector]:
        """Where a hand's fingers point, and its palm faces, if it were turned, world frame."""
        frame = matrices_on_host(self.hand_quat(hand)[None])[0]
        frame = frame if rotation is None else rotation @ frame
        return self.body.axes(hand, frame)

    def floor(
        self,
        holding: bool = False,
        reaching: bool = False,
        ahead: bool = False,
        without: Collection[int] = (),
        view: PhysicsView | None = None,
    ) -> FreeFloor:
        """Where the robot can stand, without regard to what it holds.

        Args:
          holding: in any direction with what it holds. reaching: empty hands are where they rest, not tucked.
          ahead: with `holding`: only how far that reaches to the sides counts, as on a straight way ahead.
          without: objects that do not count. view: of one world, with things elsewhere; None: as they are.
        """
        number, hands = self.world, self.body.hands
        held = [n if n and not self.domain.fixed(n) else "" for n in self.held]
        counts = hands.tolist() if isinstance(self.body, HandedBody) else []
        arm = self.body.arm.tolist() if counts else []
        footprint = BaseFootprint.of_robot(self.stage.scene, self.view, self.stage.agent, number, counts, arm)
        if counts and (holding or not any(held)):
            row = np.zeros(0) if self.senses.joints is None else self.senses.joints[number].astype(float)
            spheres = self.body.arm_spheres(row, not any(held))
            aside = np.abs(spheres[:, 1]) if ahead else np.linalg.norm(spheres[:, :2], axis=1)
            middle = self.body.stands + spheres[:, 2]
            bottom, top = middle - spheres[:, 3], middle + spheres[:, 3]
            footprint = footprint.with_discs(map(Disc, bottom, top, aside + spheres[:, 3]))
        if counts and not all(held) and self.body.resting is not None:
            footprint = footprint.holding(*(self.body.resting if reaching else TUCKED))
        here, yaw = self.base
        aside = np.array([-np.sin(yaw), np.cos(yaw)])
        for hand, name in enumerate(held):
            if holding and name:
                corners = np.concatenate(
                    [self.vertices(name), self.body.hand_spheres(*self.hand_axes(hand))[:, :3] + self.grip(hand)]
                )
                offset = corners[:, :2] - here
                away = float((np.abs(offset @ aside) if ahead else np.linalg.norm(offset, axis=1)).max())
                footprint = footprint.holding(float(corners[:, 2].min()), float(corners[:, 2].max()), away)
        if not self.body.climbs and not self.crosses:
            footprint = footprint.on_wheels()
        without = [*without, *(self.index(n) for n in held if n)]
        if view is not None:
            return self.planner.floor(view, footprint, without)
        return self.planner.floor(self.view, footprint, without, number)

    def away(self, spheres: Float[np.ndarray, "S 4"], palm: Vector) -> float:
        """m, horizontal, that a base would like to be from where a hand puts what it holds, whose spheres these are.

        Args:
          palm: where it faces there: what a gripper points to is not between it and the robot.
        """
        out = -palm[:2]
        if self.body.opening is None or np.linalg.norm(out) < POINTS:
            far = np.linalg.norm(spheres[:, :2], axis=1).max()
        else:
            far = (spheres[:, :2] @ out).max() / np.linalg.norm(out)
        return float(min(AWAY + max(far - ALONG[-1], 0.0), FARTHEST))

    def carry(self, hand: int, name: str = "", grip: Vector | None = None, held: Sequence[str] | None = None) -> Vector:
        """Where a hand carries an object, "": what it holds, in the body's frame: as far ahead as that is wide, on an
        arm farther where it reaches back farther from the hand, and, if the hand floats, so high that what hangs below
        it passes over counters. Two things that would meet are carried apart, each by half of that.

        Args:
          grip: where the hand will hold the object, that is where it is now; None: where it holds it. held: what each
            hand will hold; None: as it is.
        """
        x, y, z = self.body.carry[hand]
        if name := name or self.held[hand]:
            corners = self.vertices(name)
            low, high = corners.min(0), corners.max(0)
            half = float(np.linalg.norm((high - low)[:2])) / 2
            back, yaw = half, self.base[1]
            if self.body.opening is not None and (grip is not None or self.held[hand] == name):
                offset = (self.grip(hand) if grip is None else grip) - corners
                back = max(half, float((offset[:, :2] @ (np.cos(yaw), np.sin(yaw))).max()))
            x = max(x, self.body.trunk[0] + BODY_SPARE + back)
            if self.body.opening is None:
                y = self._apart(hand, name, grip, self.held if held is None else held)
            if self.body.opening is None and self.held[hand] == name and self.held.count(name) == 1:
                z += self._raised(hand, float(low[2]), float(high[2]))
        return np.array([x, y, z])

    def _apart(self, hand: int, name: str, grip: Vector | None, held: Sequence[str]) -> float:
        """y of the grasp point of a hand that floats and carries an object, in the body's frame, m: see `carry`."""
        others = [h for h, n in enumerate(held) if h != hand and n and n != name and not self.domain.fixed(n)]
        y, low, high = self._across(hand, name, grip)
        side = float(np.sign(self.body.carry[hand][1]))
        for other in others:
            there, lowest, highest = self._across(other, held[other], None)
            meets = there + highest - (y + low) if side > 0 else y + high - (there + lowest)
            y += side * min(max(meets + BETWEEN, 0.0), MOST_APART) / 2
        return y

    def _across(self, hand: int, name: str, grip: Vector | None) -> tuple[float, float, float]:
        """y at which a hand carries an object alone, in the middle of the way through a door where it is wide; and from
        there to both sides of the object, m."""
        corners, yaw = self.vertices(name), self.base[1]
        half = float(np.linalg.norm(np.ptp(corners[:, :2], axis=0))) / 2
        y = 0.0 if half > WIDE else float(self.body.carry[hand][1])
        if grip is None and self.held[hand] != name:
            return y, -half, half
        across = (corners - (self.grip(hand) if grip is None else grip))[:, :2] @ (-np.sin(yaw), np.cos(yaw))
        return y, float(across.min()), float(across.max())

    def _raised(self, hand: int, low: float, high: float) -> float:
        """m by which a hand carries what reaches from a height to another higher than other things."""
        grip = float(self.grip(hand)[2])
        if grip - low < TALL:
            return 0.0
        room = HIGHEST - (self.body.stands + float(self.body.carry[hand][2]) + high - grip)
        return float(np.clip(grip - low - HANGS, 0.0, max(min(room, RAISED), 0.0)))

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
        return bool(np.linalg.norm(point - self.shoulder(hand, stance)) <= self.body.reach)

    def shoulder(self, hand: int, stance: Stance) -> Vector:
        """The middle of the sphere that bounds a hand's reach, if the robot stood there; world frame."""
        return self._from(self.body.shoulders[hand], stance)

    def turned_hand(self, hand: int, rotation: Rotation) -> tuple[float, float, float, float]:
        """Orientation of a hand, w-x-y-z, after a rotation."""
        w, x, y, z = matrix_to_quat(rotation @ matrices_on_host(self.hand_quat(hand)[None])[0])
        return (float(w), float(x), float(y), float(z))

    @functools.cached_property
    def walls(self) -> list[int]:
        """Numbers of the walls' objects."""
        tables = self.domain.model.tables
        return [o for o, c in enumerate(tables.object_categories) if c == "walls"]

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
