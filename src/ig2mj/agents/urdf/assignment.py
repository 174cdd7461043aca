"""Which joints and links of a robot are wheels, arms, grippers and sensors: found from its geometry and from names.

- Wheels turn without end about a horizontal axis, and touch the floor or are named so. Those that swivel about a
  vertical axis, or are named as casters, are not driven where others are.
- The base is differential with one wheel on either side, skid-steer with more. It is omnidirectional where wheels point
  in different directions, where all of them swivel, or where names say so.
- Grippers are joints named as fingers or jaws, and where an arm has none of those, the short branches at its end.
- Legs are refused: ig2mj does not simulate walking. So are wheels that are steered like a car's.
"""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Collection, Mapping, Sequence
from typing import Any

import numpy as np

from ig2mj.agents.urdf.body import RobotBody
from ig2mj.agents.urdf.description import Description, RobotJoint
from ig2mj.agents.urdf.layout import (
    DIFFERENTIAL,
    FIXED,
    OMNIDIRECTIONAL,
    SKID_STEER,
    TURNING_WHEELS,
    Gripper,
    Layout,
)
from ig2mj.agents.urdf.layout_file import check_entries
from ig2mj.errors import InputError

LEFT = frozenset(("left", "l", "fl", "rl", "bl", "ml", "lf", "lr", "lb", "lm"))
RIGHT = frozenset(("right", "r", "fr", "rr", "br", "mr", "rf", "rb", "rm"))
"""Words of a wheel's name that say on which side it is, as in `wheel_fl` and `rl_wheel_joint`."""

FINGERS = ("finger", "jaw", "thumb", "knuckle", "claw", "pincer", "driver")
GRIPS = ("gripper", *FINGERS)
PASSIVE = ("caster", "castor", "swivel")
STEERING = ("steer",)
OMNI = ("mecanum", "omni", "swedish", "holonomic")
SUCTION = ("suction", "vacuum")
CAMERAS = ("camera", "realsense", "kinect", "xtion", "eyes", "cam_", "_cam", "head_tilt", "head")
LASERS = ("laser", "scan", "lidar")

LEGS = frozenset(("hip", "thigh", "calf", "knee", "ankle", "shank", "foot", "leg", "haa", "hfe", "kfe"))
"""Words of joints of legs."""

FEWEST_LEGS = 2

FEWEST_FINGERS = 2
"""Joints named as a gripper's on one link, so that the joint that moves this link carries the gripper."""

LEVEL = 0.3
"""Largest share of a wheel's axis that points upwards, and of a swivel's that does not."""

TOUCHES = 0.02
"""m above the robot's lowest point at which a wheel still touches the floor."""

PARALLEL = 0.95
"""Cosine of the angle between wheels of one direction."""

CLEAR, POSTURES = 0.02, 300
"""m above the floor of an arm at the start, and postures tried, where its file says nothing of it."""

SHORT_BRANCH, ARM_BEFORE = 4, 3
"""Most joints in a row of a finger, and fewest between base and hand, where names say nothing."""


def find_layout(
    robot: Description, body: RobotBody, given: Mapping[str, Any] | None = None, where: str = "layout"
) -> Layout:
    """The layout of a robot.

    Args:
      body: of this robot. given: entries that are taken as they are, as in a
        layout file. where: what errors name.

    Raises:
      InputError: an entry is of the wrong kind, the robot cannot be driven so, it has legs, or it steers like a car.
      UnknownNameError: the robot has no such joint or link.
    """
    given = dict(given or {})
    check_entries(robot, given, where)
    joints = [joint for joint in robot.joints if joint.mimics is None and not joint.passive]
    found_base, found_wheels = _drive(robot, body)
    wheels = tuple(given["wheels"]) if "wheels" in given else found_wheels
    if ("wheels" in given and found_base in TURNING_WHEELS) or (wheels and found_base == FIXED):
        even = len(wheels) > 0 and len(wheels) % 2 == 0
        found_base = FIXED if not even else DIFFERENTIAL if len(wheels) == 2 else SKID_STEER
    base = given.get("base", found_base)
    if "base" not in given and "wheels" not in given:
        if base == FIXED:
            _refuse_legs(robot, where)
        if base != OMNIDIRECTIONAL:
            _refuse_steering(robot, body, where)
    _check_wheels(base, wheels, where)
    wheels = wheels if base != FIXED else ()
    carrying = body.joints_to({robot.joint(name).child for name in wheels})
    free = [j for j in joints if j.name not in wheels and j.name not in carrying and not _named(j.name, PASSIVE)]
    several = _several(robot, free, given, where)
    gripper = [name for one in several for name in one.joints]
    if not several:
        without_hand = given.get("hand") == ""
        gripper = given.get("gripper", [] if without_hand else _gripper(robot, free, given))
        if gripper and without_hand:
            raise InputError(where, "a gripper has no hand", element="hand", fix="name its link, or gripper = []")
    rolling = {j.name for j in free if j.type == "continuous" and _named(j.name, ("wheel",))}
    arm = given.get("arm", [j.name for j in free if j.name not in gripper and j.name not in rolling])
    both = sorted(set(arm) & set(gripper))
    if both:
        raise InputError(where, f"joint '{both[0]}' is of the arm and of the gripper", element="arm, gripper")
    suction = tuple(given["suction"] if "suction" in given else _suction(robot, body))
    hand = several[0].hand if several else _link(given, "hand", _hand(robot, arm, gripper, suction))
    return Layout(
        base=base,
        wheels=wheels,
        arm=tuple(arm),
        gripper=tuple(gripper),
        closed=given.get("closed", "" if gripper and not several else "lower"),
        hand=hand,
        camera=_link(given, "camera", _first(robot, CAMERAS)),
        laser=_link(given, "laser", _first(robot, LASERS, on_base=True)),
        start={joint: float(at) for joint, at in given.get("start", _start(robot, body)).items()},
        several=several,
        suction=suction,
        mount=None if "mount" not in given else float(given["mount"]),
    )


def _check_wheels(base: str, wheels: Sequence[str], where: str) -> None:
    if base in TURNING_WHEELS and (not wheels or len(wheels) % 2):
        kind = "a differential drive" if base == DIFFERENTIAL else "a skid-steer drive"
        raise InputError(
            where, f"{kind} has two wheels, or two, three ... on each side, not {len(wheels)}",
            element="wheels",
            fix='name them, left and right: wheels = ["left_wheel_joint", "right_wheel_joint"], or base = "fixed"',
        )  # fmt: skip


def _drive(robot: Description, body: RobotBody) -> tuple[str, tuple[str, ...]]:
    """The kind of base, and its wheels."""
    rolling = [joint for joint in robot.joints if joint.mimics is None and _rolls(joint, body)]
    swivel = [joint for joint in rolling if _named(joint.name, PASSIVE) or _swivels(robot, body, joint)]
    straight = [joint for joint in rolling if joint not in swivel]
    if robot.omnidirectional:
        return OMNIDIRECTIONAL, tuple(joint.name for joint in rolling)
    named_omni = any(_named(name, OMNI) for joint in rolling for name in (joint.name, joint.child))
    if not straight and len(swivel) >= 3 and not all(joint.passive for joint in swivel):
        return OMNIDIRECTIONAL, tuple(joint.name for joint in swivel)
    axes = np.array([body.axis(joint.name) for joint in straight]).reshape(-1, 3)
    differ = len(axes) >= 3 and bool((np.abs(axes @ axes.T) < PARALLEL).any())
    if straight and (named_omni or differ):
        return OMNIDIRECTIONAL, tuple(joint.name for joint in straight)
    left, right = _sides(straight, body)
    if left and len(left) == len(right):
        return (DIFFERENTIAL if len(left) == 1 else SKID_STEER), tuple(j.name for j in (*left, *right))
    return FIXED, ()


def _rolls(joint: RobotJoint, body: RobotBody) -> bool:
    """A wheel, driven or not."""
    if joint.type != "continuous" or abs(body.axis(joint.name)[2]) > LEVEL:
        return False
    lowest = body.lowest(joint.child)
    return _named(joint.name, ("wheel",)) or (lowest is not None and lowest < body.lowest_point + TOUCHES)


def _swivels(robot: Description, body: RobotBody, wheel: RobotJoint) -> bool:
    """Something between it and the base turns about a vertical axis."""
    return _swivel(robot, body, wheel) is not None


def _swivel(robot: Description, body: RobotBody, wheel: RobotJoint) -> RobotJoint | None:
    """The joint between a wheel and the base that turns about a vertical axis."""
    above = {joint.child: joint for joint in robot.joints}
    link = wheel.parent
    while link in above:
        joint = above[link]
        if joint.type in ("revolute", "continuous") and abs(body.axis(joint.name)[2]) > 1 - LEVEL:
            return joint
        link = joint.parent
    return None


def _sides(wheels: Sequence[RobotJoint], body: RobotBody) -> tuple[list[RobotJoint], list[RobotJoint]]:
    """Those on the left and those on the right, by their names, and where names do not say so, by where they are."""
    left, right = ([joint for joint in wheels if side & _words(joint.name)] for side in (LEFT, RIGHT))
    if len(left) == len(right) and len(left) + len(right) == len(wheels) and left:
        return left, right
    at = {joint.name: body.hub(joint.name)[1] for joint in wheels}
    return [j for j in wheels if at[j.name] > 0], [j for j in wheels if at[j.name] < 0]


def _refuse_steering(robot: Description, body: RobotBody, where: str) -> None:
    """Raises InputError: some of its wheels are steered, by joints with limits and motors."""
    wheels = [joint for joint in robot.joints if joint.mimics is None and _rolls(joint, body)]
    swivels = [_swivel(robot, body, wheel) for wheel in wheels]
    steering = [j.name for j in swivels if j is not None and _steers(j, body)]
    if steering:
        raise InputError(
            where,
            f"robot '{robot.name}' steers like a car ({', '.join(steering)}): Ackermann steering is not supported",
            element="base",
            fix='base = "fixed" bolts it to the floor, in a layout',
        )


def _steers(joint: RobotJoint, body: RobotBody) -> bool:
    """It has a motor and two ends, or is named so; casters do not."""
    if joint.passive or _named(joint.name, PASSIVE):
        return False
    return _named(joint.name, STEERING) or bool(np.isfinite(body.limits(joint.name)).all())


def _refuse_legs(robot: Description, where: str) -> None:
    """Raises InputError: the robot has legs and no wheels."""
    above = {joint.child: joint for joint in robot.joints}

    def root(joint: RobotJoint) -> str:
        while joint.parent in above and _is_leg(above[joint.parent]):
            joint = above[joint.parent]
        return joint.name

    legs = {root(joint) for joint in robot.joints if _is_leg(joint)}
    if len(legs) >= FEWEST_LEGS:
        raise InputError(
            where, f"robot '{robot.name}' has legs ({', '.join(sorted(legs)[:4])}): legged robots are not supported",
            element="base", fix='base = "fixed" bolts it to the floor, in a layout',
        )  # fmt: skip


def _is_leg(joint: RobotJoint) -> bool:
    """A joint such as `LF_HAA`, `FL_thigh_joint`, `j_left_knee`, and not of a gripper that hangs on a foot."""
    return not _named(joint.name, GRIPS) and bool((_words(joint.name) | _words(joint.child)) & LEGS)


def _named(name: str, parts: Sequence[str]) -> bool:
    return any(part in name.lower() for part in parts)


def _words(name: str) -> set[str]:
    """The words of a name: "wheelFL_joint" has wheel, fl and joint."""
    return {word.lower() for word in re.findall(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])", name)}


def _grips(robot: Description, joint: RobotJoint) -> bool:
    """It opens and closes a gripper, and does not turn without end. A joint that is not named so, and carries one that
    is, turns the whole gripper."""
    if joint.type == "continuous" or not _named(joint.child, FINGERS):  # a wrist may turn a whole "gripper_link"
        carried = [j for j in robot.joints if j.parent == joint.child and j.mimics is None and _named(j.name, GRIPS)]
        return joint.type != "continuous" and _named(joint.name, GRIPS) and len(carried) < FEWEST_FINGERS
    if _named(joint.name, GRIPS):
        return True
    return not any(other.parent == joint.child and _named(other.name, GRIPS) for other in robot.joints)


def _gripping(robot: Description, free: Sequence[RobotJoint]) -> list[RobotJoint]:
    """Joints of grippers: by their names, and those at the ends of arms whose joints have no such names."""
    named = [joint for joint in free if _grips(robot, joint)]
    hands = {hand_of(robot, joint.name, {j.name for j in named}) for joint in named}
    below: dict[str, list[RobotJoint]] = {}
    for joint in robot.joints:
        below.setdefault(joint.parent, []).append(joint)
    above = {joint.child: joint for joint in robot.joints}

    def depth(link: str) -> int:
        return 1 + depth(above[link].parent) if link in above else 0

    def longest(joint: RobotJoint) -> int:
        return 1 + max(map(longest, below.get(joint.child, [])), default=0)

    def inside(joint: RobotJoint) -> list[RobotJoint]:
        return [joint, *(j for child in below.get(joint.child, []) for j in inside(child))]

    found = list(named)
    for link, branches in below.items():
        moving = [joint for joint in branches if joint.type != "continuous"]
        if len(moving) < 2 or depth(link) < ARM_BEFORE or any(longest(joint) > SHORT_BRANCH for joint in moving):
            continue
        chain, at = {link}, link
        while at in above:
            at = above[at].parent
            chain.add(at)
        if chain & hands or any(hand in {j.child for b in moving for j in inside(b)} for hand in hands):
            continue
        found += [j for branch in moving for j in inside(branch) if j in free and j not in found]
    for link in hands:  # other fingers of a hand, whatever they are called
        fingers = [
            j
            for j in below.get(link, [])
            if j.type != "continuous" and longest(j) <= SHORT_BRANCH and not hands & {k.child for k in inside(j)}
        ]
        found += [j for finger in fingers for j in inside(finger) if j in free and j not in found]
    return [joint for joint in free if joint in found]


def _gripper(robot: Description, free: Sequence[RobotJoint], given: Mapping[str, Any]) -> list[str]:
    """Joints of the only gripper."""
    taken = set(given.get("arm", ()))
    named = [joint.name for joint in free if _grips(robot, joint)]
    found = [joint.name for joint in _gripping(robot, free) if joint.name not in taken]
    return found if set(named) <= set(found) else named


def _several(
    robot: Description, free: Sequence[RobotJoint], given: Mapping[str, Any], where: str
) -> tuple[Gripper, ...]:
    """Grippers given as such, or found on different hands; none where there is just one, or joints are given."""
    if "grippers" in given:
        made = tuple(Gripper(tuple(g["joints"]), g["hand"], g.get("closed", "")) for g in given["grippers"])
        names = [name for one in made for name in one.joints]
        if twice := sorted({name for name in names if names.count(name) > 1}):
            raise InputError(where, f"joint '{twice[0]}' is of two grippers", element="grippers")
        return made
    if {"gripper", "hand"} & set(given):
        return ()
    chosen, taken = _gripping(robot, free), set(given.get("arm", ()))
    on_hand: dict[str, list[str]] = {}
    for joint in chosen:
        if joint.name not in taken:
            on_hand.setdefault(hand_of(robot, joint.name, {j.name for j in chosen}), []).append(joint.name)
    closed = given.get("closed", "")
    return tuple(Gripper(tuple(names), hand, closed) for hand, names in on_hand.items()) if len(on_hand) > 1 else ()


def hand_of(robot: Description, joint: str, gripper: Collection[str]) -> str:
    """The link on which a joint of a gripper hangs, over all other joints of grippers and those that follow them."""
    above = {entry.child: entry for entry in robot.joints}
    link = robot.joint(joint).parent
    while link in above and (
        above[link].name in gripper or robot.leader(above[link].name) in gripper or above[link].passive
    ):
        link = above[link].parent
    return link


def _suction(robot: Description, body: RobotBody) -> list[str]:
    """The outermost link named so of each link that moves."""
    named = [link for link in robot.frames if _named(link, SUCTION)]
    last = {robot.frames[link].on: link for link in named}
    return list(last.values())


def _hand(robot: Description, arm: Sequence[str], gripper: Sequence[str], suction: Sequence[str]) -> str | None:
    """The link that the gripper hangs on, else the last one of the longest arm; None where suction holds."""
    if gripper:
        return hand_of(robot, gripper[0], set(gripper))
    if suction or not arm:
        return None
    above = {joint.child: joint for joint in robot.joints}

    def before(link: str) -> int:
        return (above[link].name in arm) + before(above[link].parent) if link in above else 0

    ends = [robot.joint(name).child for name in arm]
    most = max(map(before, ends))
    return next(link for link in reversed(ends) if before(link) == most)


def _first(robot: Description, names: Sequence[str], on_base: bool = False) -> str | None:
    """The first link of the most likely name; an optical frame only where there is no other. on_base: those that are
    fixed to the base come first."""
    for part in names:
        found = [link for link in robot.frames if part in link.lower()]
        if found:
            away = {link: on_base and robot.frames[link].on != robot.base for link in found}
            return min(found, key=lambda link: (away[link], "optical" in link.lower()))
    return None


def _start(robot: Description, body: RobotBody) -> dict[str, float]:
    """Of the robot's own file, within the limits of its joints."""
    found = {}
    for name, value in robot.start.items():
        low, high = body.limits(name)
        found[name] = float(np.clip(value, low, high))
    return found


def raised(body: RobotBody, layout: Layout) -> Layout:
    """The layout, where nothing is said of the start and the arm would begin in the floor, with a start above it.

    Of postures at random, always the same, the one nearest to the middle of the joints' limits whose links are all
    `CLEAR` above what the robot stands on.
    """
    if layout.start or not layout.arm or _clearance(body, layout, {}) > 0:
        return layout
    rng, limits = np.random.default_rng(0), {name: body.limits(name) for name in layout.arm}
    spans = {n: (max(low, -np.pi), min(high, np.pi)) for n, (low, high) in limits.items()}
    best: tuple[float, dict[str, float]] | None = None
    for _ in range(POSTURES):
        shares = rng.uniform(-0.8, 0.8, len(spans))
        start = {n: (a + b) / 2 + s * (b - a) / 2 for s, (n, (a, b)) in zip(shares, spans.items(), strict=True)}
        off = float(np.sum(shares**2))
        if (best is None or off < best[0]) and _clearance(body, layout, start) > CLEAR:
            best = off, {name: round(float(value), 3) for name, value in start.items()}
    return layout if best is None else dataclasses.replace(layout, start=best[1])


def _clearance(body: RobotBody, layout: Layout, start: Mapping[str, float]) -> float:
    """m: height of the lowest point of what the arm moves above what the robot stands on."""
    posed = dataclasses.replace(layout, start=start)
    data = body.posed({name: body.start_of(name, posed) for name in (*layout.arm, *layout.gripper)})
    floor = -body.standing(layout)
    lows = []
    for link in body.moved_by(layout.arm[1:] or layout.arm):  # the first joint of most arms only turns them
        points, (pos, turn) = body.shapes.points(link), body.pose(link, data)
        if len(points):
            lows.append(float((pos[2] + points @ turn[2]).min()))
    return min(lows, default=np.inf) - floor


def _link(given: Mapping[str, Any], name: str, found: str | None) -> str | None:
    return (given[name] or None) if name in given else found
