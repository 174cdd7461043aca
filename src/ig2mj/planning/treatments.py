"""Primitives in physics that change an object's state with a knife, water, heat or cold: slice, soak, cook, freeze."""

from __future__ import annotations

from collections.abc import Generator, Iterator, Sequence

import numpy as np

from ig2mj.geometry.host_rotations import about_vertical, turn_onto
from ig2mj.planning.driving import go
from ig2mj.planning.moves import (
    ATTEMPTS,
    DOWN,
    UP,
    Primitive,
    Program,
    ahead,
    carry,
    first_way,
    hand_path,
    hand_with,
    travel,
    vector3,
)
from ig2mj.planning.phases import Phase, Until
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


WAIT, SOAKING, COOKING, FREEZING = 1.0, 20.0, 90.0, 200.0
"""s between looks at a predicate; s that a tap, a source of heat and one of cold are given."""


def _hold_at(
    world: PlannedWorld, name: str, hand: int, points: Sequence[Vector], link: int = -1
) -> Generator[Program, str, tuple[str, list[Vector]]]:
    """Brings a held object's centre of mass, or an annotated link of it, to the first of some points that the hand has
    a way to, with the robot standing anywhere; returns the reason why it did not, and the way."""

    for _ in range(ATTEMPTS):
        obstacles, floor, now = world.obstacles([name]), world.floor(), world.base[1]
        offsets = _offsets(world, name, hand, link)

        def candidates(floor=floor, now=now, offsets=offsets) -> Iterator[_Holding]:
            for offset, tilt in offsets:
                held = about_vertical(-now) @ offset
                for point in points:
                    for stance in stances(world, hand, point, floor, AWAY, STANCES, held):
                        yield stance, point, offset, tilt

        def has_way(candidate: _Holding, search: bool, obstacles=obstacles, now=now) -> bool:
            stance, point, offset, tilt = candidate
            turn = about_vertical(stance.yaw - now)
            spheres = _spheres(world, name, hand, turn @ tilt)
            standing, start = obstacles.about(stance.xy, *world.body.trunk), world.carried(hand, stance)
            target, back = point + turn @ offset, [UP, -ahead(stance.yaw)]
            follows = world.follows(hand, world.turned_hand(hand, turn @ tilt), standing, stance)
            return hand_path(standing, spheres, start, target, back, search=search, follows=follows) is not None

        found = first_way(candidates(), has_way, WAYS)
        if found is None:
            return "no_path", []
        stance, point, offset, tilt = found
        target = point + about_vertical(stance.yaw - now) @ offset
        turned = about_vertical(stance.yaw - now) @ tilt @ about_vertical(now - stance.yaw)
        if (yield from go(world, stance)):
            continue
        back, obstacles = [UP, -ahead(world.base[1])], world.obstacles([name], world.stance)
        spheres, follows = (
            _spheres(world, name, hand, turned),
            world.follows(hand, world.turned_hand(hand, turned), obstacles),
        )
        way = hand_path(obstacles, spheres, world.grip(hand), target, back, search=True, follows=follows)
        if way is not None:
            quat, keeps = world.turned_hand(hand, turned), world.index(name)
            turns = Phase(hand=hand, pos=vector3(world.grip(hand)), quat=quat, keeps=keeps, tolerance=0.05, limit=30,
                          after="")  # fmt: skip
            return (yield [turns, *travel(hand, way, quat, keeps=keeps)]), way
    return "no_path", []


def _spheres(world: PlannedWorld, name: str, hand: int, rotation: Rotation) -> np.ndarray:
    return world.spheres(*world.hand_axes(hand, rotation), holding=name, hand=hand, rotation=rotation)


def _offsets(world: PlannedWorld, name: str, hand: int, link: int) -> list[tuple[Vector, Rotation]]:
    """From parts of a held object to the hand's grasp point, m, with the rotations by which the hand is turned: an
    annotated link, else the middle and what is far ahead. What is long is also held so that it points ahead."""
    grip, out = world.grip(hand), ahead(world.base[1])
    if link >= 0:
        return [(grip - np.asarray(world.view.link_pos)[world.world, link].astype(float), np.eye(3))]
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


_Holding = tuple[Stance, Vector, Vector, Rotation]
"""Where the robot stands, where a part of what it holds is to be, the way from there to the hand, and how it is
turned."""

LONG = 0.07
"""m from the hand to the centre of mass of what it holds, from which on that is also held so that it points ahead."""

PARTS = (0.0, 0.6, 0.85)
"""Parts of a held object that are tried: shares of the way from its centre of mass to its end away from the robot."""

STANCES, WAYS = 4, 60
"""Stances for each point, and ways of a hand that are looked for, at most."""


def soak(world: PlannedWorld, step: Step) -> Primitive:
    """Holds the object below the tap."""
    name, tap = step.arguments
    hand = hand_with(world, name)
    tables = world.domain.model.tables
    links = np.flatnonzero((tables.link_object == world.index(tap)) & (tables.link_kind == LinkKind.WATER_SOURCE))
    source = np.asarray(world.view.link_pos)[world.world, links[0]].astype(float)
    half = float(np.ptp(world.vertices(name)[:, 2])) / 2
    here, _ = world.base
    back = np.array([*(here - source[:2]), 0.0])
    back /= max(float(np.linalg.norm(back)), 1e-6)
    points = [source - np.array([0, 0, below + half]) + out * back for out in (0.0, 0.05, 0.09) for below in BELOW_TAP]
    reason, way = yield from _hold_at(world, name, hand, points)
    if reason:
        return Outcome(reason, f"the hand has no way with {name} below {tap}")
    reason = yield from _wait(world, "soaked", name, SOAKING, world.index(name))
    yield [*travel(hand, way[-2::-1], None), carry(world, hand)]
    return Outcome(reason, f"{name} did not take enough water" if reason else "")


BELOW_TAP = (0.16, 0.12, 0.2, 0.08, 0.04)
"""m below a source of water at which the top of what is soaked is held, so that the hand passes below the spout."""


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
        reason, way = yield from _hold_at(world, name, hand, points)
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
            return Outcome("slipped", f"the hand lost {knife}", attempts=attempt)
        top = np.array([*world.com(name)[:2], world.vertices(name)[:, 2].max()])
        reason, way = yield from _hold_at(world, knife, hand, [top + CUT_ABOVE * -DOWN], int(links[0]))
        if reason:
            continue
        blade = np.asarray(world.view.link_pos)[world.world, links[0]].astype(float)
        pressed = vector3(top + CUT_DEPTH * DOWN - blade + world.grip(hand))
        keeps = world.index(knife)
        reason = yield [
            Phase(hand=hand, pos=pressed, keeps=keeps, tolerance=0.01, limit=25, after="", speed=0.04),
            *travel(hand, way[::-1], None),
        ]
        detail = f"the blade did not press hard enough on {name}"
    yield [carry(world, hand)]
    if world.facts.holds("sliced", name):
        return Outcome(attempts=ATTEMPTS)
    return Outcome(reason or "not_true_after", detail, attempts=ATTEMPTS)


CUT_ABOVE, CUT_DEPTH = 0.08, 0.04
"""m above what is cut at which the blade comes to it, and below its top that it goes for."""
