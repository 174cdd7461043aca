"""Pouring: a container is held above a target and turned, little by little, until the target has what it should.

The container comes upright above the target and is turned over in a direction in which it and the hand have room, with
the lowest place of its rim where what flows out falls onto the target (`ig2mj.states.substances.streams`). It is turned
back before it is carried again.

Axes: R corners of a rim.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Generator, Iterator

import numpy as np
from jaxtyping import Float

from ig2mj.geometry.host_rotations import about_vertical, matrix_to_quat, turn_onto
from ig2mj.geometry.poses import matrices_on_host
from ig2mj.planning.grasping import held_again
from ig2mj.planning.holding import Hold, hold_at
from ig2mj.planning.moves import UP, Primitive, Program, ahead, carry, hand_with, quaternion, travel, vector3
from ig2mj.planning.openings import free_points, opening_of
from ig2mj.planning.phases import Phase, Until
from ig2mj.planning.placing import set_upright
from ig2mj.planning.steps import Outcome, Step
from ig2mj.planning.supplies import contents, litres, required_litres
from ig2mj.planning.world import PlannedWorld, Rotation, Vector
from ig2mj.states.substances.model import of
from ig2mj.states.substances.streams import ASIDE, DEPTHS, UPWARDS
from ig2mj.states.substances.volume import CONTAINS, FILLED

ABOVE = (0.06, 0.12, 0.2)
"""m above a target at which the lowest point of an upright container is held first."""

LIP, CLEAR, EVEN = 0.05, 0.03, 0.003
"""m above the target: of the lowest place of the rim, and of the lowest point of the container, at least; and m up to
which corners of a rim are its lowest together."""

DIRECTIONS, PLACES = 16, 4
"""Horizontal directions in which a container is turned over, and places of a surface that are tried."""

FINE, TURN = np.deg2rad(2.0), np.deg2rad(10.0)
"""rad between tilts that are compared, and by which a container is turned at a time."""

TILTS = np.arange(np.deg2rad(10.0), np.deg2rad(171.0), FINE)
"""rad by which it may be turned."""

DOSES, DOSE = 3, 0.02
"""Turns in which what is needed flows out, and litres of it where something is covered."""

CHECKED = np.deg2rad([30.0, 60.0, 90.0, 120.0, 150.0])
"""rad at which container and hand must have room, as far as it is turned."""

TURNING, ARM_TURNING, LOOK, LOOKS = 8, 40, 2, 40
"""Agent steps that each turn takes at most, of a hand that floats and of one on an arm, those between looks at what
flows, and looks at each tilt, at most."""

SPILT, MISSED = 2e-3, 0.5
"""Litres that flow out before it is asked where they are, and the share of them that must be in the target."""


def pour(world: PlannedWorld, step: Step) -> Primitive:
    """Pours until what the step adds holds; into a container until that is filled, or nothing more comes."""
    name, target, substance = step.arguments
    if reason := next(filter(None, map(world.domain.impossible, step.adds)), ""):
        return Outcome("not_true_after", reason)
    hand_with(world, name)
    failed, righted = set[int](), False
    reason, detail = "not_true_after", f"{target} has no place that lies open above"
    for attempt in range(PLACES):
        if _holds(world, step):
            return Outcome(attempts=max(attempt, 1))
        if litres(world.facts, name, substance) < CONTAINS:
            return Outcome("not_true_after", f"{name} contains no {substance}", attempts=max(attempt, 1))
        if not (yield from held_again(world, name)):
            return Outcome("slipped", f"the hand lost {name}", attempts=max(attempt, 1))
        hand = hand_with(world, name)
        left = lambda hand=hand: [h for h in _above(world, name, target, hand) if h.number not in failed]  # noqa: E731
        if not left():
            if righted or not (yield from set_upright(world, target)):
                break
            righted = True
            continue
        reason, way, number = yield from hold_at(world, name, hand, left)
        if name not in world.held:
            continue
        if number < 0:
            return Outcome(reason, f"the hand has no way with {name} above {target}", attempts=attempt + 1)
        detail = ""
        if not reason:
            detail = yield from _turned_over(world, step, hand, number)
        failed.add(number)
        if name in world.held:
            yield [*travel(hand, way[-2::-1], None), carry(world, hand)]
    return Outcome("" if _holds(world, step) else reason or "not_true_after", detail, attempts=PLACES)


def _holds(world: PlannedWorld, step: Step) -> bool:
    facts = world.facts
    return all(facts.holds(wish.predicate, *wish.arguments) for wish in step.adds)


def _places(world: PlannedWorld, target: str) -> list[Vector]:
    """Where on a target it is poured, m, world frame: the middle of an opening, or points of a surface."""
    if world.domain.contains(target):
        opening = opening_of(world, target)
        return [opening.centre] if opening.normal[2] > UPWARDS else []
    return list(free_points(world, target, UPWARDS)[:PLACES])


def _above(world: PlannedWorld, name: str, target: str, hand: int) -> list[Hold]:
    """A container upright above each place of a target; numbered by the place."""
    grip = world.grip(hand)
    tilt = turn_onto(opening_of(world, name).normal, UP)
    points = (world.points(name) - grip) @ tilt.T
    low, high = points.min(0), points.max(0)
    bottom = np.array([*((low + high) / 2)[:2], low[2]])
    places = enumerate(_places(world, target))
    return [Hold(place + above * UP, -bottom, tilt, number) for number, place in places for above in ABOVE]


def _turned_over(world: PlannedWorld, step: Step, hand: int, number: int) -> Generator[Program, str, str]:
    """Turns a container that is held upright above a place of a target over, and back; says in words what failed."""
    name, target, _ = step.arguments
    keeps, places = world.index(name), _places(world, target)
    if number >= len(places):
        return f"the opening of {target} does not face upwards"
    motion = _Motion(world, name, hand, places[number])
    needed = FILLED * world.domain.litres(target) or DOSE
    direction = next((d for d in motion.directions() if motion.has_room(d, needed)), None)
    if direction is None:
        return f"there is no room to turn {name} over above {target}"
    said, tilt = "", 0.0
    dose = needed / DOSES
    while tilt < TILTS[-1]:
        goal = motion.tilt_for(direction, tilt, dose)
        if (yield motion.program(direction, tilt, goal, keeps)):
            break
        tilt = goal
        over, said = yield from _flows(world, step, motion.held(direction, tilt, keeps))
        if over:
            break
    yield motion.program(direction, tilt, 0.0, keeps)
    return said


def _flows(world: PlannedWorld, step: Step, held: Phase) -> Generator[Program, str, tuple[bool, str]]:
    """Waits while something flows out, with the hand held at the present tilt for `LOOK` agent steps at a time; whether
    pouring is over, and what failed, in words."""
    name, target, substance = step.arguments
    into, (wish, *_) = world.domain.contains(target), step.adds

    def within() -> float:
        return litres(world.facts, target, substance) if into else 0.0

    before, had = litres(world.facts, name, substance), within()
    last = before
    for _ in range(LOOKS):
        if (yield [held]):
            return True, ""
        left, has = litres(world.facts, name, substance), within()
        enough = has > FILLED * world.domain.litres(target) or not into
        if (enough and _holds(world, step)) or left < CONTAINS:
            return True, f"{name} did not contain enough {substance}"
        gone = before - left
        misses = has - had < MISSED * gone if into else gone > 2 * required_litres(world.facts, wish) + SPILT
        if gone > SPILT and misses:
            return True, f"{substance} out of {name} does not fall onto {target}"
        if last - left < CONTAINS:
            return False, f"nothing flows out of {name}"
        last = left
    return False, ""


@dataclasses.dataclass(frozen=True, eq=False)
class _Pose:
    """Of a hand that turns a container over: its grasp point, m, world frame, and the rotation that turns it."""

    grip: Vector
    rotation: Rotation


class _Motion:
    """How a container that a hand holds upright is turned over above a place."""

    def __init__(self, world: PlannedWorld, name: str, hand: int, place: Vector):
        self._world, self._name, self._hand, self._place = world, name, hand, place
        opening, grip = opening_of(world, name), world.grip(hand)
        self._upright = turn_onto(opening.normal, UP)
        self._rim: Float[np.ndarray, "R 3"] = opening.rim - grip
        self._points = world.points(name) - grip
        self._quat = world.hand_quat(hand)
        self._frame = matrices_on_host(world.pose(name)[1][None])[0]
        self._obstacles = world.obstacles([name], world.stance)
        self._limit = TURNING if world.body.opening is None else ARM_TURNING

    def directions(self) -> Iterator[Vector]:
        """Horizontal unit vectors, those away from the robot first."""
        turns = np.arange(DIRECTIONS) * (2 * np.pi / DIRECTIONS)
        for turn in sorted(turns, key=lambda t: min(t, 2 * np.pi - t)):
            yield about_vertical(float(turn)) @ ahead(self._world.base[1])

    def pose(self, direction: Vector, tilt: float) -> _Pose:
        """The container turned over by `tilt`, its rim where what flows out falls onto the place."""
        rotation = self._rotation(direction, tilt)
        rim, points = self._rim @ rotation.T, self._points @ rotation.T
        lip = rim[rim[:, 2] < rim[:, 2].min() + EVEN].mean(0)
        high = max(LIP, float(lip[2] - points[:, 2].min()) + CLEAR)
        aside = float(ASIDE[np.searchsorted(DEPTHS[1:-1], high)])
        return _Pose(self._place + high * UP - aside * direction - lip, rotation)

    def _rotation(self, direction: Vector, tilt: float) -> Rotation:
        return turn_onto(UP, np.cos(tilt) * UP + np.sin(tilt) * direction) @ self._upright

    def has_room(self, direction: Vector, needed: float) -> bool:
        """Whether the hand with the container has room, and reaches, at all tilts up to where so many litres have
        flowed out."""
        last = self.tilt_for(direction, 0.0, needed)
        return all(self._free(self.pose(direction, float(tilt))) for tilt in (*CHECKED[last > CHECKED], last))

    def _free(self, pose: _Pose) -> bool:
        world, hand = self._world, self._hand
        if not world.reaches(hand, world.stance, pose.grip):
            return False
        axes = world.hand_axes(hand, pose.rotation)
        spheres = world.spheres(*axes, holding=self._name, hand=hand, rotation=pose.rotation)
        follows = world.follows(hand, world.turned_hand(hand, pose.rotation), self._obstacles)
        if follows is not None and not follows.reaches(pose.grip):
            return False
        return self._obstacles.clear(np.column_stack([spheres[:, :3] + pose.grip, spheres[:, 3]]))

    def tilt_for(self, direction: Vector, tilt: float, dose: float) -> float:
        """The first tilt above a given one at which so many litres flow out; of less than that, the last."""
        containers = of(self._world.domain.model).containers
        row = containers.row_of(self._world.index(self._name))
        assert row is not None
        stays = contents(self._world.facts, self._name) - dose
        for goal in TILTS[np.searchsorted(TILTS, tilt + FINE) :]:
            up = self._frame.T @ self._rotation(direction, float(goal)).T @ UP
            if stays > 0.0 and containers.stays_in(row, up) <= stays:
                return float(goal)
        return float(TILTS[-1])

    def program(self, direction: Vector, tilt: float, goal: float, keeps: int) -> Program:
        """The container is turned from a tilt to another."""
        count = max(1, int(np.ceil(abs(goal - tilt) / TURN)))
        return [self._phase(self.pose(direction, float(t)), keeps) for t in np.linspace(tilt, goal, count + 1)[1:]]

    def held(self, direction: Vector, tilt: float, keeps: int) -> Phase:
        """The container is kept at a tilt, where it is to be: an arm that has just turned it swings on, and turns its
        base."""
        return dataclasses.replace(self._phase(self.pose(direction, tilt), keeps), until=Until.WAITED, limit=LOOK)

    def _phase(self, pose: _Pose, keeps: int) -> Phase:
        turned = matrix_to_quat(pose.rotation @ matrices_on_host(self._quat[None])[0])
        return Phase(
            hand=self._hand, pos=vector3(pose.grip), quat=quaternion(turned), keeps=keeps, tolerance=0.01,
            turn_tolerance=0.04, limit=self._limit, after="",
        )  # fmt: skip
