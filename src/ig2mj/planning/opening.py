"""Doors, drawers and lids: opened and closed, one joint after the other."""

from __future__ import annotations

import dataclasses
import functools
import itertools
from collections.abc import Callable, Generator, Iterator, Mapping

import numpy as np

from ig2mj.geometry.host_rotations import turn_onto
from ig2mj.planning.clearance import Obstacles, hand_way, passes_wall
from ig2mj.planning.driving import go
from ig2mj.planning.grasps import AT_OBJECT
from ig2mj.planning.joints import AJAR, OPEN_TO, FaceGrip, OpenableJoint, openable_joints
from ig2mj.planning.moves import (
    ABOVE,
    ATTEMPTS,
    CLOSING,
    COMING,
    GRIPPING,
    NEAR,
    RETREAT,
    TOUCHING,
    UP,
    Primitive,
    Program,
    ahead,
    free_hand,
    from_home,
    hand_path,
    rest,
    travel,
    tries_left,
    vector3,
)
from ig2mj.planning.phases import Phase, Until
from ig2mj.planning.pinches import between_fingers
from ig2mj.planning.stances import reaching_all, stances
from ig2mj.planning.steadying import steadied
from ig2mj.planning.steps import Outcome, Step
from ig2mj.planning.world import PlannedWorld, Stance, Vector

STAND_OFF = 0.3
"""m between the robot's axis and what moves with a joint."""

AWAY = 0.7
"""m that a base would like to be from the middle of a joint's way."""

PUSH_IN, PRESS = 0.03, 0.004
"""m behind a face that a hand goes for which takes hold of it, and which pushes it shut."""

EASED = 0.02
"""m that a hand goes off a face slowly which it has pressed on: a door that is let go at once springs open again."""

OFF = (0.0, 0.1, 0.2)
"""m that a hand goes off a link that it has moved, before it goes back to where it rests."""

SHUT, MOVED = 0.01, 0.05
"""Share of a joint's range up to which it counts as shut, and change of it after which the same way is tried again."""

LAST = 0.1
"""Share of a joint's range to which a hand on the edge of a door pulls it shut; it is pushed from there."""

FINGERS = 0.12
"""m of a drawer above a hand that takes hold of it, from which on its fingers may point up."""

UPRIGHT = 0.5
"""Horizontal part of the normal of a face from which on the robot stands in front of it: not of a lid's."""

LIFTED, HOOKED = 0.2, 12
"""Share of its range from which on a lid's inner face is pushed; agent steps in which fingers get below its edge."""

HANDS = 2
"""Hands with which each joint is tried where there is no floor to move it from."""

EMPTY, FULL = (0.04, 0.05), (0.004, 0.015)
"""m in an agent step of a hand that pulls, and m within which it has reached a place on the way: of what is empty, and
of a drawer with things in it. A hand moves in jerks, one in each agent step, under which things slide to the back."""

ARM_SWING, ARM_MOVES, ARM_STILL = 0.35, 14, 6
"""Share of a joint's range by which an arm moves it from one stance where it does not follow it to its end; such moves
for one primitive, and how many of them in a row move nothing, at most."""

SLIDES = (0.3, 0.15)
"""Shares of its range by which a hand that floats moves what slides, where it does not reach all of the way at once."""

STANCES, MOST_STANCES, WAYS, ARM_WAYS = 20, 80, 6, 12
"""Stances for each grip, those among which they are looked for where not all will do, and ways of a hand that are
looked for, at most: of one that floats with each grip, and of one on an arm with one kind of grip, of those at whose
beginning the arm has a posture."""


def set_open(value: bool) -> Callable[[PlannedWorld, Step], Primitive]:
    """The primitive that opens, or closes."""

    def set_open(world: PlannedWorld, step: Step) -> Primitive:
        name, reason, detail = step.object, "no_grasp", ""
        passed, nowhere, tries, failed = dict[str, int](), 0, 1, False
        floats, key = world.body.opening is None, f"move {name}"
        count = 2 * ATTEMPTS - 1 + len(joints_of(world, name)) if floats else ARM_MOVES
        still_left = most = tries_left(count if floats else ARM_STILL, world.missed[key], world.body.opening)
        for _ in range(count):
            if world.facts.holds("open", name) == value:
                return Outcome(attempts=tries)
            tries += failed  # else the next move is of another joint, or goes on where the last was to end
            joints = [j for j in joints_of(world, name) if value or j.fraction > SHUT]
            if not joints:
                return Outcome("no_grasp", f"{name} has no joints that open")
            joint = min(joints, key=lambda j: passed.get(j.name, 0))  # of equals the first: the largest link
            tried = passed.get(joint.name, 0)
            reason, detail = yield from move_joint(world, joint, free_hand(world, tried), value, tried)
            failed = bool(reason)
            nowhere = nowhere + 1 if reason == "no_base" else 0
            if nowhere == HANDS * len(joints):
                break
            now = {j.name: j.fraction for j in joints_of(world, name)}
            still = progress(joint, now, value) < MOVED
            passed[joint.name] = tried + still
            world.missed[key] = world.missed[key] + 1 if still else 0
            still_left = still_left - 1 if still else most
            if not still_left:
                break
        done = world.facts.holds("open", name) == value
        return Outcome(attempts=tries) if done else Outcome(reason or "not_true_after", detail, attempts=tries)

    return set_open


def joints_of(world: PlannedWorld, name: str) -> list[OpenableJoint]:
    """Joints of an object that count for `open`, as they are now."""
    return openable_joints(world.stage.scene, world.view, world.index(name), world.world)


def progress(joint: OpenableJoint, now: Mapping[str, float], value: bool) -> float:
    """By which share of its range a joint has moved the way it was to, given the shares to which all are open now."""
    return (now[joint.name] - joint.fraction) * (1.0 if value else -1.0)


def move_joint(
    world: PlannedWorld,
    joint: OpenableJoint,
    hand: int,
    value: bool,
    tried: int = 0,
    to: float = OPEN_TO,
    stands: Callable[[Stance], bool] = lambda stance: True,
) -> Generator[Program, str, tuple[str, str]]:
    """Opens or closes one door, drawer or lid as far as one motion of a hand does; returns why it did not come there,
    as a reason and in words, or "" twice.

    Args:
      tried: ways that have failed, which are left out. to: share of its range to which it is opened.
      stands: where the robot may stand.
    """
    found = _plan(world, joint, hand, value, tried, to, stands)
    if found is None:
        return "no_base", f"no free floor from which a hand can move {joint.name}"
    if reason := (yield from go(world, found.stance)):
        return reason, f"no path leads to where a hand can move {joint.name}"
    reason = yield from steadied(world, joint.object, hand, _moved(world, joint, hand, found))
    if reason == "no_path":
        return "no_path", f"the hand has no path to {joint.name}"
    now = next(j.fraction for j in joints_of(world, joint.object) if j.name == joint.name)
    if now > found.to - MOVED if value else now < found.to + MOVED:
        return "", ""
    return reason or "not_true_after", f"{joint.name} did not move far enough"


def _moved(world: PlannedWorld, joint: OpenableJoint, hand: int, plan: _JointPlan) -> Generator[Program, str, str]:
    """Moves a joint from where the robot stands, and goes off it; returns why the motion failed."""
    program = yield from from_home(world, hand, functools.partial(_program, world, joint, hand, plan))
    if program is None:
        return "no_path"
    reason = yield program
    yield [Phase(hand=hand, close=False, until=Until.EMPTY, limit=6, after="")]
    yield withdraw(world, hand)
    return reason


def withdraw(world: PlannedWorld, hand: int) -> Program:
    """The empty hand goes back to where it rests, around what it has moved: else it lifts a light box by its open lid.

    Where the hand touches the link, it first goes straight off it, through nothing else if there is such a way.
    """
    return way_off(world, hand, among_walls=True) or way_off(world, hand) or rest(hand)


def way_off(world: PlannedWorld, hand: int, among_walls: bool = False) -> Program:
    """How the empty hand goes straight off what it touches, and then to where it rests; empty where it has no way. It
    keeps clear of all by its spheres where it can: a leaf that is brushed swings on.

    Args:
      among_walls: the hand passes through nothing on the way off, such as the wall of a bag that it is in.
    """
    fingers, palm = world.hand_axes(hand)
    spheres, obstacles = world.spheres(fingers, palm), world.obstacles()
    start, end = world.grip(hand), world.resting(hand, world.stance)
    for share in (1.0, AT_OBJECT):
        there = spheres * (1.0, 1.0, 1.0, share)
        for off in (-palm, -ahead(world.stance.yaw), UP, -fingers):
            for apart in OFF:
                if among_walls and passes_wall(obstacles, there[:, :3], start, start + apart * off):
                    break
                way = hand_way(obstacles, there, start + apart * off, end)
                if way is not None:
                    return [*travel(hand, [start + apart * off, *way], None), *rest(hand)]
    return []


@dataclasses.dataclass(frozen=True, eq=False)
class _JointPlan:
    """How a hand moves a joint: from where, and for each place on the way the point and the normal of the face that it
    is at. pulls: it takes hold of the face; else it pushes it. fingers: where they point or, of a gripper, from one to
    the other. to: share of the joint's range at which the way ends."""

    stance: Stance
    places: list[FaceGrip]
    pulls: bool
    fingers: Vector
    to: float


def _ways(
    world: PlannedWorld, joint: OpenableJoint, value: bool, to: float = OPEN_TO
) -> list[tuple[tuple[FaceGrip, ...], float, bool]]:
    """Grips, share of the joint's range to which they move it, and whether the hand pulls: a door is pulled open by its
    outer face or its edge, and pushed shut by its outer face. Where no floor is free before that, it is pulled by its
    edge until it is nearly shut, or by its inner face until it is ajar; a door between rooms, until it is shut. A door
    between rooms that is ajar is pushed open by a hand that floats: else robot or hand end behind its leaf, and swing
    it shut as they come around that. A lid or flap, which hands do not take hold of, is lifted by fingers below its
    edge, and pushed where it is ajar."""
    between_rooms = _is_between_rooms(world, joint)
    if value and _is_held(world, joint):
        ways = [(joint.grips, to, True), (joint.edges, to, True), (joint.inner_grips, to, False)]
        pushed = between_rooms and joint.fraction > AJAR and world.body.opening is None
        return [ways[-1], *ways[:-1]] if pushed else ways
    if value:
        ways = [(joint.grips, to, True), (joint.edges, to, True), (joint.inner_grips, to, False)]
        return ways if joint.fraction < LIFTED else ways[::-1]
    ways = [(joint.grips, 0.0, False)]
    if not joint.hinge:
        ways.append((joint.edges, 0.0, True))
    elif joint.fraction > LAST + 0.1:
        ways.append((joint.edges, LAST, True))
    if between_rooms:
        ways.append((joint.inner_grips, 0.0, True))
    elif joint.hinge and joint.fraction > AJAR + 0.1:
        ways.append((joint.inner_grips, AJAR, True))
    return [*ways, (joint.grips, 0.0, True)]


def _is_between_rooms(world: PlannedWorld, joint: OpenableJoint) -> bool:
    """Whether a joint is that of a door between rooms."""
    return world.domain.is_door(joint.object)


def _is_held(world: PlannedWorld, joint: OpenableJoint) -> bool:
    """Whether hands take hold of a link: of what is fixed (`ig2mj.scene.build_tables`)."""
    return world.domain.fixed(joint.object)


def _plan(
    world: PlannedWorld,
    joint: OpenableJoint,
    hand: int,
    value: bool,
    tried: int,
    to: float = OPEN_TO,
    stands: Callable[[Stance], bool] = lambda stance: True,
) -> _JointPlan | None:
    floor, obstacles = world.floor(), world.obstacles()
    passed, ways, floats = 0, _ways(world, joint, value, to), world.body.opening is None
    steps = (1.0, ARM_SWING) if not floats else (1.0,) if joint.hinge else (1.0, *SLIDES)
    own = world.only(joint.object_index)
    for step, flat, (grips, end, pulls) in itertools.product(steps, (False,) if floats else (False, True), ways):
        fraction = min(end, joint.fraction + step) if value else max(end, joint.fraction - step)
        count, sweep = 0, joint.sweep(fraction)[:, :2]
        pinches = pulls and joint.hinge and not floats and _is_held(world, joint)
        holds = (_holds(world, joint, own, grip, pulls, hand, pinches) for grip in grips)
        for grip, fingers, pinched in itertools.chain.from_iterable(holds):
            if flat != (pinches and not pinched) or (flat and _is_between_rooms(world, joint)):
                continue  # fingers find nothing between them on a flat face, as a leaf has; handles may be there
            count = 0 if floats else count
            places = joint.path(grip, fraction)
            first, normal = places[0]
            spheres, before = world.spheres(fingers, -normal), first + ABOVE * normal
            if not floats and not obstacles.clear(spheres + np.array([*before, 0.0])):
                continue
            upright = grips is not joint.edges and float(np.linalg.norm(normal[:2])) > UPRIGHT
            middle, face = places[len(places) // 2][0], (first, normal) if upright else None
            proposed = stances(world, hand, middle, floor, AWAY, most=MOST_STANCES, before=face)
            for stance in itertools.islice(filter(stands, proposed), STANCES):
                if np.linalg.norm(sweep - np.array(stance.xy), axis=1).min() < STAND_OFF:
                    continue
                stance = reaching_all(world, hand, stance, np.array([p for p, _ in places]), obstacles)
                if stance is None:
                    continue
                back = [-ahead(stance.yaw), normal, UP]
                quat = world.body.turned(hand, fingers, -normal)
                follows = world.follows(hand, quat, obstacles, stance)
                if follows is not None and not follows.reaches(before):
                    continue
                count += 1
                if count > (WAYS if floats else ARM_WAYS):
                    break
                rests = world.resting(hand, stance)
                way = hand_path(obstacles, spheres, rests, before, back, follows=follows, strays=True)
                if way is None or (follows is not None and not follows.passes([*way, *(p for p, _ in places)])):
                    continue
                passed += 1
                if passed > tried:
                    return _JointPlan(stance, places, pulls, fingers, fraction)
                if not pinched:
                    break  # the next grip; what fits between fingers is tried from other places
    return None


def _holds(
    world: PlannedWorld, joint: OpenableJoint, own: Obstacles, grip: FaceGrip, pulls: bool, hand: int, pinches: bool
) -> Iterator[tuple[FaceGrip, Vector, bool]]:
    """Grips at a place of a face, with where fingers point or, of a gripper, from one to the other, and whether the
    link is between them: all with the link between the fingers, if that is asked for and there are some, else one.

    Args:
      own: the object alone.
    """
    found = _pinched(own, grip, world.body.opening) if pinches and world.body.opening is not None else []
    yield from ((at, fingers, True) for at, fingers in found)
    if not found:
        yield grip, _fingers(joint, grip, pulls, hand, world.body.opening is None), False


def _pinched(own: Obstacles, grip: FaceGrip, opening: float) -> list[tuple[FaceGrip, Vector]]:
    """Grips with the link between the fingers of a gripper, and the directions from finger to finger, those with it in
    the middle first; none: there the link is too wide in any direction, as a flat face is.

    Args:
      own: the object alone. opening: m between the fingers.
    """
    point, normal = grip
    level, up = np.cross(normal, UP), UP - (UP @ normal) * normal
    across = [v / np.linalg.norm(v) for v in (level, up) if np.linalg.norm(v) > 0.3]
    ways = np.array(across or np.eye(3)[:2])
    count = len(ways)
    which, moved = between_fingers(own, np.tile(point, (count, 1)), ways, np.tile(-normal, (count, 1)), opening)
    return [((at, normal), ways[k]) for k, at in zip(which, moved, strict=True)]


def _is_full(world: PlannedWorld, joint: OpenableJoint) -> bool:
    """Whether something loose lies in a drawer."""
    return not joint.hinge and any(joint.surrounds(world.com(n)) for n in world.domain.loose if n not in world.held)


def _fingers(joint: OpenableJoint, grip: FaceGrip, pulls: bool, hand: int, floats: bool) -> Vector:
    """Fingers that pull lie upwards, where the link is that high: else they take hold of the drawer above. Those that
    push lie along the face, so that they do not enter the gap above a drawer, and point to a hinge, away from what is
    next to a door; those of a gripper are level."""
    point, normal = grip
    if joint.hinge and not pulls and floats:
        arm = point - joint.anchor
        back = (arm @ joint.axis) * joint.axis + (arm @ normal) * normal - arm
        return back / np.linalg.norm(back)
    pulls = pulls and (joint.hinge or float(joint.vertices[:, 2].max() - point[2]) > FINGERS)
    across = UP - (UP @ normal) * normal
    across = across / np.linalg.norm(across) if np.linalg.norm(across) > 0.3 else np.array([1.0, 0.0, 0.0])
    if pulls:
        return across
    level = np.cross(normal, UP) * (1.0 if hand == 0 else -1.0)
    return level / np.linalg.norm(level) if np.linalg.norm(level) > 0.5 else across


def _turned(world: PlannedWorld, hand: int, plan: _JointPlan, normal: Vector) -> tuple[float, float, float, float]:
    """Orientation of a hand with its palm at a face as at the first one of its way, where the normal is another."""
    fingers = turn_onto(plan.places[0][1], normal) @ plan.fingers
    return world.body.turned(hand, fingers, -normal)


def _program(world: PlannedWorld, joint: OpenableJoint, hand: int, plan: _JointPlan) -> Program | None:
    places, index = plan.places, joint.object_index
    first, normal = places[0]
    fingers = plan.fingers
    quat = world.body.turned(hand, fingers, -normal)
    _, yaw = world.base
    before, back = first + ABOVE * normal, [-ahead(yaw), normal, UP]
    obstacles = world.obstacles()
    follows = world.follows(hand, quat, obstacles)
    spheres = world.spheres(fingers, -normal)
    way = hand_path(obstacles, spheres, world.grip(hand), before, back, follows=follows, strays=True)
    if way is None:
        return None
    program = travel(hand, way, quat)
    if not plan.pulls:  # an open hand pushes; one that floats turns with the face, which its fingers would go through
        floats = world.body.opening is None
        turned = [_turned(world, hand, plan, n) if floats else None for _, n in places]
        program += [
            Phase(hand=hand, pos=vector3(p - PRESS * n), quat=q, close=False, tolerance=0.03, limit=12, after="",
                  speed=0.04)
            for (p, n), q in zip(places, turned, strict=True)
        ]  # fmt: skip
        last = vector3(places[-1][0] - 2 * PRESS * places[-1][1])
        eased = Phase(hand=hand, pos=vector3(places[-1][0] + EASED * places[-1][1]), tolerance=0.008, limit=12,
                      after="", speed=TOUCHING)  # fmt: skip
        pressed = Phase(hand=hand, pos=last, quat=turned[-1], until=Until.WAITED, limit=6)
        program += [pressed, eased] if floats else [pressed]
    elif not _is_held(world, joint):
        program += [
            Phase(hand=hand, pos=vector3(first - PUSH_IN * normal), quat=quat, close=True, until=Until.WAITED,
                  limit=HOOKED, speed=COMING),
            *[Phase(hand=hand, pos=vector3(p), tolerance=0.05, limit=20, after="", speed=0.03) for p, _ in places[1:]],
            Phase(hand=hand, close=False, until=Until.WAITED, limit=3),
        ]  # fmt: skip
    else:
        floats = world.body.opening is None
        speed, tolerance = FULL if floats and _is_full(world, joint) else EMPTY
        near = Phase(
            hand=hand, pos=vector3(first + NEAR * normal), quat=quat, tolerance=0.01, limit=12, after="", speed=COMING
        )
        limit = 20 + int(np.linalg.norm(places[1][0] - first) / speed)
        # A palm is in the face that it holds, and would push that back where it stayed there while it opens.
        off = vector3(places[-1][0] + RETREAT * places[-1][1]) if floats else None
        program += [
            *([near] if floats else []),
            Phase(hand=hand, pos=vector3(first - PUSH_IN * normal), quat=quat, until=Until.TOUCHED, object=index,
                  close=False, limit=25, after="", speed=TOUCHING if floats else COMING),
            Phase(hand=hand, pos=vector3(first - PUSH_IN * normal), until=Until.HELD, object=index, close=True,
                  limit=15, after="no_grasp", speed=CLOSING if floats else GRIPPING),
            *[Phase(hand=hand, pos=vector3(p), close=True, tolerance=tolerance, limit=limit, after="", keeps=index,
                    speed=speed) for p, _ in places[1:]],
            Phase(hand=hand, pos=off, close=False, until=Until.EMPTY, limit=10, after=""),
        ]  # fmt: skip
    program.append(Phase(hand=hand, pos=vector3(places[-1][0] + RETREAT * places[-1][1]), limit=12, after=""))
    return program
