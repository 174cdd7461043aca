"""Wiping dust and scrubbing stains: a tool that a hand holds is pressed on particles, one place after another.

A tool takes off all particles in the box of its cleaning area, or of itself, while it touches the object
(`ig2mj.states.definitions.cleaning`). Positions of the tool are those that cover most of what is left.
"""

from __future__ import annotations

import collections
import dataclasses
from collections.abc import Callable, Sequence

import numpy as np
from jaxtyping import Float

from ig2mj.geometry.host_rotations import about_vertical, turn_onto
from ig2mj.geometry.poses import matrices_on_host
from ig2mj.planning.bodies import Follower
from ig2mj.planning.clearance import Obstacles
from ig2mj.planning.driving import go
from ig2mj.planning.grasping import grasp
from ig2mj.planning.handing_over import hand_over
from ig2mj.planning.moves import UP, Primitive, Program, ahead, carry, hand_path, hand_with, strayed, travel, vector3
from ig2mj.planning.opening import Tried, open_around
from ig2mj.planning.phases import Phase
from ig2mj.planning.stances import stances
from ig2mj.planning.steps import Outcome, Step
from ig2mj.planning.switching import toggle
from ig2mj.planning.world import DirtSpot, PlannedWorld, Rotation, Stance, Vector

ROUNDS, STROKES = 24, 8
"""Stances from which an object is cleaned, and places of the tool for each, at most."""

PRESSED, LIFTED, SLACK = 0.02, 0.06, 0.01
"""m that a tool is pressed into a face, and is lifted off it; by which particles may be outside of its box."""

PRESSES = 4
"""Agent steps that a tool is pressed: with each the hand is pulled farther into the face."""

RAISED = 0.25
"""m that a tool is lifted before the hand goes back to where it carries it."""

TURNS = (np.pi / 2, -np.pi / 2, np.pi)
"""rad about a face's normal by which a tool is turned where it has no room otherwise."""

LOWEST = -0.3
"""Smallest z of the normal of a face that is cleaned."""

OVER_TOP = 1.0
"""m, height of dirt up to which a hand reaches over what it is on to the side that looks away."""

NEAREST, STANCES, FEW = 8, 4, 4
"""Particles that stances are looked for, stances for each, and strokes of each of which one has to have a way."""

TRIES = 4
"""Times that a particle is gone for."""

ELSEWHERE = 0.12
"""m between stances from which an object is cleaned."""

REGRASPS = 8
"""Times that a tool which was lost is taken again."""

COVERED = 0.5
"""Cosine of the angle between where the hand is and where the cleaning area faces, above which the hand covers it."""


def clean(predicate: str) -> Callable[[PlannedWorld, Step], Primitive]:
    """The primitive that takes dust or stains off an object with a tool that a hand holds."""

    def clean(world: PlannedWorld, step: Step) -> Primitive:
        name, tool = step.arguments
        hand_with(world, tool)
        if predicate == "stained" and not world.facts.holds("soaked", tool):
            return Outcome("no_grasp", f"{tool} is not soaked")
        if world.domain.has(tool, "toggleable") and not world.facts.holds("toggled_on", tool):
            yield from toggle(True)(world, Step("toggle_on", (tool,)))
        reason, detail, lost, tried = "no_base", f"no dirt of {name} is in reach", 0, collections.Counter[int]()
        visited: list[Stance] = []
        opened = Tried()
        for attempt in range(ROUNDS):
            if not world.facts.holds(predicate, name):
                break
            if tool not in world.held:
                lost += 1
                again = None if lost > REGRASPS else (yield from grasp(world, Step("grasp", (tool,))))
                if again is None or not again.done:
                    return Outcome("slipped", f"the hand lost {tool}", attempts=attempt + 1)
            hand = hand_with(world, tool)
            if _is_covered(world, tool, hand):
                if all(world.held):
                    return Outcome("no_grasp", f"the hand covers the side of {tool} that cleans, and none is free")
                if failed := (yield from hand_over(world, tool, hand)):
                    reason, detail = failed, f"{tool} cannot be taken by the side that does not clean"
                    continue
                hand = hand_with(world, tool)
            spots = [spot for spot in world.dirt(predicate, name) if tried[spot.number] < TRIES]
            spots.sort(key=lambda spot: tried[spot.number])
            plan = _plan(world, tool, hand, spots, visited)
            while plan is None and (yield from open_around(world, name, opened)):
                plan = _plan(world, tool, hand, spots, visited)
            if plan is None:
                break
            if strayed(world, hand):
                yield _back(world, hand)
                if tool not in world.held:
                    continue
            visited.append(plan.stance)
            if failed := (yield from go(world, plan.stance)):
                reason, detail = failed, f"no way leads to where the dirt of {name} is in reach"
                tried.update(spot.number for spot in plan.covered)
                continue
            for stroke in plan.strokes:
                tried.update(spot.number for spot in stroke)
                if not world.facts.holds(predicate, name) or tool not in world.held:
                    break
                program = _program(world, tool, hand, plan, stroke[0])
                if not program and strayed(world, hand):
                    yield _back(world, hand)
                    program = _program(world, tool, hand, plan, stroke[0]) if tool in world.held else []
                if program:
                    reason, detail = (yield program), f"{tool} did not take enough off {name}"
        if tool in world.held:
            yield _back(world, hand_with(world, tool))
        if not world.facts.holds(predicate, name):
            return Outcome()
        return Outcome(reason or "not_true_after", detail)

    return clean


@dataclasses.dataclass(frozen=True, eq=False)
class _Region:
    """Where a held tool cleans when it is turned by `rotation`: corners of the part that cleans, and their box, m from
    the hand's grasp point."""

    rotation: Rotation
    corners: Float[np.ndarray, "n 3"]
    low: Vector
    high: Vector

    @classmethod
    def turned(cls, rotation: Rotation, corners: Float[np.ndarray, "n 3"]) -> _Region:
        """`corners`: as the tool is held now."""
        points = corners @ rotation.T
        return cls(rotation, points, points.min(0), points.max(0))

    def at(self, spot: DirtSpot) -> Vector:
        """Grasp point of the hand when the tool is pressed on a particle."""
        depth = float(np.ptp(self.corners @ spot.normal)) / 2
        return spot.pos + spot.normal * (depth - PRESSED) - (self.low + self.high) / 2

    def covers(self, grip: Vector, spots: Sequence[DirtSpot]) -> list[DirtSpot]:
        low, high = grip + self.low - SLACK, grip + self.high + SLACK
        return [s for s in spots if (low <= s.pos).all() and (s.pos <= high).all()]


def _regions(world: PlannedWorld, tool: str, hand: int, stance: Stance, normal: Vector) -> list[_Region]:
    """Turns of a tool with its box: with its cleaning area towards the face; as it is carried."""
    area, out = _area(world, tool)
    points = (world.vertices(tool) if area is None else area) - world.grip(hand)
    carried = about_vertical(stance.yaw - world.base[1])
    rotations = [carried] if area is None else [turn_onto(carried @ out, -normal) @ carried, carried]
    return [_Region.turned(r, points) for r in rotations]


def _area(world: PlannedWorld, tool: str) -> tuple[Float[np.ndarray, "8 3"] | None, Vector]:
    """Corners of a tool's cleaning area, and the direction out of the tool that it faces: along its thinnest side, away
    from the middle; no corners, where the whole tool cleans."""
    p, tables = world.domain.model.parameters, world.domain.model.tables
    number = np.flatnonzero(p.tool_object == world.index(tool))
    link = int(p.tool_link[number[0]]) if len(number) else -1
    if link < 0 or not (tables.link_half[link] > 0).any():
        return None, UP
    half = tables.link_half[link]
    frame = matrices_on_host(np.asarray(world.view.link_quat)[world.world, [link]])[0]
    middle = np.asarray(world.view.link_pos)[world.world, link].astype(float)
    signs = np.array(np.meshgrid(*[[-1.0, 1.0]] * 3)).reshape(3, -1).T
    axis, corners = frame[:, int(np.argmin(half))], world.vertices(tool)
    away = (middle - (corners.min(0) + corners.max(0)) / 2) @ axis
    return middle + (signs * half) @ frame.T, axis * (1.0 if away >= 0 else -1.0)


def _is_covered(world: PlannedWorld, tool: str, hand: int) -> bool:
    """Whether the hand is on the side of a tool that cleans."""
    area, out = _area(world, tool)
    return area is not None and float(world.hand_axes(hand)[1] @ out) < -COVERED


@dataclasses.dataclass(frozen=True, eq=False)
class _CleanPlan:
    """From where, and with which of its turns, a tool is pressed on particles one after another; each of `strokes` is
    that one, and the others that it takes off with it."""

    stance: Stance
    turn: int
    strokes: list[list[DirtSpot]]

    @property
    def covered(self) -> list[DirtSpot]:
        return [spot for stroke in self.strokes for spot in stroke]


def _plan(
    world: PlannedWorld, tool: str, hand: int, spots: Sequence[DirtSpot], visited: Sequence[Stance]
) -> _CleanPlan | None:
    """The stance from which most particles are in reach, of those near the nearest ones that were not visited."""
    floor, obstacles = world.floor(), world.obstacles([tool])
    spots = [s for s in spots if s.normal[2] > LOWEST]
    away = world.away(world.spheres(*world.hand_axes(hand), holding=tool, hand=hand))
    best: _CleanPlan | None = None
    for aim in spots[:NEAREST]:
        for stance in stances(world, hand, aim.pos + PRESSED * aim.normal, floor, away, STANCES):
            if any(np.linalg.norm(np.subtract(stance.xy, v.xy)) < ELSEWHERE for v in visited):
                continue
            for turn, region in enumerate(_regions(world, tool, hand, stance, aim.normal)):
                standing, start = obstacles.about(stance.xy, *world.body.trunk), world.carried(hand, stance)
                clear = _room(standing, _spheres(world, tool, hand, region))
                over = _reach_over(world, tool, hand, standing, stance, region, start)
                plan = _strokes(world, hand, stance, turn, region, spots, clear, over)
                if plan is None or (best is not None and len(plan.covered) <= len(best.covered)):
                    continue
                yaw = stance.yaw
                follows = world.follows(hand, world.turned_hand(hand, region.rotation), standing, stance)
                if any(
                    _way(world, tool, hand, standing, yaw, region, start, stroke[0], follows)
                    for stroke in plan.strokes[:FEW]
                ):
                    best = plan
    return best


def _reach_over(
    world: PlannedWorld,
    tool: str,
    hand: int,
    standing: Obstacles,
    stance: Stance,
    region: _Region,
    start: Vector,
) -> Callable[[DirtSpot], bool]:
    """Whether the hand comes to a face that looks away from the robot, as to the near inner side of a bathtub."""
    follows = world.follows(hand, world.turned_hand(hand, region.rotation), standing, stance)
    return lambda spot: bool(_way(world, tool, hand, standing, stance.yaw, region, start, spot, follows))


def _room(obstacles: Obstacles, spheres: Float[np.ndarray, "S 4"]) -> Callable[[Vector], bool]:
    """Whether the hand with the tool has room at a point."""
    return lambda at: obstacles.clear(np.column_stack([spheres[:, :3] + at, spheres[:, 3]]))


def _strokes(
    world: PlannedWorld,
    hand: int,
    stance: Stance,
    turn: int,
    region: _Region,
    spots: Sequence[DirtSpot],
    clear: Callable[[Vector], bool],
    over: Callable[[DirtSpot], bool],
) -> _CleanPlan | None:
    """Places of the tool that cover most particles in reach from a stance, each next to the one before; `clear`: the
    hand has room there; `over`: it comes to a face that looks away."""
    here = np.array(stance.xy)
    near = [
        s
        for s in spots
        if world.reaches(hand, stance, region.at(s))
        and clear(region.at(s) + LIFTED * s.normal)
        and (s.normal[2] > 0.5 or (here - s.pos[:2]) @ s.normal[:2] > 0 or (s.pos[2] < OVER_TOP and over(s)))
    ]
    left, strokes = list(near), []
    while left and len(strokes) < STROKES:
        sets = [region.covers(region.at(s), left) for s in left]
        best = int(np.argmax([len(c) for c in sets]))
        gone = {s.number for s in sets[best]} - {left[best].number}
        strokes.append([left[best], *(s for s in left if s.number in gone)])
        left = [s for s in left if s.number not in gone and s is not strokes[-1][0]]
    if not strokes:
        return None
    strokes.sort(key=lambda stroke: (stroke[0].normal[2] < 0.5, -round(float(stroke[0].pos[2]), 1)))
    ordered = [strokes.pop(0)]
    while strokes:  # the upper sides first, from one place to the next
        level = [s for s in strokes if abs(s[0].pos[2] - strokes[0][0].pos[2]) < 0.1]
        nearest = min(level, key=lambda s: float(np.linalg.norm(s[0].pos - ordered[-1][0].pos)))
        strokes.remove(nearest)
        ordered.append(nearest)
    return _CleanPlan(stance, turn, ordered)


def _spheres(world: PlannedWorld, tool: str, hand: int, region: _Region) -> Float[np.ndarray, "S 4"]:
    axes = world.hand_axes(hand, region.rotation)
    return world.spheres(*axes, holding=tool, hand=hand, rotation=region.rotation)


def _way(
    world: PlannedWorld,
    tool: str,
    hand: int,
    obstacles: Obstacles,
    yaw: float,
    region: _Region,
    start: Vector,
    spot: DirtSpot,
    follows: Follower | None = None,
) -> list[Vector] | None:
    """The hand's way to above a particle; None: there is none."""
    spheres, goal = _spheres(world, tool, hand, region), region.at(spot) + LIFTED * spot.normal
    return hand_path(obstacles, spheres, start, goal, [UP, -ahead(yaw)], follows=follows)


def _program(world: PlannedWorld, tool: str, hand: int, plan: _CleanPlan, spot: DirtSpot) -> Program:
    """Presses the tool on a particle and lifts it; nothing where the hand has no way there."""
    obstacles, stance = world.obstacles([tool], world.stance), world.stance
    regions = _regions(world, tool, hand, stance, spot.normal)
    regions = [regions[min(plan.turn, len(regions) - 1)]]
    regions += [_turned(world, tool, hand, regions[0], spot.normal, angle) for angle in TURNS]
    for region in regions:
        follows = world.follows(hand, world.turned_hand(hand, region.rotation), obstacles)
        way = _way(world, tool, hand, obstacles, stance.yaw, region, world.grip(hand), spot, follows)
        if way is not None:
            return _press(world, tool, hand, region, spot, way)
    return []


def _turned(world: PlannedWorld, tool: str, hand: int, region: _Region, normal: Vector, angle: float) -> _Region:
    """The same tool turned about the normal of a face, rad."""
    area, _ = _area(world, tool)
    points = (world.vertices(tool) if area is None else area) - world.grip(hand)
    c, s = np.cos(angle), np.sin(angle)
    x, y, z = normal
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    rotation = (np.eye(3) + s * k + (1 - c) * (k @ k)) @ region.rotation
    return _Region.turned(rotation, points)


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
