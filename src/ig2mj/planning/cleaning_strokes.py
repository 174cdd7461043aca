"""Where a held tool is pressed to clean: its turns, the particles that each covers, and the stance with most of them.

A tool takes off all particles in the box of its cleaning area, or of itself, while it touches the object
(`ig2mj.states.definitions.cleaning`). Places of the tool are those that cover most of what is left.
"""

from __future__ import annotations

import collections
import dataclasses
from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float, Int

from ig2mj.geometry.host_rotations import about_vertical, turn_onto
from ig2mj.planning.cleaning_area import cleaning_area
from ig2mj.planning.clearance import Obstacles
from ig2mj.planning.grasps import OBLIQUE
from ig2mj.planning.moves import UP, ahead, hand_path
from ig2mj.planning.stances import ALL_AROUND, SPREAD, stances
from ig2mj.planning.world import DirtSpot, PlannedWorld, Rotation, Stance, Vector

STROKES = 8
"""Places of the tool for each stance, at most."""

PRESSED, LIFTED, CLOSE, SLACK = 0.02, 0.06, 0.03, 0.0
"""m that a tool is pressed into a face, and is lifted off it, also where there is less room; by which particles may be
outside of its box."""

TURNS = (np.pi / 2, -np.pi / 2, np.pi)
"""rad about a face's normal by which a tool is turned where it has no room otherwise."""

FIRST = 0.002
"""m by which the rest of a tool may come to a face before the part that cleans: farther away that touches nothing."""

SHIFTED, SHIFTED_TURNS = 0.4, 2
"""Share of a tool's box, along the face, by which its middle is off a particle that has no room around it; and turns in
which it is shifted."""

BACKWARDS, ARM_TURNS = -0.2, 6
"""Cosine of the angle between where a gripper on an arm points and where it likes to, below which it does not clean;
and turns of its tool that are tried at most."""

FLAT, FLAT_TURNS = 0.3, 4
"""Times its width that a tool is thick at most which is pressed on faces with its flat side, and turns about a face's
normal in which a gripper does so, of those that are tried."""

TILTS = (-0.8, 0.8)
"""rad about an axis in a face by which a tool is tilted."""

LOWEST = -0.3
"""Smallest z of the normal of a face that is cleaned."""

OVER_TOP = 1.0
"""m, height of dirt up to which a hand reaches over what it is on to the side that looks away."""

NEAREST, STANCES, FEW = 8, 4, 4
"""Particles that stances are looked for, stances for each, and strokes of each of which one has to have a way."""

FAR = 0.6
"""m beyond a hand's reach from which on particles are not looked at."""

ENOUGH, OVERS = 6, 3
"""Particles that are enough for a stance, and turns of a tool in which ways over a rim are looked for."""

OPEN, ROOM, HIDDEN, HIDDEN_WORTH = np.array([0.12, 0.2, 0.3]), 0.06, 2, 0.25
"""m before a face, and around it, that have to be free for a tool to come straight to it; particles that a stroke below
something has to cover more than others to be chosen, and what these count."""

EAST = np.array([1.0, 0.0, 0.0])

ASKED = 3
"""Particles of which it is asked whether an arm brings a tool to them, for each turn of the tool."""

ELSEWHERE = 0.12
"""m between stances from which an object is cleaned."""

LITTLE = 0.6
"""Share of the radii of hand and tool that needs room at stances all around, where the nearest ones do not do."""

ALIKE, LEVEL = 0.9, 0.5
"""Cosine of the angle between normals of the same face; z of the normal of a face that one stands in front of, at
most."""


@dataclasses.dataclass(frozen=True, eq=False)
class Region:
    """Where a held tool cleans when it is turned by `rotation`: corners of the part that cleans, and their box, m from
    the hand's grasp point.

    Attributes:
      lifted: m off a face from which on the tool is pressed on it. shift: m from the particle that it is pressed on to
        its middle, along the face.
    """

    rotation: Rotation
    corners: Float[np.ndarray, "n 3"]
    low: Vector
    high: Vector
    lifted: float = LIFTED
    shift: Vector = dataclasses.field(default_factory=lambda: np.zeros(3))

    @classmethod
    def turned(cls, rotation: Rotation, corners: Float[np.ndarray, "n 3"]) -> Region:
        """`corners`: as the tool is held now."""
        points = corners @ rotation.T
        return cls(rotation, points, points.min(0), points.max(0))

    def at(self, spot: DirtSpot) -> Vector:
        """Grasp point of the hand when the tool is pressed on a particle."""
        return self.at_all(spot.pos[None], spot.normal[None])[0]

    def at_all(self, pos: Float[np.ndarray, "n 3"], normal: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 3"]:
        """`at` of many particles."""
        depth = np.ptp(normal @ self.corners.T, axis=1) / 2
        return pos + normal * (depth - PRESSED)[:, None] + self.shift - (self.low + self.high) / 2

    def shifted(self, normal: Vector) -> list[Region]:
        """The same with the particle near each side, and each corner, of its box: where something stands next to it."""
        across, along = (axis * self._far(axis) for axis in axes_along(normal))
        steps = [(a, b) for a in (0, 1, -1) for b in (0, 1, -1)][1:]
        return [dataclasses.replace(self, shift=SHIFTED * (a * across + b * along)) for a, b in steps]

    def _far(self, axis: Vector) -> float:
        """m along an axis from one side of its box to the other, through the middle."""
        return float(((self.high - self.low) / np.maximum(np.abs(axis), 1e-6)).min())

    def above(self, spot: DirtSpot) -> Vector:
        """Grasp point of the hand right before."""
        return self.at(spot) + self.lifted * spot.normal

    def box(self, grip: Vector) -> tuple[Vector, Vector]:
        """Lower and upper corner of what it cleans with the hand's grasp point at a place."""
        return grip + self.low - SLACK, grip + self.high + SLACK

    def swept(self, spot: DirtSpot) -> tuple[Vector, Vector]:
        """Lower and upper corner of what it cleans from where it comes to a particle's face, which stops it, to where
        it would be pressed into it: particles of that face, in front of a thin tool, are between."""
        low, high = self.box(self.at(spot))
        back = PRESSED * spot.normal
        return np.minimum(low, low + back), np.maximum(high, high + back)


class HeldTool:
    """A tool as a hand holds it now: the part that cleans, and spheres of hand and tool, m from the grasp point.

    Attributes:
      flat: the direction that the flat side of a tool faces which cleans with all of it; None: it has none.
    """

    flat: Vector | None = None

    def __init__(self, world: PlannedWorld, tool: str, hand: int, share: float = 1.0):
        """`share`: of the spheres' radii that need room."""
        self.world, self.tool, self.hand, self.share = world, tool, hand, share
        area, self.out = cleaning_area(world, tool)
        self.has_area = area is not None
        self.whole = world.vertices(tool) - world.grip(hand)
        self.corners = self.whole if area is None else area - world.grip(hand)
        self._spheres = world.spheres(*world.hand_axes(hand), holding=tool, hand=hand) * (1.0, 1.0, 1.0, share)
        self.flat = None if self.has_area else _flat_side(self.whole)

    def spheres(self, rotation: Rotation) -> Float[np.ndarray, "S 4"]:
        """Of hand and tool, if they were turned."""
        return np.concatenate([self._spheres[:, :3] @ rotation.T, self._spheres[:, 3:]], axis=1)


def _flat_side(corners: Float[np.ndarray, "n 3"]) -> Vector | None:
    """The direction that the flat side of a tool faces which is away from the hand; None: it has no flat side.

    Args:
      corners: m from the hand's grasp point.
    """
    middle = corners.mean(0)
    axes = np.linalg.svd(corners - middle, full_matrices=False)[2]
    wide, thin = (float(np.ptp(corners @ axis)) for axis in axes[1:])
    if thin > FLAT * wide:
        return None
    return axes[2] if float(middle @ axes[2]) >= 0.0 else -axes[2]


def regions_of(held: HeldTool, yaw: float, normal: Vector) -> list[Region]:
    """Turns of a tool with its box, for a robot that looks along `yaw`, rad: with its cleaning area towards the face;
    as it is carried; of a hand that floats, turned about the normal and tilted, too, and close to the face, where there
    is less room. A tilted tool cleans in a larger box. Only those count in which the part that cleans comes to the face
    first: the others touch nothing with it. Then come the first of them with the particle near the rim of the box.
    """
    found = _turned_regions(held, yaw, normal)
    late = [float((held.whole @ (r.rotation.T @ normal)).min() - (r.corners @ normal).min()) for r in found]
    enough = min(-FIRST, max(late))
    first = [r for r, by in zip(found, late, strict=True) if by >= enough]
    near = [r for r in first if r.lifted == first[0].lifted]
    off = [shifted for r in near[:SHIFTED_TURNS] for shifted in r.shifted(normal)]
    return [*first, *off]


def _turned_regions(held: HeldTool, yaw: float, normal: Vector) -> list[Region]:
    """Those with the particle in the middle."""
    world, points = held.world, held.corners
    carried = about_vertical(yaw - world.base[1])
    facing = turn_onto(carried @ held.out, -normal) @ carried if held.has_area else carried
    rotations = [facing, carried] if held.has_area else [facing]
    if world.body.opening is not None:
        return [Region.turned(r, points) for r in _of_arm(held, yaw, normal, facing, carried)]
    rotations += [turn_about(normal, angle) @ facing for angle in TURNS]
    tilts = [turn_about(axis, angle) for axis in axes_along(normal, aside(yaw)) for angle in TILTS]
    rotations += [tilt @ facing for tilt in tilts] + [tilt @ turn_about(normal, np.pi / 2) @ facing for tilt in tilts]
    found = [Region.turned(r, points) for r in rotations]
    return found + [dataclasses.replace(r, lifted=CLOSE) for r in found]


def _of_arm(held: HeldTool, yaw: float, normal: Vector, facing: Rotation, carried: Rotation) -> list[Rotation]:
    """Turns of a tool on an arm: about the normal, and of one that cleans with all of it also with the gripper towards
    the face, and before these with its flat side on the face; those first in which the gripper points about where it
    likes to."""
    _, palm = held.world.hand_axes(held.hand)
    aim = OBLIQUE[0] * ahead(yaw) - OBLIQUE[1] * UP

    def turned(bases: Sequence[Rotation]) -> list[Rotation]:
        found = [turn_about(normal, k * np.pi / 4) @ base for base in bases for k in range(8)]
        score = [round(float(r @ palm @ aim), 1) for r in found]
        order = sorted(range(len(found)), key=lambda k: -score[k])
        return [found[k] for k in order if score[k] > BACKWARDS]

    flat = [] if held.flat is None else turned([turn_onto(carried @ held.flat, -normal) @ carried])[:FLAT_TURNS]
    bases = [facing] if held.has_area else [facing, turn_onto(carried @ palm, -normal) @ carried]
    return [*flat, *turned(bases)][:ARM_TURNS] or [facing]


def aside(yaw: float) -> Vector:
    """The horizontal direction to the left of a robot that looks along `yaw`, rad."""
    return np.array([-np.sin(yaw), np.cos(yaw), 0.0])


def axes_along(normal: Vector, level: Vector = EAST) -> tuple[Vector, Vector]:
    """Two axes along a face at right angles, the first one horizontal; of one that is about level, about `level`."""
    across = np.cross(normal, UP) if abs(normal[2]) < 0.9 else level - (level @ normal) * normal
    across = across / np.linalg.norm(across)
    return across, np.cross(normal, across)


def turn_about(axis: Vector, angle: float) -> Rotation:
    """Rotation about a unit vector, rad."""
    c, s = np.cos(angle), np.sin(angle)
    x, y, z = axis
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + s * k + (1 - c) * (k @ k)


@dataclasses.dataclass(frozen=True, eq=False)
class Stroke:
    """A particle that a tool is pressed on, the number of its turn, and all particles that it takes off there.

    `roofed`: it is on a loose thing with something before the face, so that the tool easily pushes the thing over.
    `share`: of the radii of hand and tool that has room there.
    """

    spot: DirtSpot
    turn: int
    covered: list[DirtSpot]
    roofed: bool = False
    share: float = 1.0


@dataclasses.dataclass(frozen=True, eq=False)
class StrokePlan:
    """From where a tool is pressed on particles one after another."""

    stance: Stance
    strokes: list[Stroke]

    @property
    def covered(self) -> list[DirtSpot]:
        return [spot for stroke in self.strokes for spot in stroke.covered]

    @property
    def worth(self) -> float:
        """Particles, of which those below something count less."""
        return sum(len(s.covered) * (HIDDEN_WORTH if s.roofed else 1.0) for s in self.strokes)


def plan_strokes(
    world: PlannedWorld,
    name: str,
    tool: str,
    hand: int,
    spots: Sequence[DirtSpot],
    visited: Sequence[Stance],
    around: bool = False,
) -> StrokePlan | None:
    """The stance from which most particles are in reach, of those near the nearest ones that were not visited.

    Args:
      around: of those all around the object, in front of each of its faces that has particles; there hand and tool
        may touch what is next to them.
    """
    floor, obstacles = world.floor(), world.obstacles([tool], stays=False)
    spots = [s for s in spots if s.normal[2] > LOWEST]
    axes = world.hand_axes(hand)
    away = world.away(world.spheres(*axes, holding=tool, hand=hand), axes[1])
    held, loose = HeldTool(world, tool, hand, LITTLE if around else 1.0), not world.domain.fixed(name)
    best: StrokePlan | None = None
    seen = [*visited]
    looked, enough = 0, min(ENOUGH, len(spots))
    aims, most, apart = (spread(spots), ALL_AROUND, SPREAD) if around else (spots, STANCES, ELSEWHERE)
    for aim in aims:
        known = len(seen)
        before = (aim.pos, aim.normal) if around and abs(aim.normal[2]) < LEVEL else None
        for stance in stances(world, hand, aim.pos + PRESSED * aim.normal, floor, away, most, before=before):
            near = [np.linalg.norm(np.subtract(stance.xy, v.xy)) for v in seen]
            if min(near[: len(visited)], default=np.inf) < ELSEWHERE or min(near, default=np.inf) < apart:
                continue
            seen.append(stance)
            plan = _From(held, stance, obstacles, loose).plan(spots)
            if plan is not None and (best is None or plan.worth > best.worth):
                best = plan
            if best is not None and best.worth >= enough:
                return best
        looked += len(seen) > known
        if looked == NEAREST and not around:
            break
    return best


def spread(spots: Sequence[DirtSpot]) -> list[DirtSpot]:
    """Particles of which none looks where one before it does that is less than `SPREAD` away."""
    found = list[DirtSpot]()
    for spot in spots:
        if not any(f.normal @ spot.normal > ALIKE and np.linalg.norm(f.pos - spot.pos) < SPREAD for f in found):
            found.append(spot)
    return found


class _From:
    """Strokes of a tool from one stance."""

    def __init__(self, held: HeldTool, stance: Stance, obstacles: Obstacles, loose: bool):
        """`obstacles`: all but the tool. loose: what is cleaned can move."""
        self._loose = loose
        self._held, self._world, self._hand, self._stance = held, held.world, held.hand, stance
        self._obstacles = held.world.standing(obstacles, stance, held.hand)
        self._start = held.world.carried(held.hand, stance)
        self._known: dict[tuple[float, ...], list[tuple[Region, np.ndarray]]] = {}

    def plan(self, spots: Sequence[DirtSpot]) -> StrokePlan | None:
        """Places of the tool that cover most particles in reach, each next to the one before; None: the hand has a way
        to none of the first ones."""
        far = self._world.body.reach + FAR
        spots = [s for s in spots if np.linalg.norm(s.pos[:2] - self._stance.xy) < far]
        turns = self._turns(spots)
        near = np.flatnonzero(turns >= 0)
        if not len(near):
            return None
        roofed = self._roofed([spots[k] for k in near]) if self._loose else np.zeros(len(near), bool)
        pos = np.array([s.pos for s in spots])
        low, high = np.zeros((len(near), 3)), np.zeros((len(near), 3))
        for row, k in enumerate(near):
            region, _ = self._turned(spots[k].normal)[turns[k]]
            low[row], high[row] = region.swept(spots[k])
        covers = np.all((low[:, None] <= pos) & (pos <= high[:, None]), axis=-1)
        covers[np.arange(len(near)), near] = True
        left, strokes = np.ones(len(near), bool), list[Stroke]()
        taken = np.zeros(len(spots), bool)
        while left.any() and len(strokes) < STROKES:
            best = int(np.argmax(np.where(left, covers.sum(1) - HIDDEN * roofed, -np.inf)))
            own = covers[best] & ~taken
            spot = spots[near[best]]
            covered = [spots[k] for k in np.flatnonzero(own)]
            strokes.append(Stroke(spot, int(turns[near[best]]), covered, bool(roofed[best]), self._held.share))
            taken |= own
            left &= ~covers[best][near]
        strokes = one_after_another(strokes)
        if not any(self.way(stroke.spot, stroke.turn) for stroke in strokes[:FEW]):
            return None
        return StrokePlan(self._stance, strokes)

    def _roofed(self, spots: Sequence[DirtSpot]) -> Bool[np.ndarray, "n"]:
        """Before which particles something is in the way of a tool that comes straight to the face."""
        pos, normal = np.array([s.pos for s in spots]), np.array([s.normal for s in spots])
        away = self._obstacles.distance(pos[:, None] + normal[:, None] * OPEN[:, None])
        return np.asarray(away.min(axis=1) < ROOM)

    def _turned(self, normal: Vector) -> list[tuple[Region, np.ndarray]]:
        """Turns of the tool for faces with a normal, and spheres of the hand with it."""
        key = tuple(np.round(normal, 2))
        if key not in self._known:
            regions = regions_of(self._held, self._stance.yaw, normal)
            self._known[key] = [(r, self._held.spheres(r.rotation)) for r in regions]
        return self._known[key]

    def _turns(self, spots: Sequence[DirtSpot]) -> Int[np.ndarray, "n"]:
        """The first turn of the tool in which the hand has room at each particle; -1: there is none."""
        found = np.full(len(spots), -1)
        here, shoulder = np.array(self._stance.xy), self._world.shoulder(self._hand, self._stance)
        groups = collections.defaultdict[tuple, list[int]](list)
        for k, s in enumerate(spots):
            groups[tuple(np.round(s.normal, 2))].append(k)
        for members in groups.values():
            pos = np.array([spots[k].pos for k in members])
            normal = np.array([spots[k].normal for k in members])
            to_robot = (normal[:, 2] > 0.5) | (((here - pos[:, :2]) * normal[:, :2]).sum(1) > 0)
            left = to_robot | (pos[:, 2] < OVER_TOP)
            for turn, (region, spheres) in enumerate(self._turned(normal[0])):
                if turn > OVERS:  # over the rim of a bathtub to its near inner side
                    left &= to_robot
                if not left.any():
                    break
                at = region.at_all(pos, normal)
                room = left & (np.linalg.norm(at - shoulder, axis=1) <= self._world.body.reach)
                rows = np.flatnonzero(room)
                room[rows] = self._obstacles.clear_at(spheres, at[rows] + region.lifted * normal[rows])
                if self._world.body.opening is not None and room.any():
                    room = self._reached(spots, members, room, turn, np.linalg.norm(at - shoulder, axis=1))
                for row in np.flatnonzero(room & ~to_robot):
                    room[row] = bool(self.way(spots[members[row]], turn))
                found[np.array(members)[room]] = turn
                left &= ~room
        return found

    def _reached(
        self,
        spots: Sequence[DirtSpot],
        members: Sequence[int],
        room: Bool[np.ndarray, "n"],
        turn: int,
        far: Float[np.ndarray, "n"],
    ) -> Bool[np.ndarray, "n"]:
        """Above which of some particles with room an arm brings the tool, turned so; `ASKED` of them are looked at.

        Args:
          far: m from the shoulder to the grasp point at each.
        """
        rows, reached = np.flatnonzero(room), np.zeros(len(room), bool)
        rows = rows[np.argsort(far[rows], kind="stable")]
        quat = self._world.turned_hand(self._hand, self._turned(spots[members[rows[0]]].normal)[turn][0].rotation)
        follows = self._world.follows(self._hand, quat, self._obstacles, self._stance)
        for row in rows[np.unique(np.linspace(0, len(rows) - 1, ASKED).astype(int))]:
            spot = spots[members[row]]
            region, _ = self._turned(spot.normal)[turn]
            reached[row] = follows is None or follows.reaches(region.above(spot))
        return reached

    def way(self, spot: DirtSpot, turn: int) -> list[Vector] | None:
        """The hand's way to above a particle; None: there is none."""
        world, hand = self._world, self._hand
        region, spheres = self._turned(spot.normal)[turn]
        follows = world.follows(hand, world.turned_hand(hand, region.rotation), self._obstacles, self._stance)
        back = [UP, -ahead(self._stance.yaw), spot.normal]
        goal = region.above(spot)
        return hand_path(self._obstacles, spheres, self._start, goal, back, follows=follows, strays=True)


def one_after_another(strokes: list[Stroke]) -> list[Stroke]:
    """Upper sides first, from one place to the next."""
    left = sorted(strokes, key=lambda s: (s.roofed, s.spot.normal[2] < 0.5, -round(float(s.spot.pos[2]), 1)))
    ordered = left[:1]
    left = left[1:]
    while left:
        level = [s for s in left if s.roofed == left[0].roofed and abs(s.spot.pos[2] - left[0].spot.pos[2]) < 0.1]
        nearest = min(level, key=lambda s: float(np.linalg.norm(s.spot.pos - ordered[-1].spot.pos)))
        left.remove(nearest)
        ordered.append(nearest)
    return ordered
