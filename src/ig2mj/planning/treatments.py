"""Primitives in physics that change an object's state with a tool, water, heat or cold: wipe, scrub, soak, slice, cook,
freeze.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence

import numpy as np

from ig2mj.planning.driving import go
from ig2mj.planning.moves import (
    ATTEMPTS,
    DOWN,
    UP,
    Primitive,
    Program,
    ahead,
    carry,
    hand_path,
    hand_with,
    travel,
    vector3,
)
from ig2mj.planning.phases import Phase, Until
from ig2mj.planning.steps import Outcome, Step
from ig2mj.planning.world import AWAY, DirtSpot, PlannedWorld, Stance, Vector, about_vertical
from ig2mj.scene.tables import LinkKind

# Water, dirt, heat and cold.


def clean(predicate: str) -> Callable[[PlannedWorld, Step], Primitive]:
    """The primitive that takes dust or stains off an object with a tool that a hand holds."""

    def clean(world: PlannedWorld, step: Step) -> Primitive:
        name, tool = step.arguments
        hand = hand_with(world, tool)
        if predicate == "stained" and not world.facts.holds("soaked", tool):
            return Outcome("no_grasp", f"{tool} is not soaked")
        reason, detail, passed = "no_base", f"no dirt of {name} is in reach", set[int]()
        for attempt in range(WIPES):
            if not world.facts.holds(predicate, name):
                return Outcome(attempts=attempt + 1)
            if tool not in world.held:
                return Outcome("slipped", f"the hand lost {tool}", attempts=attempt + 1)
            spots = [spot for spot in world.dirt(predicate, name) if spot.number not in passed]
            found = _plan_wipe(world, spots, tool, hand)
            if found is None:
                break
            stance, chosen = found
            if reason := (yield from go(world, stance)):
                passed |= {spot.number for spot in chosen}
                continue
            program = _wipe_program(world, chosen, tool, hand)
            passed |= {spot.number for spot in chosen}
            if program:
                reason = yield program
                detail = f"the tool did not take enough off {name}"
        yield [carry(world, hand)]
        if not world.facts.holds(predicate, name):
            return Outcome(attempts=WIPES)
        return Outcome(reason or "not_true_after", detail, attempts=WIPES)

    return clean


WIPES, AT_ONCE, PRESSED, LIFTED, TOP = 8, 8, 0.02, 0.06, -0.3
"""Rounds of wiping; particles of a round; m that a tool is pressed into a face, and lifted off it between particles;
smallest z of the normal of a face that is wiped."""


def _tool_box(world: PlannedWorld, tool: str, hand: int) -> tuple[Vector, Vector]:
    """Middle of a held tool's box relative to the hand's grasp point, and its half size, m."""
    corners = world.vertices(tool)
    low, high = corners.min(0), corners.max(0)
    return (low + high) / 2 - world.grip(hand), (high - low) / 2


def _plan_wipe(
    world: PlannedWorld, spots: Sequence[DirtSpot], tool: str, hand: int
) -> tuple[Stance, list[DirtSpot]] | None:
    """A stance from which particles are in reach, and these, the nearest first."""
    offset, half = _tool_box(world, tool, hand)
    floor = world.floor()
    best: tuple[Stance, list[DirtSpot]] | None = None
    for spot in [s for s in spots if s.normal[2] > TOP][:6]:
        for stance in world.stances(hand, spot.pos, floor, AWAY, most=3):
            here = np.array(stance.xy)
            near = [
                s
                for s in spots
                if s.normal[2] > TOP
                and world.reaches(hand, stance, _at_spot(s, offset, half))
                and (s.normal[2] > 0.5 or (here - s.pos[:2]) @ s.normal[:2] > 0)
            ]
            if near and (best is None or len(near) > len(best[1])):
                best = stance, near
    if best is None:
        return None
    stance, near = best
    return stance, sorted(near, key=lambda s: float(np.linalg.norm(s.pos - spots[0].pos)))[:AT_ONCE]


def _at_spot(spot: DirtSpot, offset: Vector, half: Vector) -> Vector:
    """Grasp point of a hand whose tool presses on a particle."""
    depth = float(np.abs(spot.normal) @ half)
    return spot.pos + spot.normal * (depth - PRESSED) - offset


def _wipe_program(world: PlannedWorld, spots: Sequence[DirtSpot], tool: str, hand: int) -> Program:
    offset, half = _tool_box(world, tool, hand)
    _, yaw = world.base
    obstacles, spheres = world.obstacles([tool]), world.spheres(*world.hand_axes(hand))
    keeps, at, program = world.index(tool), world.grip(hand), Program()
    for spot in spots:
        target = _at_spot(spot, offset, half)
        before = target + LIFTED * spot.normal
        way = hand_path(obstacles, spheres, at, before, [UP, -ahead(yaw)])
        if way is None:
            continue
        program += travel(hand, way, None, keeps=keeps)
        program += [
            Phase(hand=hand, pos=vector3(target), keeps=keeps, tolerance=0.004, limit=6, after="", speed=0.04),
            Phase(hand=hand, pos=vector3(before), keeps=keeps, tolerance=0.03, limit=12, after=""),
        ]
        at = before
    return [*program, carry(world, hand, keeps)] if program else program


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

    def part() -> Vector:
        return world.com(name) if link < 0 else np.asarray(world.view.link_pos)[world.world, link].astype(float)

    for point in points:
        obstacles, floor = world.obstacles([name]), world.floor()
        _, now = world.base
        held = about_vertical(-now) @ (world.grip(hand) - part())
        for stance in world.stances(hand, point, floor, AWAY, held=held):
            rotation = about_vertical(stance.yaw - now)
            target = point + rotation @ (world.grip(hand) - part())
            spheres = world.spheres(*world.hand_axes(hand, rotation), holding=name, hand=hand, rotation=rotation)
            if hand_path(obstacles, spheres, world.carried(hand, stance), target, [UP, -ahead(stance.yaw)]) is None:
                continue
            if reason := (yield from go(world, stance)):
                _, now = world.base
                continue
            target = point - part() + world.grip(hand)
            spheres = world.spheres(*world.hand_axes(hand), holding=name, hand=hand)
            entries = [UP, -ahead(world.base[1])]
            way = hand_path(world.obstacles([name]), spheres, world.grip(hand), target, entries)
            if way is None:
                continue
            reason = yield travel(hand, way, None, keeps=world.index(name))
            return reason, way
    return "no_path", []


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
    points = [source - np.array([0, 0, below + half]) + ahead * back for ahead in (0.0, 0.05) for below in BELOW_TAP]
    reason, way = yield from _hold_at(world, name, hand, points)
    if reason:
        return Outcome(reason, f"the hand has no way with {name} below {tap}")
    reason = yield from _wait(world, "soaked", name, SOAKING, world.index(name))
    yield [*travel(hand, way[-2::-1], None), carry(world, hand)]
    return Outcome(reason, f"{name} did not take enough water" if reason else "")


BELOW_TAP = (0.16, 0.12, 0.2)
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
