"""Where a held tool is pressed to clean: the particles that each of its turns covers, and the stance with most of them.

Places of the tool (`ig2mj.planning.held_tools`) are those that cover most of what is left.
"""

from __future__ import annotations

import collections
import dataclasses
from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float, Int

from ig2mj.planning.clearance import Obstacles
from ig2mj.planning.held_tools import PRESSED, HeldTool, Region, regions_of
from ig2mj.planning.moves import UP, ahead, hand_path
from ig2mj.planning.stances import ALL_AROUND, SPREAD, stances
from ig2mj.planning.world import DirtSpot, PlannedWorld, Stance, Vector

STROKES = 8
"""Places of the tool for each stance, at most."""

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
    looked, enough, floats = 0, min(ENOUGH, len(spots)), world.body.opening is None
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
        if looked >= NEAREST and not around and (floats or best is not None):
            break
    return best


def strokes_here(world: PlannedWorld, name: str, tool: str, hand: int, spots: Sequence[DirtSpot]) -> StrokePlan | None:
    """Strokes from where the robot stands, with its hand where it carries the tool; None: there are none."""
    obstacles, loose = world.obstacles([tool], stays=False), not world.domain.fixed(name)
    spots = [s for s in spots if s.normal[2] > LOWEST]
    return _From(HeldTool(world, tool, hand), world.stance, obstacles, loose).plan(spots)


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
        self._floats = held.world.body.opening is None
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
        if not self._floats:  # from one stance, an arm has no way to many of them
            strokes = [stroke for stroke in strokes if self.way(stroke.spot, stroke.turn)]
        elif not any(self.way(stroke.spot, stroke.turn) for stroke in strokes[:FEW]):
            return None
        return StrokePlan(self._stance, strokes) if strokes else None

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
                if turn > OVERS and self._floats:  # over the rim of a bathtub to its near inner side
                    left &= to_robot
                if not left.any():
                    break
                at = region.at_all(pos, normal)
                room = left & (np.linalg.norm(at - shoulder, axis=1) <= self._world.body.reach)
                rows = np.flatnonzero(room)
                room[rows] = self._obstacles.clear_at(spheres, at[rows] + region.lifted * normal[rows])
                if not self._floats and room.any():
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
        way = hand_path(self._obstacles, spheres, self._start, goal, back, follows=follows, strays=True)
        return None if way is None or (follows and not follows.passes([*way, region.at(spot)])) else way


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
