"""Taking hold of objects, and letting them go."""

from __future__ import annotations

import dataclasses
import functools
import itertools
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence

import numpy as np

from ig2mj.planning.cleaning_area import is_behind, leaves_free
from ig2mj.planning.clearance import Obstacles, straight
from ig2mj.planning.drawing_out import drawn_out, has_room, led_out
from ig2mj.planning.driving import go, nearer
from ig2mj.planning.free_floor import NEAR_START, FreeFloor
from ig2mj.planning.grasps import AT_OBJECT, GraspPose, grasp_poses, ordered
from ig2mj.planning.moves import (
    ATTEMPTS,
    OPENS,
    RETREAT,
    UP,
    Primitive,
    Program,
    carry,
    first_way,
    free_hand,
    from_home,
    goes_on,
    hand_path,
    hand_with,
    rest,
    travel,
    tries_left,
    vector3,
)
from ig2mj.planning.opening_around import Tried, open_around
from ig2mj.planning.phases import Phase, Until
from ig2mj.planning.stances import reaching_all, stances
from ig2mj.planning.steps import Outcome, Step
from ig2mj.planning.taking import closing_on, entries, spheres_of, way_to
from ig2mj.planning.two_hands import grasp_with_both, holds_with_both, release_with_both
from ig2mj.planning.world import AWAY, PlannedWorld, Stance, Vector
from ig2mj.scene.tables import LinkKind
from ig2mj.states.definitions.toggled_on import BUTTON_DISTANCE

LIFT = 0.03
"""m that an object is lifted before it is drawn sideways."""

Prefers = Callable[[GraspPose], float]
"""How good a pose is, for those who want a certain one."""

CLEARLY = 0.05
"""By which a pose has to be better than another to come before it."""

MAKES_ROOM = 0.02
"""m from where a hand carries something beyond which it goes aside for what another takes."""

MOVED = 0.03
"""m that an object has moved beyond which its grasp is planned again."""

SAME = 0.01
"""m up to which the corners of an object that lies as before have moved."""

RESTS = 15
"""Agent steps in which what has moved comes to rest."""

ARM_ATTEMPTS = 8
"""Tries of a gripper, whose fingers have to come below or around what a palm only touches."""

FIRM = 8
"""Agent steps in which fingers close firmly on what they hold by friction alone."""

POSES, WAYS, ARM_POSES, ARM_WAYS = 6, 120, 24, 720
"""Poses that are tried from a stance, and ways of a hand that are looked for, at most, and those of a gripper on an
arm, which has a posture for few of the poses that fit its object: where these give no way, as many others for which it
has one are tried."""


LOWER = 0.04
"""m between the heights at which what is let go has to have room."""

LAST_AIMS, AIMS_APART = 16, 0.025
"""Points of an object that stances are looked for where there are none for its middle and its ends, and m between
them."""

NEAREST = 200
"""Cells of the floor that are compared to find the edge of an object that is nearest to it."""


def grasp(world: PlannedWorld, step: Step, prefers: Prefers | None = None) -> Primitive:
    """The hand goes onto a side of the object that has room for it, until it holds it; of sides that `prefers` finds
    better by at least `CLEARLY`, these first; None: those that leave the side of a tool free that cleans, or the
    button of a spray.
    """
    name = step.object
    if world.domain.hands_for(name) > 1:
        return (yield from grasp_with_both(world, name))
    if name in world.held:
        return Outcome()
    if not is_graspable(world, name):
        return Outcome("no_grasp", f"{name} is fixed, or its category allows no assisted grasp")
    reason, detail, tried, moved = "no_grasp", "", tried_in_vain(world, name), Tried()
    most = ATTEMPTS if world.body.opening is None else ARM_ATTEMPTS
    nowhere, missed, attempts = 0, 0, tries_left(most, world.missed[f"grasp {name}"], world.body.opening)
    for attempt in range(attempts):
        if nowhere and nowhere >= world.held.count(""):  # no hand finds a way
            break
        yield from _off_furniture(world)
        yield from off_others_things(world)
        hand = free_hand(world, attempt)
        if prefers is None and name in world.domain.tools and world.body.opening is None:
            prefers = functools.partial(_leaves_free, world, name)
        elif prefers is None and name in world.domain.tools:
            prefers = functools.partial(_from_behind, world, name)
        elif prefers is None and name in world.domain.sprays:
            prefers = functools.partial(_off_button, world, name)
        found = _plan(world, name, hand, tried, prefers)
        while found is None and (yield from open_around(world, name, moved)):
            found = _plan(world, name, hand, tried, prefers)
        if found is None:
            found = _plan(world, name, hand, tried, prefers, AT_OBJECT)
        if found is None and tried and not missed:  # all others have failed before
            tried.clear()
            found = _plan(world, name, hand, tried, prefers) or _plan(world, name, hand, tried, prefers, AT_OBJECT)
        if found is None:
            reason, detail = "no_base", f"no free floor from which a hand has a way to {name}"
            if not tried and world.body.opening is not None and not grasp_poses(world, name, world.obstacles([name])):
                reason, detail = "no_grasp", f"the gripper fits around no part of {name} that it has room at"
            nowhere += 1
            continue
        nowhere, missed = 0, missed + 1
        (stance, pose), before = found, world.com(name)
        if reason := (yield from go(world, stance)):
            detail = f"no path leads to where a hand reaches {name}"
            tried.append(pose)
            continue
        if np.linalg.norm(world.com(name) - before) > MOVED:
            reason, detail = "no_grasp", f"{name} was moved while the robot went there"
            yield [Phase(until=Until.WAITED, limit=RESTS)]
            continue
        tried.append(pose)
        reason, detail = yield from _take(world, name, hand, pose, attempt)
        if name in world.held:
            world.missed[f"grasp {name}"] = 0
            world.vain.pop(name, None)
            return Outcome(attempts=missed)
        world.missed[f"grasp {name}"] += 1
    return Outcome(reason or "no_grasp", detail, attempts=max(missed, 1))


def tried_in_vain(world: PlannedWorld, name: str) -> list[GraspPose]:
    """Poses of a floating hand with which earlier requests of the episode have not taken an object that lies as it did:
    they fail again. What is appended to the list is remembered."""
    corners, floats = world.vertices(name), world.body.opening is None
    before, poses = world.vain.get(name, (corners, []))
    if not floats or np.abs(corners - before).max() > SAME:
        before, poses = corners, []
    world.vain[name] = before, poses
    return poses


def held_again(world: PlannedWorld, name: str) -> Generator[Program, str, bool]:
    """Takes what a primitive holds again where the hands have lost it; returns whether they hold it."""
    if name in world.held:
        return True
    return (yield from grasp(world, Step("grasp", (name,)))).done


def set_aside(world: PlannedWorld) -> Generator[Program, str, str]:
    """Where no hand is free, puts down what one holds where the robot stands: the caller takes it again
    (`held_again`). Returns its name; "": a hand is free already."""
    if not all(world.held):
        return ""
    name = world.held[0]
    yield from release(world, Step("release", (name,)))
    return name


def with_free_hand(world: PlannedWorld, action: Generator[Program, str, bool]) -> Generator[Program, str, bool]:
    """Does something that needs a free hand; where none is free, what one holds is put down and taken again. Returns
    whether it was done, and the hand has again what it held."""
    aside = yield from set_aside(world)
    done = yield from action
    held = not aside or (yield from held_again(world, aside))
    return done and held


def _off_furniture(world: PlannedWorld) -> Generator[Program, str, None]:
    """Hands let go of doors and drawers: one that ran into a drawer has lost what it held, and closed on that."""
    for hand, name in enumerate(world.held):
        if name and world.domain.fixed(name):
            yield [Phase(hand=hand, close=False, until=Until.EMPTY, limit=15, after=""), *rest(hand)]


def off_others_things(world: PlannedWorld) -> Generator[Program, str, None]:
    """Hands let go of what another holds already, where one hand lifts it: one that has lost what it held on its way
    has closed on that, and would count as full."""
    for hand, name in enumerate(world.held):
        if name in world.held[:hand] and name and world.domain.hands_for(name) == 1:
            yield [Phase(hand=hand, close=False, until=Until.EMPTY, limit=15, after=""), *rest(hand)]


def _leaves_free(world: PlannedWorld, name: str, pose: GraspPose) -> float:
    return float(leaves_free(world, name, pose))


def _from_behind(world: PlannedWorld, name: str, pose: GraspPose) -> float:
    return float(is_behind(world, name, pose.palm))


def _off_button(world: PlannedWorld, name: str, pose: GraspPose) -> float:
    """How far the fingers of a hand at a pose are from the button of what it takes; 1: they do not press it."""
    button = button_of(world, name)
    if button is None:
        return 1.0
    return min(float(np.linalg.norm(pose.point + FINGER * pose.fingers - button)) / (BUTTON_DISTANCE + SPARE), 1.0)


FINGER, SPARE = 0.06, 0.05
"""m from a grasp point to the fingers' frames, and by which they stay farther from a button than would press it."""


def button_of(world: PlannedWorld, name: str) -> Vector | None:
    """Where the button of an object is, m, world frame; None: it has none."""
    tables = world.domain.model.tables
    links = np.flatnonzero((tables.link_object == world.index(name)) & (tables.link_kind == LinkKind.TOGGLE_BUTTON))
    return np.asarray(world.view.link_pos)[world.world, links[0]].astype(float) if len(links) else None


def is_graspable(world: PlannedWorld, name: str) -> bool:
    """Whether hands take hold of an object."""
    return world.domain.graspable(name)


def _take(
    world: PlannedWorld, name: str, hand: int, pose: GraspPose, attempt: int = 0
) -> Generator[Program, str, tuple[str, str]]:
    """Takes an object from where the robot stands; returns why it did not, as a reason and in words. `attempt`: number
    of the try."""
    index, start = world.index(name), pose.at(pose.before)
    find = functools.partial(way_to, world, name, hand, pose)
    way = yield from from_home(world, hand, find)
    turned = world.body.turned(hand, pose.fingers, pose.palm)
    if way is None and (yield from nearer(world, hand, turned, pose.at(0.0))):
        way = find()
    if way is None:
        return "no_path", f"the hand has no path to {name}"
    lift = LIFT * UP * float(pose.palm @ UP > -0.9)
    closes = True if world.body.friction or world.body.opening is not None else None
    takes = [
        *closing_on(world, name, hand, pose, way, attempt),
        *([Phase(hand=hand, pos=vector3(pose.at(-pose.deep)), close=True, until=Until.WAITED, limit=FIRM)]
          if world.body.friction else []),
        *([Phase(hand=hand, pos=vector3(pose.at(0.0) + lift), keeps=index, close=closes, tolerance=0.02, limit=10,
                 after="", speed=0.03)] if lift.any() else []),
    ]  # fmt: skip
    points, carries = [p + lift for p in way[-2::-1]], carry(world, hand, keeps=index, name=name, grip=pose.point)
    leaves = [
        Phase(hand=hand, pos=vector3(start + lift), keeps=index, close=closes, tolerance=0.04, limit=30, after="",
              speed=0.03),
        *travel(hand, points, None, keeps=index),
        *_making_room(world, name, hand),
        carries,
    ]  # fmt: skip
    reason = yield takes
    if not reason and name in world.held:
        ends = [start + lift, *points, world.carried(hand, world.stance)]
        if world.body.opening is not None:
            led = yield from led_out(world, name, hand, ends, carries)
            turning = [dataclasses.replace(p, quat=None if p.in_body else turned) for p in leaves]
            reason = (yield turning) if led is None else led
        else:
            carries = carry(world, hand, keeps=index)
            out = None if has_room(world, name, hand, ends) else drawn_out(world, name, hand, carries)
            reason = yield [*leaves[:-1], carries] if out is None else [*_making_room(world, name, hand), *out]
    if name in world.held:
        return "", ""
    back = vector3(world.grip(hand) - pose.before * pose.palm)
    yield [Phase(hand=hand, close=False, pos=back, limit=10, after=""), *travel(hand, way[-2::-1], None), *rest(hand)]
    detail = f"the hand closed on {name} and does not hold it" if reason == "no_grasp" else ""
    return reason or "slipped", detail


def _making_room(world: PlannedWorld, name: str, hand: int) -> Program:
    """Other hands that float carry what they hold farther aside, where it would meet what a hand takes."""
    held = [name if h == hand else n for h, n in enumerate(world.held)]
    others = [h for h, n in enumerate(world.held) if h != hand and n and not world.domain.fixed(n)]
    return [
        carry(world, other, keeps=world.index(held[other]), held=held)
        for other in (others if world.body.opening is None else [])
        if np.linalg.norm(world.carry(other, held=held) - world.carry(other)) > MAKES_ROOM
    ]


def _plan(
    world: PlannedWorld,
    name: str,
    hand: int,
    tried: Sequence[GraspPose],
    prefers: Prefers | None = None,
    room: float = 1.0,
) -> tuple[Stance, GraspPose] | None:
    """A stance and a pose from which the hand has a way, the most comfortable first; later attempts take others.

    Args:
      room: `GraspPose.room`.
    """
    obstacles, floor = world.obstacles([name], stays=False), world.floor()
    poses = [p for p in grasp_poses(world, name, obstacles, room) if not any(_alike(p, t) for t in tried)]
    if not poses:
        return None
    points, on_arm = np.array([p.point for p in poses]), world.body.opening is not None
    count, most = (ARM_POSES, ARM_WAYS) if on_arm else (POSES, WAYS)

    def candidates(others: bool) -> Iterator[tuple[Stance, GraspPose]]:
        aims = [world.com(name), *points[_spread(points, world.com(name))], _nearest(world, floor, points)]
        hardly = points[_apart(points)]
        found = False
        for k, point in enumerate((*aims, *hardly)):
            if k >= len(aims) and found:
                break
            for stance in _beside_first(world, name, stances(world, hand, point, floor, AWAY)):
                found = True
                best = ordered(poses, stance.yaw, on_arm)
                if prefers is not None:
                    best.sort(key=_less_wanted(prefers))
                reached = ((_reaching(world, hand, stance, pose, obstacles), pose) for pose in best)
                near = ((at, pose) for at, pose in reached if at is not None)
                if others:
                    near = filter(has_posture, itertools.islice(near, count, None))
                yield from itertools.islice(near, count)

    def has_posture(candidate: tuple[Stance, GraspPose]) -> bool:
        stance, pose = candidate
        follows = world.follows(hand, world.body.turned(hand, pose.fingers, pose.palm), obstacles, stance)
        return follows is not None and follows.reaches(pose.at(pose.before))

    def has_way(candidate: tuple[Stance, GraspPose], search: bool) -> bool:
        stance, pose = candidate
        spheres, goal, back = spheres_of(world, pose), pose.at(pose.before), entries(pose, stance.xy)
        follows = world.follows(hand, world.body.turned(hand, pose.fingers, pose.palm), obstacles, stance)
        rests, standing = world.resting(hand, stance), world.standing(obstacles, stance, hand, body=False)
        way = hand_path(standing, spheres, rests, goal, back, search=search, follows=follows)
        return goes_on(way, pose.at(0.0), follows, strays=search)

    found = first_way(candidates(False), has_way, most)
    return found or (first_way(candidates(True), has_way, most) if on_arm else None)


def _beside_first(world: PlannedWorld, name: str, proposed: Iterable[Stance]) -> Iterator[Stance]:
    """Those first in which a robot whose hands float is not above the object, which it would raise against its body."""
    if world.body.opening is not None:
        yield from proposed
        return
    own, height = world.only(world.index(name)), world.com(name)[2]
    above = list[Stance]()
    for stance in proposed:
        if float(own.distance(np.array([[*stance.xy, height]]))[0]) > world.body.trunk[0]:
            yield stance
        else:
            above.append(stance)
    yield from above


def _reaching(world: PlannedWorld, hand: int, stance: Stance, pose: GraspPose, obstacles: Obstacles) -> Stance | None:
    """A stance with the body as high as it takes for a pose; None: the hand does not reach it from there."""
    if world.reaches(hand, stance, pose.at(pose.before)):
        return stance
    return reaching_all(world, hand, stance, np.array([pose.at(pose.before), pose.at(0.0)]), obstacles)


def _less_wanted(prefers: Prefers) -> Callable[[GraspPose], int]:
    return lambda pose: -round(prefers(pose) / CLEARLY)


def _alike(one: GraspPose, other: GraspPose) -> bool:
    return bool(np.linalg.norm(one.point - other.point) < 0.02 and one.palm @ other.palm > 0.9)


def _spread(points: np.ndarray, centre: Vector) -> list[int]:
    """Points of a large object that are far from its centre, and from each other, at most three."""
    found: list[int] = []
    for k in np.argsort(-np.linalg.norm(points[:, :2] - centre[:2], axis=1)):
        if np.linalg.norm(points[k, :2] - centre[:2]) < 0.25 or len(found) == 3:
            break
        if all(np.linalg.norm(points[k, :2] - points[f, :2]) > 0.25 for f in found):
            found.append(int(k))
    return found


def _apart(points: np.ndarray) -> list[int]:
    """Points that are apart from each other, at most `LAST_AIMS`."""
    found: list[int] = []
    for k in range(len(points)):
        if len(found) < LAST_AIMS and all(np.linalg.norm(points[k] - points[f]) > AIMS_APART for f in found):
            found.append(k)
    return found


def _nearest(world: PlannedWorld, floor: FreeFloor, points: np.ndarray) -> Vector:
    """The point that is nearest to floor to which the robot can drive: the edge of what lies far from it."""
    here, _ = world.base
    middles = floor.occupancy.middles(np.argwhere(np.isfinite(floor.distances(here, NEAR_START))))
    if not len(middles):
        return points[0]
    near = middles[np.argsort(np.linalg.norm(middles - points[0][:2], axis=1))[:NEAREST]]
    return points[int(np.argmin(np.linalg.norm(points[:, None, :2] - near[None], axis=-1).min(1)))]


def release(world: PlannedWorld, step: Step) -> Primitive:
    """Lowers what the hand holds as far as there is room, and opens the hand."""
    name = step.object
    hand = hand_with(world, name)
    if holds_with_both(world, name):
        return (yield from release_with_both(world, name))
    down = lowered(world, name, hand) if not world.domain.fixed(name) else []
    at = world.grip(hand) if not down or down[-1].pos is None else np.array(down[-1].pos)
    off = vector3(at - RETREAT * world.hand_axes(hand)[1])
    reason = yield [
        *down,
        Phase(hand=hand, close=False, until=Until.EMPTY, limit=15),
        Phase(hand=hand, close=False, until=Until.WAITED, limit=OPENS),
        Phase(hand=hand, pos=off, tolerance=0.04, limit=15, after=""),
        *rest(hand),
    ]
    return Outcome() if name not in world.held else Outcome(reason or "not_true_after", "the hand did not open")


def put_down_others(world: PlannedWorld, name: str) -> Generator[Program, str, None]:
    """Puts down what other hands hold than an object, where no hand is free."""
    for other in [n for n in world.held if n and n != name] if all(world.held) else []:
        yield from release(world, Step("release", (other,)))


def lowered(world: PlannedWorld, name: str, hand: int) -> Program:
    """The hand goes straight down until what it holds is right above what is below it, or as far as it reaches."""
    obstacles, grip = world.obstacles([name], world.stance), world.grip(hand)
    spheres = world.spheres(*world.hand_axes(hand), holding=name, hand=hand)
    low, down = grip, 0.0
    for down in np.arange(LOWER, grip[2], LOWER):
        there = grip - down * UP
        if not world.reaches(hand, world.stance, there) or not straight(obstacles, spheres, low, there):
            break
        low = there
    if low is grip:
        return []
    return [Phase(hand=hand, pos=vector3(low), keeps=world.index(name), tolerance=0.03, limit=40, after="")]
