"""Primitives in physics: what the robot does for each, as programs that are planned on the host one after another.

A primitive is a generator: it yields motion programs (`list[Phase]`), is sent the reason why each failed ("" for
success), and returns its outcome. It plans every program from the world as it then is, tries again by itself with
another stance, grasp or spot, and ends by the predicate that it is for.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Generator

import numpy as np

from ig2mj.planning.clearance import Obstacles, hand_way, straight
from ig2mj.planning.joints import AJAR, OPEN_TO, OpenableJoint, openable_joints
from ig2mj.planning.moves import (
    ABOVE,
    ATTEMPTS,
    AWAY,
    BELOW,
    DOWN,
    LET_GO,
    RETREAT,
    Primitive,
    PrimitiveFailed,
    Program,
    carry,
    directions,
    free_hand,
    go,
    hand_with,
    quaternion,
    rest,
    travel,
    vector3,
)
from ig2mj.planning.phases import Phase, Until
from ig2mj.planning.steps import Outcome, Step
from ig2mj.planning.treatments import clean, cook, freeze, slice_, soak
from ig2mj.planning.world import PlannedWorld, Stance, Vector
from ig2mj.scene.tables import LinkKind


def primitive(world: PlannedWorld, step: Step) -> Primitive:
    """What a robot does for a step."""
    action = ACTIONS.get(step.primitive)
    if action is None:
        return _refused(f"'{step.primitive}' is not carried out in physics; take --rung symbolic")
    return _guarded(action(world, step))


def _refused(detail: str) -> Primitive:
    yield from ()
    return Outcome("no_path", detail)


def _guarded(inner: Primitive) -> Primitive:
    try:
        return (yield from inner)
    except PrimitiveFailed as e:
        return Outcome(e.reason, e.detail)


def navigate_to(world: PlannedWorld, step: Step) -> Primitive:
    """To where a hand reaches the object."""
    point, reason = world.com(step.object), "no_base"
    hands = range(len(world.body.hands))
    for stance in world.stances(max(hands), point, world.floor(), AWAY):
        reason = yield from go(world, stance)
        if not reason:
            return Outcome()
    return Outcome(reason, f"{step.object} is not within reach of free floor" if reason == "no_base" else "")


# Grasp and release.


def grasp(world: PlannedWorld, step: Step) -> Primitive:
    """From above onto the object, until a hand holds it."""
    name = step.object
    if name in world.held:
        return Outcome()
    tables, index = world.domain.model.tables, world.index(name)
    if not ((tables.graspable_object == index) & (tables.graspable_joint < 0)).any():
        return Outcome("no_grasp", f"{name} is fixed, or its category allows no assisted grasp")
    reason, detail = "no_grasp", ""
    for attempt in range(ATTEMPTS):
        hand = free_hand(world, attempt)
        found = _plan_grasp(world, name, hand, attempt)
        if found is None:
            reason, detail = "no_base", f"no free floor from which a hand has a way to {name}"
            continue
        stance, point, _ = found
        if reason := (yield from go(world, stance)):
            continue
        here, yaw = world.base
        stance = Stance((float(here[0]), float(here[1])), yaw)
        fingers, palm = directions(stance, "down")
        quat = world.body.turned(hand, fingers, palm)
        way = hand_way(world.obstacles([name]), world.spheres(fingers), world.grip(hand), point + ABOVE * -DOWN)
        if way is None:
            reason, detail = "no_path", f"the hand has no way to {name}"
            continue
        program = [
            *travel(world, hand, way, quat),
            Phase(hand=hand, pos=vector3(point + BELOW * DOWN), quat=quat, until=Until.TOUCHED, object=index,
                  close=False, limit=25, after="", speed=0.03),
            Phase(hand=hand, pos=vector3(point + BELOW * DOWN), quat=quat, until=Until.HELD, object=index, close=True,
                  limit=15, after="no_grasp", speed=0.02),
            Phase(hand=hand, pos=vector3(point + ABOVE * -DOWN), keeps=index, close=True, tolerance=0.04, limit=30,
                  after="", speed=0.03),
            *travel(world, hand, way[-2::-1], None, keeps=index),
            carry(world, hand, keeps=index, name=name),
        ]  # fmt: skip
        reason = yield program
        if name in world.held:
            return Outcome(attempts=attempt + 1)
        detail = f"the hand closed on {name} and does not hold it" if reason == "no_grasp" else ""
        yield [
            Phase(hand=hand, close=False, pos=vector3(world.grip(hand) + ABOVE * -DOWN), limit=10, after=""),
            *rest(hand),
        ]
    return Outcome(reason or "no_grasp", detail, attempts=ATTEMPTS)


def _plan_grasp(world: PlannedWorld, name: str, hand: int, attempt: int) -> tuple[Stance, Vector, list[Vector]] | None:
    """A stance, a point of the object's upper side, and the hand's way to above it; later attempts take others."""
    obstacles, floor = world.obstacles([name]), world.floor()
    found = 0
    for point in _tops(world, name):
        for stance in world.stances(hand, point, floor, AWAY):
            fingers, _ = directions(stance, "down")
            way = hand_way(obstacles, world.spheres(fingers), world.resting(hand, stance), point + ABOVE * -DOWN)
            if way is None or not straight(obstacles, world.spheres(fingers)[:5], way[-1], point, PALM_SPARE):
                continue
            found += 1
            if found > attempt // 2:
                return stance, point, way
            break
    return None


PALM_SPARE = 0.1
"""m above a grasp from which on the hand may touch what is around the object."""


def _tops(world: PlannedWorld, name: str) -> list[Vector]:
    """Points of an object's upper side to take it by: over its centre of mass where something is there, then over the
    middles of its pieces, nearest to the centre first."""
    tables = world.domain.model.tables
    own = Obstacles(
        world.stage.scene, world.view, world.world, [o for o in range(tables.num_objects) if o != world.index(name)]
    )
    centre = world.com(name)
    pieces = np.flatnonzero(tables.piece_object == world.index(name))
    middles = [world.vertices_of_pieces(np.array([p])).mean(0) for p in pieces]
    middles.sort(key=lambda m: float(np.linalg.norm(m[:2] - centre[:2])))
    found, highest = [], world.vertices(name)[:, 2].max()
    for spot in (centre, *middles[:8]):
        top = own.below(spot[:2], highest + 0.01, [world.index(name)])
        if np.isfinite(top) and not any(np.linalg.norm(spot[:2] - f[:2]) < 0.02 for f in found):
            found.append(np.array([*spot[:2], top]))
    inside = [f for f in found if f[2] > highest - 0.06]  # not the bottom of a bowl, where fingers find nothing
    return inside or found


def release(world: PlannedWorld, step: Step) -> Primitive:
    """Opens the hand, wherever it is."""
    hand = hand_with(world, step.object)
    reason = yield [Phase(hand=hand, close=False, until=Until.EMPTY, limit=15), *rest(hand)]
    return Outcome() if step.object not in world.held else Outcome(reason or "not_true_after", "the hand did not open")


# Placing.


def place(predicate: str) -> Callable[[PlannedWorld, Step], Primitive]:
    """The primitive that makes a placement true."""

    def place(world: PlannedWorld, step: Step) -> Primitive:
        name, where = step.arguments
        hand = hand_with(world, name)
        reason, detail = "no_base", ""
        for attempt in range(ATTEMPTS):
            found = _plan_place(world, predicate, name, where, hand)
            if found is None and (shut := _shut_joints(world, predicate, where, attempt)):
                yield from _move_joint(world, shut[attempt % len(shut)], free_hand(world), True)
                continue
            if found is None:
                return Outcome("no_base", f"no spot from which {predicate}({name}, {where}) would be true is in reach")
            stance, pos, turn = found
            if reason := (yield from go(world, stance)):
                continue
            if name not in world.held:
                return Outcome("slipped", f"the hand lost {name}", attempts=attempt + 1)
            here, yaw = world.base
            fingers, _ = directions(Stance((float(here[0]), float(here[1])), yaw), "down")
            target, quat = world.grip_for(hand, name, pos, turn)
            target = target + LET_GO * -DOWN
            spheres = world.spheres(fingers, holding=name, hand=hand)
            way = hand_way(world.obstacles([name]), spheres, world.grip(hand), target, spare=0.03)
            if way is None:
                reason, detail = "no_path", f"the hand has no way with {name} to its place"
                continue
            keeps, turned = world.index(name), quaternion(quat)
            program = [
                *travel(world, hand, way, turned, keeps=keeps),
                Phase(hand=hand, pos=vector3(target), quat=turned, keeps=keeps, tolerance=0.015, turn_tolerance=0.1,
                      limit=20, after="", speed=0.03),
                Phase(hand=hand, close=False, until=Until.EMPTY, limit=10),
                Phase(hand=hand, pos=vector3(target + RETREAT * -DOWN), tolerance=0.04, limit=15, after=""),
                *travel(world, hand, way[-2::-1], None),
                *rest(hand),
                Phase(until=Until.WAITED, limit=6),
            ]  # fmt: skip
            reason = yield program
            if world.facts.holds(predicate, name, where):
                return Outcome(attempts=attempt + 1)
            if name not in world.held:
                return Outcome(reason or "not_true_after", f"{name} is not where it was put", attempts=attempt + 1)
        return Outcome(reason or "not_true_after", detail, attempts=ATTEMPTS)

    return place


def _shut_joints(world: PlannedWorld, predicate: str, where: str, attempt: int) -> list[OpenableJoint]:
    """Joints of a container that are still shut, where a further one may let the hand in."""
    if predicate != "inside" or not world.domain.opens(where) or attempt == ATTEMPTS - 1:
        return []
    joints = openable_joints(world.stage.scene, world.view, world.index(where), world.world)
    return [j for j in joints if j.fraction < AJAR]


TURNS = (0.0, np.pi / 2, -np.pi / 2, np.pi)
"""rad about the vertical that an object may be turned by, from how it is held in front of the robot."""


def _plan_place(
    world: PlannedWorld, predicate: str, name: str, where: str, hand: int
) -> tuple[Stance, Vector, float] | None:
    """A stance, a position of the object's main body, and the turn of the object, of those with a way for the hand."""
    obstacles, floor = world.obstacles([name]), world.floor()
    _, now = world.base
    tried = 0
    for pos, turn in world.spots(predicate, name, where, TURNS):
        target, _ = world.grip_for(hand, name, pos, turn)
        for stance in world.stances(hand, target, floor, AWAY, most=3):
            twist = (turn - (stance.yaw - now) + np.pi) % (2 * np.pi) - np.pi
            if abs(twist) > np.pi / 3:  # the hand would be turned too far against the body
                continue
            ahead, _ = directions(stance, "down")
            spheres = world.spheres(ahead, holding=name, hand=hand, turn=turn)
            way = hand_way(obstacles, spheres, world.carried(hand, stance), target + LET_GO * -DOWN, spare=0.03)
            if way is not None:
                return stance, pos, turn
            tried += 1
            if tried > 60:
                return None
    return None


# Doors, drawers and lids.


def set_open(value: bool) -> Callable[[PlannedWorld, Step], Primitive]:
    """The primitive that opens, or closes."""

    def set_open(world: PlannedWorld, step: Step) -> Primitive:
        name, reason, detail = step.object, "no_grasp", ""
        for attempt in range(2 * ATTEMPTS):
            if world.facts.holds("open", name) == value:
                return Outcome(attempts=max(attempt, 1))
            joints = openable_joints(world.stage.scene, world.view, world.index(name), world.world)
            joints = [j for j in joints if value or j.fraction > 0.01]
            if not joints:
                return Outcome("no_grasp", f"{name} has no joints that open")
            joint = joints[attempt % len(joints)]
            hand = free_hand(world, attempt // len(joints))
            reason, detail = yield from _move_joint(world, joint, hand, value)
        if world.facts.holds("open", name) == value:
            return Outcome(attempts=2 * ATTEMPTS)
        return Outcome(reason or "not_true_after", detail, attempts=2 * ATTEMPTS)

    return set_open


def _move_joint(
    world: PlannedWorld, joint: OpenableJoint, hand: int, value: bool
) -> Generator[Program, str, tuple[str, str]]:
    """Opens or closes one door, drawer or lid; returns why it did not, as a reason and in words."""
    found = _plan_joint(world, joint, hand, value)
    if found is None:
        return "no_base", f"no free floor from which a hand can move {joint.name}"
    if reason := (yield from go(world, found.stance)):
        return reason, f"no way leads to where a hand can move {joint.name}"
    program = _joint_program(world, joint, hand, found.places, found.pulls)
    if program is None:
        return "no_path", f"the hand has no way to {joint.name}"
    reason = yield program
    yield [Phase(hand=hand, close=False, until=Until.EMPTY, limit=6, after=""), *rest(hand)]
    return reason or "not_true_after", f"{joint.name} did not move far enough"


@dataclasses.dataclass(frozen=True, eq=False)
class _JointPlan:
    """How a hand moves a joint: from where, and for each place on the way the point and the normal of the face that it
    is at. pulls: it takes hold of the face; else it pushes it."""

    stance: Stance
    places: list[tuple[Vector, Vector]]
    pulls: bool


def _plan_joint(world: PlannedWorld, joint: OpenableJoint, hand: int, value: bool) -> _JointPlan | None:
    """A door is pulled open by its outer face, and pushed shut by it; where no floor is free before that face, it is
    pulled by the inner one until it is ajar."""
    ways = [(joint.grips, OPEN_TO, True)] if value else [(joint.grips, 0.0, False)]
    if not value and joint.hinge and joint.fraction > AJAR + 0.1:
        ways.append((joint.inner_grips, AJAR, True))
    floor = world.floor()
    for grips, fraction, pulls in ways:
        sweep = joint.sweep(fraction)[:, :2]
        for grip in grips:
            places = joint.path(grip, fraction)
            first, normal = places[0]
            for stance in world.stances(hand, places[len(places) // 2][0], floor, 0.7, most=20):
                if (np.array([*stance.xy, first[2]]) - first) @ normal <= 0.0:
                    continue  # the robot stands behind the face
                if np.linalg.norm(sweep - np.array(stance.xy), axis=1).min() < STAND_OFF:
                    continue
                if all(world.reaches(hand, stance, p) for p, _ in places):
                    return _JointPlan(stance, places, pulls)
    return None


STAND_OFF = 0.3
"""m between the robot's axis and what moves with a joint."""


def _joint_program(
    world: PlannedWorld, joint: OpenableJoint, hand: int, places: list[tuple[Vector, Vector]], pulls: bool
) -> Program | None:
    first, normal = places[0]
    name = joint.object
    # Fingers that push lie along the face, so that they do not enter the gap above a drawer.
    fingers = _across(normal) if pulls else np.cross(normal, -DOWN) * (1.0 if hand == 0 else -1.0)
    if np.linalg.norm(fingers) < 0.5:
        fingers = _across(normal)
    fingers = fingers / np.linalg.norm(fingers)
    quat = world.body.turned(hand, fingers, -normal)
    before = first + ABOVE * normal
    way = hand_way(world.obstacles([name]), world.spheres(fingers, -normal), world.grip(hand), before)
    if way is None:
        way = hand_way(world.obstacles(), world.spheres(fingers, -normal)[:5], world.grip(hand), before)
    if way is None:
        return None
    program = travel(world, hand, way, quat)
    index = joint.object_index
    if not pulls:  # an open hand pushes it shut
        program += [
            Phase(hand=hand, pos=vector3(p - PRESS * n), close=False, tolerance=0.03, limit=12, after="", speed=0.04)
            for p, n in places
        ]
        last = vector3(places[-1][0] - 2 * PRESS * places[-1][1])
        program.append(Phase(hand=hand, pos=last, until=Until.WAITED, limit=6))
    else:
        program += [
            Phase(hand=hand, pos=vector3(first - PUSH_IN * normal), quat=quat, until=Until.TOUCHED, object=index,
                  close=False, limit=20, after="", speed=0.03),
            Phase(hand=hand, pos=vector3(first - PUSH_IN * normal), until=Until.HELD, object=index, close=True,
                  limit=15, after="no_grasp", speed=0.02),
            *[Phase(hand=hand, pos=vector3(p), close=True, tolerance=0.05, limit=20, after="", keeps=index, speed=0.04)
              for p, _ in places[1:]],
            Phase(hand=hand, close=False, until=Until.EMPTY, limit=10, after=""),
        ]  # fmt: skip
    program.append(Phase(hand=hand, pos=vector3(places[-1][0] + RETREAT * places[-1][1]), limit=12, after=""))
    return [*program, *rest(hand), Phase(until=Until.WAITED, limit=4)]


PUSH_IN, PRESS = 0.03, 0.004
"""m behind a face that a hand goes for which takes hold of it, and which pushes it shut."""


def _across(normal: Vector) -> Vector:
    """A direction along a face, upwards where it is upright."""
    up = -DOWN - (-DOWN @ normal) * normal
    return up / np.linalg.norm(up) if np.linalg.norm(up) > 0.3 else np.array([1.0, 0.0, 0.0])


# Switches.


def toggle(value: bool) -> Callable[[PlannedWorld, Step], Primitive]:
    """The primitive that switches on, or off."""

    def toggle(world: PlannedWorld, step: Step) -> Primitive:
        name, reason, detail = step.object, "no_base", ""
        tables = world.domain.model.tables
        links = np.flatnonzero((tables.link_object == world.index(name)) & (tables.link_kind == LinkKind.TOGGLE_BUTTON))
        if not len(links):
            return Outcome("no_grasp", f"{name} has no button")
        for attempt in range(ATTEMPTS):
            if world.facts.holds("toggled_on", name) == value:
                return Outcome(attempts=max(attempt, 1))
            button = np.asarray(world.view.link_pos)[world.world, links[0]].astype(float)
            hand = free_hand(world, attempt)
            found = _plan_touch(world, button, hand, attempt)
            if found is None:
                reason, detail = "no_base", f"no free floor from which a hand reaches the button of {name}"
                continue
            stance, aim = found
            if reason := (yield from go(world, stance)):
                continue
            _, yaw = world.base
            fingers, palm = directions(Stance(stance.xy, yaw), "down")
            quat = world.body.turned(hand, fingers, palm)
            way = hand_way(world.obstacles(), world.spheres(fingers), world.grip(hand), aim)
            if way is None:
                reason, detail = "no_path", f"the hand has no way to the button of {name}"
                continue
            reason = yield [
                *travel(world, hand, way, quat),
                Phase(
                    hand=hand,
                    pos=vector3(button - fingers * FINGER),
                    quat=quat,
                    until=Until.WAITED,
                    limit=5,
                    speed=0.03,
                ),
                *travel(world, hand, way[::-1], None),
                *rest(hand),
            ]
            detail = f"the fingers were not at the button of {name} for long enough"
        if world.facts.holds("toggled_on", name) == value:
            return Outcome(attempts=ATTEMPTS)
        return Outcome(reason or "not_true_after", detail, attempts=ATTEMPTS)

    return toggle


FINGER, NEAR_BUTTON = 0.06, 0.13
"""m from a grasp point to the fingers' frames, and before a button at which a hand comes to it."""


def _plan_touch(world: PlannedWorld, point: Vector, hand: int, attempt: int) -> tuple[Stance, Vector] | None:
    """A stance, and a point near a button that a hand has a way to; from there the fingers go to the button."""
    obstacles, floor = world.obstacles(), world.floor()
    found = 0
    for stance in world.stances(hand, point, floor, AWAY, most=12):
        fingers, _ = directions(stance, "down")
        for offset in (-fingers * (NEAR_BUTTON + FINGER), -DOWN * NEAR_BUTTON - fingers * FINGER):
            aim = point + offset
            if hand_way(obstacles, world.spheres(fingers), world.resting(hand, stance), aim) is not None:
                found += 1
                if found > attempt:
                    return stance, aim
    return None


ACTIONS: dict[str, Callable[[PlannedWorld, Step], Primitive]] = {
    "navigate_to": navigate_to,
    "grasp": grasp,
    "release": release,
    "place_on_top": place("on_top"),
    "place_inside": place("inside"),
    "place_next_to": place("next_to"),
    "place_under": place("under"),
    "place_on_floor": place("on_floor"),
    "open": set_open(True),
    "close": set_open(False),
    "toggle_on": toggle(True),
    "toggle_off": toggle(False),
    "wipe": clean("dusty"),
    "scrub": clean("stained"),
    "soak": soak,
    "slice": slice_,
    "cook": cook,
    "freeze": freeze,
}
"""Primitives that are carried out in physics."""
