"""Primitives in physics that change an object's state with a knife, water, heat or cold: slice, soak, cook, freeze."""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence

import numpy as np

from ig2mj.geometry.host_rotations import about_vertical, turn_onto
from ig2mj.geometry.poses import matrices_on_host
from ig2mj.planning.grasping import grasp, held_again
from ig2mj.planning.holding import Hold, hold_at, wait_until
from ig2mj.planning.moves import (
    ATTEMPTS,
    DOWN,
    UP,
    Primitive,
    ahead,
    carry,
    hand_with,
    travel,
    vector3,
)
from ig2mj.planning.phases import Phase
from ig2mj.planning.steps import Outcome, Step
from ig2mj.planning.taps import hold_below_tap
from ig2mj.planning.world import PlannedWorld, Rotation, Stance, Vector
from ig2mj.scene.tables import LinkKind

SOAKING, COOKING, FREEZING = 8.0, 90.0, 200.0
"""s that a tap, a source of heat and one of cold are given."""


def _holds_at(world: PlannedWorld, name: str, hand: int, points: Sequence[Vector]) -> list[Hold]:
    """A held object's centre of mass and parts at some points."""
    return [Hold(point, o, tilt) for o, tilt in _offsets(world, name, hand) for point in points]


def _blades_at(
    world: PlannedWorld, knife: str, hand: int, points: Sequence[Vector], link: int, first: int
) -> list[Hold]:
    """The blade of a held knife at some points, with its edge down, and as it is held, turned about the vertical: where
    its flat lies on what is cut, that rolls away. A number of a hold leaves the row of `PARTS_OF_BLADE` as remainder.

    Args:
      link: of the knife, its blade. first: number of the way that comes first; even ones: with the edge down, of a hand
        on an arm, as it is held.
    """
    turns = np.roll([about_vertical(turn) for turn in BLADE_TURNS], -first, axis=0)
    tilts = [_edge_down(world, knife, link), np.eye(3)]
    tilts = tilts if (first % 2 == 0) == (world.body.opening is None) else tilts[::-1]
    offsets = [world.grip(hand) - _part_of_blade(world, hand, link, part) for part in range(len(PARTS_OF_BLADE))]
    ways = [
        (point, turn @ tilt, part, offset)
        for tilt in tilts
        if tilt is not None
        for part, offset in enumerate(offsets)
        for point in points
        for turn in turns
    ]
    count = len(PARTS_OF_BLADE)
    return [Hold(point, turn @ offset, turn, count * k + part) for k, (point, turn, part, offset) in enumerate(ways)]


def _tip_first(holds: Callable[[], Sequence[Hold]]) -> list[Hold]:
    """Holds of a blade, those first with the hand farthest from what is cut."""
    return sorted(holds(), key=lambda hold: -(hold.number % len(PARTS_OF_BLADE)))


def _part_of_blade(world: PlannedWorld, hand: int, link: int, part: int) -> Vector:
    """Where a part of the blade of a held knife is, a row of `PARTS_OF_BLADE`."""
    pos, quat = (np.asarray(v)[world.world, link].astype(float) for v in (world.view.link_pos, world.view.link_quat))
    half = world.domain.model.tables.link_half[link]
    along = matrices_on_host(quat[None])[0][:, int(np.argmax(half))] * float(half.max())
    away = 1.0 if along @ (pos - world.grip(hand)) >= 0.0 else -1.0
    return pos + PARTS_OF_BLADE[part] * away * along


def _hand_is_off(world: PlannedWorld, knife: str, hand: int, top: Vector) -> Callable[[Stance, Hold], bool]:
    """Whether the hand meets nothing, nor what is cut, when the blade comes to its top (m, world frame)."""
    obstacles, now = world.obstacles([knife], stays=False), world.base[1]

    def is_off(stance: Stance, hold: Hold) -> bool:
        turn = about_vertical(stance.yaw - now)
        spheres = world.spheres(*world.hand_axes(hand, turn @ hold.tilt)) * (1.0, 1.0, 1.0, HAND_SHARE)
        return obstacles.clear(spheres + np.array([*(top - IN_CUT * UP + turn @ hold.offset), 0.0]))

    return is_off


def _edge_down(world: PlannedWorld, knife: str, link: int) -> Rotation | None:
    """The rotation after which a blade is level and below the middle of its knife; None: the blade is in the middle."""
    tables = world.domain.model.tables
    pos, quat = (np.asarray(v)[world.world, link].astype(float) for v in (world.view.link_pos, world.view.link_quat))
    along = matrices_on_host(quat[None])[0][:, int(np.argmax(tables.link_half[link]))]
    out = pos - world.com(knife)
    out = out - (out @ along) * along
    return turn_onto(out, DOWN) if np.linalg.norm(out) > EDGE else None


def _holds_below(world: PlannedWorld, name: str, hand: int, source: Vector) -> list[Hold]:
    """Parts of a held object below a source of water, as it is held and pointing ahead, level and downwards, so that it
    reaches into a basin over its rim."""
    grip, out = world.grip(hand), ahead(world.base[1])
    points, centre = world.points(name) - grip, world.com(name) - grip
    axis = centre / np.linalg.norm(centre) if np.linalg.norm(centre) > LONG else world.hand_axes(hand)[1]
    tilts = [np.eye(3), *(turn_onto(axis, np.cos(a) * out - np.sin(a) * UP) for a in PITCHES)]
    found = list[Hold]()
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
                found.append(Hold(at, -part, tilt, len(PARTS) * number + PARTS.index(share)))
    return found


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


LONG = 0.07
"""m from the hand to the centre of mass of what it holds, from which on that is also held so that it points ahead."""

PARTS = (0.0, 0.6, 0.85)
"""Parts of a held object that are tried: shares of the way from its centre of mass to its end away from the robot."""

PITCHES, COLUMN = (0.0, 0.5, 0.9, 1.3), 0.03
"""rad by which what is held below a tap points down ahead of the hand; m about a part within which drops meet it."""


def soak(world: PlannedWorld, step: Step) -> Primitive:
    """Holds the object below the tap."""
    name, tap = step.arguments
    ways = functools.partial(_holds_below, world, name)
    return (yield from hold_below_tap(world, name, tap, ways, ("soaked", name), SOAKING))


BELOW_TAP = (0.065, 0.1, 0.15)
"""m below a source of water at which the top of what is soaked is held: drops begin 5 cm below it."""


def cook(world: PlannedWorld, step: Step) -> Primitive:
    """Holds the object near a source that acts by nearness, or waits while it is inside one, until it is cooked."""
    name, source = step.arguments
    rules = next(s for s in world.domain.sources if s.name == source)
    if world.facts.holds("cooked", name):
        return Outcome()
    way: list[Vector] = []
    hand, reason = -1, ""
    if not rules.acts_inside:
        hand = hand_with(world, name)
        tables = world.domain.model.tables
        links = np.flatnonzero((tables.link_object == world.index(source)) & (tables.link_kind == LinkKind.HEAT_SOURCE))
        link = np.asarray(world.view.link_pos)[world.world, links[0]].astype(float)
        half = float(np.ptp(world.vertices(name)[:, 2])) / 2
        points = [link - (above + half) * DOWN for above in (0.06, 0.1, 0.14)]
        for attempt in range(ATTEMPTS):
            if not (yield from held_again(world, name)):
                return Outcome("slipped", f"the hand lost {name}", attempts=attempt)
            hand = hand_with(world, name)
            holds = functools.partial(_holds_at, world, name, hand, points)
            reason, way, _ = yield from hold_at(world, name, hand, holds)
            if reason != "slipped":
                break
        if reason:
            return Outcome(reason, f"the hand has no way with {name} over {source}")
    keeps = world.index(name) if hand >= 0 else -1
    reason = yield from wait_until(world, ("cooked", name), COOKING, keeps)
    if hand >= 0:
        yield [*travel(hand, way[-2::-1], None), carry(world, hand)]
    return Outcome(reason, f"{name} did not get hot enough" if reason else "")


def freeze(world: PlannedWorld, step: Step) -> Primitive:
    """Waits until the object is frozen."""
    name, source = step.arguments
    if not world.facts.holds("inside", name, source):
        return Outcome("not_true_after", f"{name} is not inside {source}")
    reason = yield from wait_until(world, ("frozen", name), FREEZING)
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
        reason, way, number = yield from hold_at(world, knife, hand, holds, _hand_is_off(world, knife, hand, top))
        if reason == "no_path":
            reason, way, number = yield from hold_at(world, knife, hand, functools.partial(_tip_first, holds))
        if reason:
            continue
        part = number % len(PARTS_OF_BLADE)
        keeps, before = world.index(knife), world.grip(hand)
        down, tolerance, limit, speed = CUT if world.body.opening is None else ARM_CUT
        above = float(_part_of_blade(world, hand, int(links[0]), part)[2] - top[2])
        for depth in np.arange(above - down, -CUT_DEPTH - down / 2, -down):  # no farther than the cut
            blade = _part_of_blade(world, hand, int(links[0]), part)
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


EDGE = 0.005
"""m between a blade and the middle of its knife, across the blade, from which on it is the knife's edge."""

PARTS_OF_BLADE = (0.0, 0.5, 0.85)
"""Parts of a blade that cut: shares of the way from its middle to its end away from the hand."""

IN_CUT, HAND_SHARE = 0.01, 0.7
"""m that the blade is in what it cuts when the hand has to be off that, and share of its spheres' radii: it is
closed."""

BLADE_TURNS = (0.0, 0.6, -0.6, 1.2, -1.2)
"""rad by which a blade is turned about the vertical: what rolled away from it is cut from another side."""

CUT_ABOVE, CUT_DEPTH = (0.08, 0.14), 0.04
"""m above what is cut at which the blade comes to it, higher where other things stand next to it, and below its top
that the blade goes for."""

CUT, ARM_CUT = (0.01, 0.005, 2, 0.01), (0.02, 0.01, 10, 0.04)
"""Steps in which a blade goes down, between looks at what is cut, of a hand that floats and of one on an arm: m of a
step, m within which the hand is there, agent steps that it has, and m in each."""
