"""Wiping dust and scrubbing stains: a tool that a hand holds is pressed on particles, one place after another.

A tool takes off all particles in the box of its cleaning area, or of itself, while it touches the object
(`ig2mj.states.definitions.cleaning`). Positions of the tool are those that cover most of what is left.
"""

from __future__ import annotations

import collections
import dataclasses
from collections.abc import Callable, Generator, Sequence

import numpy as np
from jaxtyping import Float

from ig2mj.geometry.host_rotations import about_vertical, turn_onto
from ig2mj.planning.cleaning_area import cleaning_area, is_covered
from ig2mj.planning.clearance import Obstacles
from ig2mj.planning.driving import go
from ig2mj.planning.grasping import grasp, put_down_others
from ig2mj.planning.handing_over import hand_over
from ig2mj.planning.moves import UP, Primitive, Program, ahead, carry, hand_path, hand_with, strayed, travel, vector3
from ig2mj.planning.opening import Tried, open_around
from ig2mj.planning.phases import Phase
from ig2mj.planning.placing import bring_out
from ig2mj.planning.stances import stances
from ig2mj.planning.steps import Outcome, Step
from ig2mj.planning.switching import toggle
from ig2mj.planning.world import DirtSpot, PlannedWorld, Rotation, Stance, Vector

ROUNDS, STROKES = 24, 8
"""Stances from which an object is cleaned, and places of the tool for each, at most."""

PRESSED, LIFTED, CLOSE, SLACK = 0.02, 0.06, 0.03, 0.0
"""m that a tool is pressed into a face, and is lifted off it, also where there is less room; by which particles may be
outside of its box."""

PRESSES = 4
"""Agent steps that a tool is pressed: with each the hand is pulled farther into the face."""

RAISED = 0.25
"""m that a tool is lifted before the hand goes back to where it carries it."""

TURNS = (np.pi / 2, -np.pi / 2, np.pi)
"""rad about a face's normal by which a tool is turned where it has no room otherwise."""

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

TRIES = 4
"""Times that a particle is gone for."""

ELSEWHERE = 0.12
"""m between stances from which an object is cleaned."""

BESIDE, MOVED = 0.12, 4
"""m from dirt within which things are moved away where no tool reaches it, and how many at most."""

REGRASPS = 8
"""Times that a tool which was lost is taken again."""


def clean(predicate: str) -> Callable[[PlannedWorld, Step], Primitive]:
    """The primitive that takes dust or stains off an object with a tool that a hand holds."""

    def clean(world: PlannedWorld, step: Step) -> Primitive:
        name, tool = step.arguments
        hand_with(world, tool)
        if predicate == "stained" and not world.facts.holds("soaked", tool):
            return Outcome("no_grasp", f"{tool} is not soaked")
        if world.domain.has(tool, "toggleable") and not world.facts.holds("toggled_on", tool):
            yield from put_down_others(world, tool)
            yield from toggle(True)(world, Step("toggle_on", (tool,)))
        reason, detail, lost, tried = "no_base", f"no dirt of {name} is in reach", 0, collections.Counter[int]()
        visited: list[Stance] = []
        opened, moved = Tried(), set[str]()
        for attempt in range(ROUNDS):
            if not world.facts.holds(predicate, name):
                break
            if tool not in world.held:
                lost += 1
                again = None if lost > REGRASPS else (yield from grasp(world, Step("grasp", (tool,))))
                if again is None or not again.done:
                    return Outcome("slipped", f"the hand lost {tool}", attempts=attempt + 1)
            hand = hand_with(world, tool)
            if world.body.opening is None and is_covered(world, tool, hand):  # a gripper holds a tool by its edge
                yield from put_down_others(world, tool)
                if failed := (yield from hand_over(world, tool, hand)):
                    reason, detail = failed, f"{tool} cannot be taken by the side that does not clean"
                    continue
                hand = hand_with(world, tool)
            spots = [spot for spot in world.dirt(predicate, name) if tried[spot.number] < TRIES]
            spots.sort(key=lambda spot: tried[spot.number])
            plan = _plan(world, tool, hand, spots, visited)
            while plan is None and (yield from open_around(world, name, opened)):
                plan = _plan(world, tool, hand, spots, visited)
            while plan is None and (yield from _clear_away(world, name, tool, spots, moved)) and tool in world.held:
                plan = _plan(world, tool, hand, spots, ())
            if plan is None:
                break
            if strayed(world, hand):
                yield _back(world, hand)
                if tool not in world.held:
                    continue
            visited.append(plan.stance)
            if failed := (yield from go(world, plan.stance)):
                reason, detail = failed, f"no path leads to where the dirt of {name} is in reach"
                tried.update(spot.number for spot in plan.covered)
                continue
            for stroke in plan.strokes:
                tried[stroke.spot.number] += 1
                if not world.facts.holds(predicate, name) or tool not in world.held:
                    break
                if stroke.spot.number not in {spot.number for spot in world.dirt(predicate, name)}:
                    continue
                program = _program(world, tool, hand, stroke)
                if not program and strayed(world, hand):
                    yield _back(world, hand)
                    program = _program(world, tool, hand, stroke) if tool in world.held else []
                if program:
                    reason, detail = (yield program), f"{tool} did not take enough off {name}"
        if tool in world.held:
            yield _back(world, hand_with(world, tool))
        if not world.facts.holds(predicate, name):
            return Outcome()
        return Outcome(reason or "not_true_after", detail)

    return clean


def _clear_away(
    world: PlannedWorld, name: str, tool: str, spots: Sequence[DirtSpot], moved: set[str]
) -> Generator[Program, str, bool]:
    """Puts what stands next to dirt, the nearest first, onto open floor; returns whether there was something that has
    not been moved."""
    if not spots or len(moved) >= MOVED:
        return False
    points = np.array([s.pos + CLOSE * s.normal for s in spots])
    near = list[tuple[float, str]]()
    for other in world.domain.loose:
        if other in (name, tool, *world.held) or other in moved or not world.domain.graspable(other):
            continue
        low, high = world.facts.box(other)
        apart = np.linalg.norm(points - np.clip(points, low, high), axis=1).min()
        if apart < BESIDE:
            near.append((float(apart), other))
    if not near:
        return False
    other = min(near)[1]
    moved.add(other)
    yield from put_down_others(world, tool)
    yield from bring_out(world, other)
    return True


@dataclasses.dataclass(frozen=True, eq=False)
class _Region:
    """Where a held tool cleans when it is turned by `rotation`: corners of the part that cleans, and their box, m from
    the hand's grasp point; `lifted`: m off a face from which on the tool is pressed on it."""

    rotation: Rotation
    corners: Float[np.ndarray, "n 3"]
    low: Vector
    high: Vector
    lifted: float = LIFTED

    @classmethod
    def turned(cls, rotation: Rotation, corners: Float[np.ndarray, "n 3"]) -> _Region:
        """`corners`: as the tool is held now."""
        points = corners @ rotation.T
        return cls(rotation, points, points.min(0), points.max(0))

    def at(self, spot: DirtSpot) -> Vector:
        """Grasp point of the hand when the tool is pressed on a particle."""
        depth = float(np.ptp(self.corners @ spot.normal)) / 2
        return spot.pos + spot.normal * (depth - PRESSED) - (self.low + self.high) / 2

    def above(self, spot: DirtSpot) -> Vector:
        """Grasp point of the hand right before."""
        return self.at(spot) + self.lifted * spot.normal

    def covers(self, grip: Vector, spots: Sequence[DirtSpot]) -> list[DirtSpot]:
        low, high = grip + self.low - SLACK, grip + self.high + SLACK
        return [s for s in spots if (low <= s.pos).all() and (s.pos <= high).all()]


def _regions(world: PlannedWorld, tool: str, hand: int, yaw: float, normal: Vector) -> list[_Region]:
    """Turns of a tool with its box, for a robot that looks along `yaw`, rad: with its cleaning area towards the face;
    as it is carried; of a hand that floats, turned about the normal and tilted, too, and close to the face, where there
    is less room. A tilted tool cleans in a larger box."""
    area, out = cleaning_area(world, tool)
    points = (world.vertices(tool) if area is None else area) - world.grip(hand)
    carried = about_vertical(yaw - world.base[1])
    facing = carried if area is None else turn_onto(carried @ out, -normal) @ carried
    rotations = [facing] if area is None else [facing, carried]
    if world.body.opening is not None:
        return [_Region.turned(r, points) for r in rotations]
    rotations += [_about(normal, angle) @ facing for angle in TURNS]
    across = np.cross(normal, UP) if abs(normal[2]) < 0.9 else np.array([-np.sin(yaw), np.cos(yaw), 0.0])
    across = across / np.linalg.norm(across)
    tilts = [_about(axis, angle) for axis in (across, np.cross(normal, across)) for angle in TILTS]
    rotations += [tilt @ facing for tilt in tilts] + [tilt @ _about(normal, np.pi / 2) @ facing for tilt in tilts]
    found = [_Region.turned(r, points) for r in rotations]
    return found + [dataclasses.replace(r, lifted=CLOSE) for r in found]


def _about(axis: Vector, angle: float) -> Rotation:
    """Rotation about a unit vector, rad."""
    c, s = np.cos(angle), np.sin(angle)
    x, y, z = axis
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + s * k + (1 - c) * (k @ k)


@dataclasses.dataclass(frozen=True, eq=False)
class _Stroke:
    """A particle that a tool is pressed on, the number of its turn, and all particles that it takes off there."""

    spot: DirtSpot
    turn: int
    covered: list[DirtSpot]


@dataclasses.dataclass(frozen=True, eq=False)
class _CleanPlan:
    """From where a tool is pressed on particles one after another."""

    stance: Stance
    strokes: list[_Stroke]

    @property
    def covered(self) -> list[DirtSpot]:
        return [spot for stroke in self.strokes for spot in stroke.covered]


def _plan(
    world: PlannedWorld, tool: str, hand: int, spots: Sequence[DirtSpot], visited: Sequence[Stance]
) -> _CleanPlan | None:
    """The stance from which most particles are in reach, of those near the nearest ones that were not visited."""
    floor, obstacles = world.floor(), world.obstacles([tool])
    spots = [s for s in spots if s.normal[2] > LOWEST]
    away = world.away(world.spheres(*world.hand_axes(hand), holding=tool, hand=hand))
    best: _CleanPlan | None = None
    seen = [*visited]
    looked = 0
    for aim in spots:
        known = len(seen)
        for stance in stances(world, hand, aim.pos + PRESSED * aim.normal, floor, away, STANCES):
            if any(np.linalg.norm(np.subtract(stance.xy, v.xy)) < ELSEWHERE for v in seen):
                continue
            seen.append(stance)
            plan = _From(world, tool, hand, stance, obstacles).plan(spots)
            if plan is not None and (best is None or len(plan.covered) > len(best.covered)):
                best = plan
            if best is not None and len(best.covered) >= ENOUGH:
                return best
        looked += len(seen) > known
        if looked == NEAREST:
            break
    return best


class _From:
    """Strokes of a tool from one stance."""

    def __init__(self, world: PlannedWorld, tool: str, hand: int, stance: Stance, obstacles: Obstacles):
        """`obstacles`: all but the tool."""
        self._world, self._tool, self._hand, self._stance = world, tool, hand, stance
        self._obstacles = obstacles.about(stance.xy, *world.body.trunk)
        self._start = world.carried(hand, stance)
        self._known: dict[tuple[float, ...], list[tuple[_Region, np.ndarray]]] = {}

    def plan(self, spots: Sequence[DirtSpot]) -> _CleanPlan | None:
        """Places of the tool that cover most particles in reach, each next to the one before; None: the hand has a way
        to none of the first ones."""
        far = self._world.body.reach + FAR
        spots = [s for s in spots if np.linalg.norm(s.pos[:2] - self._stance.xy) < far]
        near = [(s, turn) for s in spots if (turn := self._turn(s)) >= 0]
        left, strokes = [s for s, _ in near], list[_Stroke]()
        turns = {s.number: turn for s, turn in near}
        while left and len(strokes) < STROKES:
            sets = []
            for s in left:
                region, _ = self._turned(s.normal)[turns[s.number]]
                sets.append(region.covers(region.at(s), spots))
            best = int(np.argmax([len(c) for c in sets]))
            gone = {s.number for s in sets[best]} | {left[best].number}
            taken = {s.number for stroke in strokes for s in stroke.covered}
            own = [s for s in spots if s.number in gone - taken]
            strokes.append(_Stroke(left[best], turns[left[best].number], own))
            left = [s for s in left if s.number not in gone]
        strokes = _one_after_another(strokes)
        if not any(self.way(stroke.spot, stroke.turn) for stroke in strokes[:FEW]):
            return None
        return _CleanPlan(self._stance, strokes)

    def _turned(self, normal: Vector) -> list[tuple[_Region, np.ndarray]]:
        """Turns of the tool for faces with a normal, and spheres of the hand with it."""
        key = tuple(np.round(normal, 2))
        if key not in self._known:
            world, tool, hand = self._world, self._tool, self._hand
            regions = _regions(world, tool, hand, self._stance.yaw, normal)
            self._known[key] = [(r, _spheres(world, tool, hand, r)) for r in regions]
        return self._known[key]

    def _turn(self, spot: DirtSpot) -> int:
        """The first turn of the tool in which the hand has room at a particle; -1: there is none."""
        here = np.array(self._stance.xy)
        to_robot = spot.normal[2] > 0.5 or (here - spot.pos[:2]) @ spot.normal[:2] > 0
        if not to_robot and spot.pos[2] >= OVER_TOP:
            return -1
        for turn, (region, spheres) in enumerate(self._turned(spot.normal)):
            if not self._world.reaches(self._hand, self._stance, region.at(spot)):
                continue
            if not self._obstacles.clear(spheres + np.array([*region.above(spot), 0.0])):
                continue
            if to_robot or self.way(spot, turn):  # over the rim of a bathtub to its near inner side
                return turn
            if turn >= OVERS:
                break
        return -1

    def way(self, spot: DirtSpot, turn: int) -> list[Vector] | None:
        """The hand's way to above a particle; None: there is none."""
        world, hand = self._world, self._hand
        region, spheres = self._turned(spot.normal)[turn]
        follows = world.follows(hand, world.turned_hand(hand, region.rotation), self._obstacles, self._stance)
        back = [UP, -ahead(self._stance.yaw), spot.normal]
        return hand_path(self._obstacles, spheres, self._start, region.above(spot), back, follows=follows)


def _one_after_another(strokes: list[_Stroke]) -> list[_Stroke]:
    """Upper sides first, from one place to the next."""
    left = sorted(strokes, key=lambda stroke: (stroke.spot.normal[2] < 0.5, -round(float(stroke.spot.pos[2]), 1)))
    ordered = left[:1]
    left = left[1:]
    while left:
        level = [s for s in left if abs(s.spot.pos[2] - left[0].spot.pos[2]) < 0.1]
        nearest = min(level, key=lambda s: float(np.linalg.norm(s.spot.pos - ordered[-1].spot.pos)))
        left.remove(nearest)
        ordered.append(nearest)
    return ordered


def _spheres(world: PlannedWorld, tool: str, hand: int, region: _Region) -> Float[np.ndarray, "S 4"]:
    axes = world.hand_axes(hand, region.rotation)
    return world.spheres(*axes, holding=tool, hand=hand, rotation=region.rotation)


def _program(world: PlannedWorld, tool: str, hand: int, stroke: _Stroke) -> Program:
    """Presses the tool on a particle and lifts it; nothing where the hand has no way there. The planned turn of the
    tool is tried first."""
    obstacles, stance, spot = world.obstacles([tool], world.stance), world.stance, stroke.spot
    regions = _regions(world, tool, hand, stance.yaw, spot.normal)
    planned = regions[min(stroke.turn, len(regions) - 1)]
    if world.body.opening is not None:
        regions = [planned, *(_turned(world, tool, hand, planned, spot.normal, angle) for angle in TURNS)]
    ways = 0
    for region in [planned, *(r for r in regions if r is not planned)]:
        if not world.reaches(hand, stance, region.at(spot)):
            continue
        spheres = _spheres(world, tool, hand, region)
        if not obstacles.clear(spheres + np.array([*region.above(spot), 0.0])):
            continue
        follows = world.follows(hand, world.turned_hand(hand, region.rotation), obstacles)
        back = [UP, -ahead(stance.yaw), spot.normal]
        way = hand_path(obstacles, spheres, world.grip(hand), region.above(spot), back, follows=follows)
        if way is not None:
            return _press(world, tool, hand, region, spot, way)
        ways += 1
        if ways == FEW:
            break
    return []


def _turned(world: PlannedWorld, tool: str, hand: int, region: _Region, normal: Vector, angle: float) -> _Region:
    """The same tool turned about the normal of a face, rad."""
    area, _ = cleaning_area(world, tool)
    points = (world.vertices(tool) if area is None else area) - world.grip(hand)
    return _Region.turned(_about(normal, angle) @ region.rotation, points)


def _back(world: PlannedWorld, hand: int) -> Program:
    """Lifts the tool off where it was pressed, to where the hand carries it: ways are planned from there."""
    up = vector3(world.grip(hand) + RAISED * UP)
    return [Phase(hand=hand, pos=up, tolerance=0.04, limit=15, after=""), carry(world, hand)]


def _press(
    world: PlannedWorld, tool: str, hand: int, region: _Region, spot: DirtSpot, way: Sequence[Vector]
) -> Program:
    keeps = world.index(tool)
    quat, target = world.turned_hand(hand, region.rotation), region.at(spot)
    return [
        *travel(hand, way, quat, keeps=keeps),
        Phase(
            hand=hand, pos=vector3(target), quat=quat, keeps=keeps, tolerance=0.004, limit=PRESSES, after="", speed=0.03
        ),
        Phase(hand=hand, pos=vector3(way[-1]), keeps=keeps, tolerance=0.03, limit=12, after=""),
    ]
