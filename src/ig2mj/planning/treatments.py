"""Primitives in physics that change an object's state with a knife, water, heat or cold: slice, soak, cook, freeze."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable, Generator, Iterator, Sequence

import numpy as np

from ig2mj.geometry.host_rotations import about_vertical, turn_onto
from ig2mj.planning.driving import go
from ig2mj.planning.grasping import grasp
from ig2mj.planning.moves import (
    ATTEMPTS,
    DOWN,
    UP,
    Primitive,
    Program,
    ahead,
    carry,
    first_way,
    from_home,
    hand_path,
    hand_with,
    travel,
    turn_at,
    turning_point,
    vector3,
)
from ig2mj.planning.phases import Phase, Until
from ig2mj.planning.placing import bring_out, regrasp
from ig2mj.planning.stances import stances
from ig2mj.planning.steps import Outcome, Step
from ig2mj.planning.world import AWAY, PlannedWorld, Rotation, Stance, Vector
from ig2mj.scene.tables import LinkKind


def _wait(
    world: PlannedWorld, predicate: str, name: str, seconds: float, keeps: int = -1
) -> Generator[Program, str, str]:
    """Stands still until a predicate holds; returns the reason why it does not."""
    for _ in range(int(np.ceil(seconds / WAIT))):
        if world.facts.holds(predicate, name):
            return ""
        if reason := (yield [Phase(until=Until.WAITED, keeps=keeps, limit=int(10 * WAIT))]):
            return reason
    return "" if world.facts.holds(predicate, name) else "not_true_after"


WAIT, SOAKING, COOKING, FREEZING = 1.0, 8.0, 90.0, 200.0
"""s between looks at a predicate; s that a tap, a source of heat and one of cold are given."""


@dataclasses.dataclass(frozen=True, eq=False)
class _Hold:
    """A part of a held object at a point: the point, the way from there to the hand's grasp point, and the rotation by
    which the hand is turned; both of these as the robot faces now. number: of those that are alike."""

    point: Vector
    offset: Vector
    tilt: Rotation
    number: int = 0


def _hold_at(
    world: PlannedWorld, name: str, hand: int, holds: Callable[[], Sequence[_Hold]]
) -> Generator[Program, str, tuple[str, list[Vector], int]]:
    """Holds an object in the first of some ways that the hand has a way to, with the robot standing anywhere; returns
    the reason why it did not, the way, and the number of the hold.

    Args:
      holds: as the object is held now.
    """
    missed = set[tuple[tuple[float, float], int]]()
    for _ in range(ATTEMPTS):
        obstacles, floor, now = world.obstacles([name], stays=False), world.floor(), world.base[1]

        def candidates(floor=floor, now=now) -> Iterator[_Holding]:
            for hold in holds():
                held = about_vertical(-now) @ hold.offset
                here = world.stance  # a base on wheels that stands near enough stays there
                near = not world.body.sideways and world.reaches(hand, here, hold.point + hold.offset)
                if near and (here.xy, hold.number) not in missed:
                    yield here, hold
                for stance in stances(world, hand, hold.point, floor, AWAY, STANCES, held):
                    if (stance.xy, hold.number) not in missed:
                        yield stance, hold

        def aim(stance: Stance, hold: _Hold, now=now) -> tuple[Vector, Rotation]:
            turn = about_vertical(stance.yaw - now)
            return hold.point + turn @ hold.offset, turn @ hold.tilt

        def has_room(candidate: _Holding, obstacles=obstacles, aim=aim) -> bool:
            stance, hold = candidate
            target, turned = aim(stance, hold)
            spheres = _spheres(world, name, hand, turned)
            standing = world.standing(obstacles, stance, hand)
            return standing.clear(np.column_stack([spheres[:, :3] + target, spheres[:, 3]]))

        def has_way(candidate: _Holding, search: bool, obstacles=obstacles, aim=aim) -> bool:
            stance, hold = candidate
            target, turned = aim(stance, hold)
            spheres = _spheres(world, name, hand, turned)
            standing = world.standing(obstacles, stance, hand)
            start = turning_point(standing, spheres, world.carried(hand, stance), stance.yaw)
            back = [UP, -ahead(stance.yaw)]
            follows = world.follows(hand, world.turned_hand(hand, turned), standing, stance)
            return hand_path(standing, spheres, start, target, back, search=search, follows=follows) is not None

        found = first_way(filter(has_room, candidates()), has_way, WAYS if world.body.opening is None else ARM_WAYS)
        if found is None:
            return "no_path", [], -1
        stance, hold = found
        target, turned = aim(stance, hold)
        turned = turned @ about_vertical(now - stance.yaw)
        if (yield from go(world, stance)):
            continue
        planned = yield from from_home(world, hand, functools.partial(_way, world, name, hand, target, turned))
        if planned is not None:
            start, way = planned
            quat, keeps = world.turned_hand(hand, turned), world.index(name)
            reason = yield [*turn_at(world, hand, start, quat, keeps), *travel(hand, way, quat, keeps=keeps)]
            return reason, way, hold.number
        missed.add((stance.xy, hold.number))
    return "no_path", [], -1


def _way(
    world: PlannedWorld, name: str, hand: int, target: Vector, turned: Rotation
) -> tuple[Vector, list[Vector]] | None:
    """Where a hand turns what it holds, and its way from there, from where the robot stands; None: there is none."""
    back, obstacles = [UP, -ahead(world.base[1])], world.obstacles([name], world.stance)
    spheres = _spheres(world, name, hand, turned)
    follows = world.follows(hand, world.turned_hand(hand, turned), obstacles)
    start = turning_point(obstacles, spheres, world.grip(hand), world.base[1])
    way = hand_path(obstacles, spheres, start, target, back, search=True, follows=follows)
    return None if way is None else (start, way)


def _holds_at(world: PlannedWorld, name: str, hand: int, points: Sequence[Vector]) -> list[_Hold]:
    """A held object's centre of mass and parts at some points."""
    return [_Hold(point, o, tilt) for o, tilt in _offsets(world, name, hand) for point in points]


def _blades_at(
    world: PlannedWorld, knife: str, hand: int, points: Sequence[Vector], link: int, first: int
) -> list[_Hold]:
    """The blade of a held knife at some points, as it is held and turned about the vertical.

    Args:
      link: of the knife, its blade. first: number of the direction that comes first.
    """
    offset = world.grip(hand) - np.asarray(world.view.link_pos)[world.world, link].astype(float)
    turns = [about_vertical(turn) for turn in BLADE_TURNS]
    ways = [(point, turns[k]) for point in points for k in np.roll(np.arange(len(turns)), -first)]
    return [_Hold(point, turn @ offset, turn, number) for number, (point, turn) in enumerate(ways)]


def _holds_below(world: PlannedWorld, name: str, hand: int, source: Vector) -> list[_Hold]:
    """Parts of a held object below a source of water, as it is held and pointing ahead, level and downwards, so that it
    reaches into a basin over its rim."""
    grip, out = world.grip(hand), ahead(world.base[1])
    points, centre = world.points(name) - grip, world.com(name) - grip
    axis = centre / np.linalg.norm(centre) if np.linalg.norm(centre) > LONG else world.hand_axes(hand)[1]
    tilts = [np.eye(3), *(turn_onto(axis, np.cos(a) * out - np.sin(a) * UP) for a in PITCHES)]
    found = list[_Hold]()
    for number, tilt in enumerate(tilts):
        turned, middle = points @ tilt.T, tilt @ centre
        along = out if number == 0 else tilt @ axis
        far = max(float(((turned - middle) @ along).max()), 0.0)
        for share in PARTS:
            part = middle + share * far * along
            over = turned[np.linalg.norm((turned - part)[:, :2], axis=1) < COLUMN]
            top = float((over - part)[:, 2].max()) if len(over) else 0.0
            for below in BELOW_TAP:
                at = source - (below + max(top, 0.0)) * UP
                found.append(_Hold(at, -part, tilt, len(PARTS) * number + PARTS.index(share)))
    return found


def _spheres(world: PlannedWorld, name: str, hand: int, rotation: Rotation) -> np.ndarray:
    return world.spheres(*world.hand_axes(hand, rotation), holding=name, hand=hand, rotation=rotation)


def _offsets(world: PlannedWorld, name: str, hand: int) -> list[tuple[Vector, Rotation]]:
    """From parts of a held object, its middle and what is far ahead, to the hand's grasp point, m, with the rotations
    by which the hand is turned. What is long is also held so that it points ahead."""
    grip, out = world.grip(hand), ahead(world.base[1])
    corners, centre = world.vertices(name) - grip, world.com(name) - grip
    tilts = [np.eye(3)]
    if np.linalg.norm(centre) > LONG:
        tilts.append(turn_onto(centre, out))
    found = []
    for tilt in tilts:
        far = float(((corners - centre) @ tilt.T @ out).max())
        higher = float(np.ptp(corners[:, 2]) - np.ptp((corners @ tilt.T)[:, 2])) / 2  # its top is where it would be
        found += [(-(tilt @ centre + share * far * out) + higher * UP, tilt) for share in PARTS]
    return found


_Holding = tuple[Stance, _Hold]
"""Where the robot stands, and how it holds what it holds."""

LONG = 0.07
"""m from the hand to the centre of mass of what it holds, from which on that is also held so that it points ahead."""

PARTS = (0.0, 0.6, 0.85)
"""Parts of a held object that are tried: shares of the way from its centre of mass to its end away from the robot."""

PITCHES, COLUMN = (0.0, 0.5, 0.9, 1.3), 0.03
"""rad by which what is held below a tap points down ahead of the hand; m about a part within which drops meet it."""

STANCES, WAYS, ARM_WAYS = 4, 60, 240
"""Stances for each point, and ways of a hand that are looked for, at most: of one that floats, and of one on an arm."""


def soak(world: PlannedWorld, step: Step) -> Primitive:
    """Holds the object below the tap."""
    name, tap = step.arguments
    hand = hand_with(world, name)
    tables = world.domain.model.tables
    links = np.flatnonzero((tables.link_object == world.index(tap)) & (tables.link_kind == LinkKind.WATER_SOURCE))
    source = np.asarray(world.view.link_pos)[world.world, links[0]].astype(float)
    reason, number, failed, again, moved = "", -1, set[int](), False, set[str]()
    for _ in range(SOAKS + MOST_MOVED):
        left = lambda hand=hand: [h for h in _holds_below(world, name, hand, source) if h.number not in failed]  # noqa: E731
        reason, way, number = yield from _hold_at(world, name, hand, left)
        if number < 0 and (yield from _clear_basin(world, source, moved)) and name in world.held:
            continue
        if number < 0 and not again and (yield from regrasp(world, name, hand)):  # by another side
            again, hand = True, hand_with(world, name)
            continue
        if number < 0:
            return Outcome(reason, f"the hand has no way with {name} below {tap}")
        reason = reason or (yield from _wait(world, "soaked", name, SOAKING, world.index(name)))
        yield [*travel(hand, way[-2::-1], None), carry(world, hand)]
        if world.facts.holds("soaked", name):
            return Outcome()
        failed.add(number)
        if name not in world.held:
            return Outcome("slipped", f"the hand lost {name}")
    return Outcome(reason or "not_true_after", f"{name} did not take enough water")


def _clear_basin(world: PlannedWorld, source: Vector, moved: set[str]) -> Generator[Program, str, bool]:
    """Puts what stands or lies below a source of water, the nearest first, onto open floor; returns whether it did."""
    if len(moved) == MOST_MOVED or all(world.held):
        return False
    near = list[tuple[float, str]]()
    for other in world.domain.loose:
        if other in world.held or other in moved or not world.domain.graspable(other):
            continue
        low, high = world.facts.box(other)
        apart = float(np.linalg.norm(source[:2] - np.clip(source[:2], low[:2], high[:2])))
        if apart < BASIN and low[2] < source[2] and high[2] > source[2] - DEPTH:
            near.append((apart, other))
    if not near:
        return False
    moved.add(min(near)[1])
    return (yield from bring_out(world, min(near)[1])).done


BASIN, DEPTH, MOST_MOVED = 0.25, 0.5, 3
"""m, horizontal, from a source of water, and below it, within which things are put elsewhere where nothing else can be
held below it, and how many."""

BELOW_TAP, SOAKS = (0.065, 0.1, 0.15), 3
"""m below a source of water at which the top of what is soaked is held: drops begin 5 cm below it; and ways of holding
it that are tried."""


def cook(world: PlannedWorld, step: Step) -> Primitive:
    """Holds the object near a source that acts by nearness, or waits while it is inside one, until it is cooked."""
    name, source = step.arguments
    rules = next(s for s in world.domain.sources if s.name == source)
    if world.facts.holds("cooked", name):
        return Outcome()
    way: list[Vector] = []
    hand = -1
    if not rules.acts_inside:
        hand = hand_with(world, name)
        tables = world.domain.model.tables
        links = np.flatnonzero((tables.link_object == world.index(source)) & (tables.link_kind == LinkKind.HEAT_SOURCE))
        link = np.asarray(world.view.link_pos)[world.world, links[0]].astype(float)
        half = float(np.ptp(world.vertices(name)[:, 2])) / 2
        points = [link - (above + half) * DOWN for above in (0.06, 0.1, 0.14)]
        reason, way, _ = yield from _hold_at(world, name, hand, lambda: _holds_at(world, name, hand, points))
        if reason:
            return Outcome(reason, f"the hand has no way with {name} over {source}")
    keeps = world.index(name) if hand >= 0 else -1
    reason = yield from _wait(world, "cooked", name, COOKING, keeps)
    if hand >= 0:
        yield [*travel(hand, way[-2::-1], None), carry(world, hand)]
    return Outcome(reason, f"{name} did not get hot enough" if reason else "")


def freeze(world: PlannedWorld, step: Step) -> Primitive:
    """Waits until the object is frozen."""
    name, source = step.arguments
    if not world.facts.holds("inside", name, source):
        return Outcome("not_true_after", f"{name} is not inside {source}")
    reason = yield from _wait(world, "frozen", name, FREEZING)
    return Outcome(reason, f"{name} did not get cold enough" if reason else "")


def slice_(world: PlannedWorld, step: Step) -> Primitive:
    """Presses the knife's blade onto the object from above."""
    name, knife = step.arguments
    hand = hand_with(world, knife)
    tables = world.domain.model.tables
    links = np.flatnonzero((tables.link_object == world.index(knife)) & (tables.link_kind == LinkKind.SLICER))
    reason, detail = "no_path", f"the hand has no way with {knife} to {name}"
    for attempt in range(ATTEMPTS):
        if world.facts.holds("sliced", name):
            return Outcome(attempts=max(attempt, 1))
        if knife not in world.held:
            again = yield from grasp(world, Step("grasp", (knife,)))
            if not again.done:
                return Outcome("slipped", f"the hand lost {knife}", attempts=attempt)
            hand = hand_with(world, knife)
        top = np.array([*world.com(name)[:2], world.vertices(name)[:, 2].max()])
        points = [top + above * UP for above in CUT_ABOVE]
        holds = functools.partial(_blades_at, world, knife, hand, points, int(links[0]), attempt)
        reason, way, _ = yield from _hold_at(world, knife, hand, holds)
        if reason:
            continue
        keeps, before = world.index(knife), world.grip(hand)
        down, tolerance, limit, speed = CUT if world.body.opening is None else ARM_CUT
        above = float(np.asarray(world.view.link_pos)[world.world, links[0], 2] - top[2])
        for depth in np.arange(above - down, -CUT_DEPTH - down / 2, -down):  # no farther than the cut
            blade = np.asarray(world.view.link_pos)[world.world, links[0]].astype(float)
            pressed = vector3(top + depth * UP - blade + world.grip(hand))
            reason = yield [
                Phase(hand=hand, pos=pressed, keeps=keeps, tolerance=tolerance, limit=limit, after="", speed=speed)
            ]
            if reason or world.facts.holds("sliced", name):
                break
        reason = reason or (yield travel(hand, [before, *way[-2::-1]], None))
        detail = f"the blade did not press hard enough on {name}"
    yield [carry(world, hand)]
    if world.facts.holds("sliced", name):
        return Outcome(attempts=ATTEMPTS)
    return Outcome(reason or "not_true_after", detail, attempts=ATTEMPTS)


BLADE_TURNS = (0.0, 0.6, -0.6, 1.2, -1.2)
"""rad by which a blade is turned about the vertical: what rolled away from it is cut from another side."""

CUT_ABOVE, CUT_DEPTH = (0.08, 0.14), 0.04
"""m above what is cut at which the blade comes to it, higher where other things stand next to it, and below its top
that the blade goes for."""

CUT, ARM_CUT = (0.01, 0.005, 2, 0.01), (0.02, 0.01, 10, 0.04)
"""Steps in which a blade goes down, between looks at what is cut, of a hand that floats and of one on an arm: m of a
step, m within which the hand is there, agent steps that it has, and m in each."""
