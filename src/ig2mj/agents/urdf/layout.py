"""`Layout`: which joints of a URDF robot drive, reach and grip, and where it looks from.

Found from names and kinds of joints, and where that is not right, written in a TOML (or JSON) file:

    base = "differential"                   # or "fixed": bolted to the floor
    wheels = ["left_wheel_joint", "right_wheel_joint"]   # of more than two: all on the left, then all on the right
    arm = ["shoulder_pan", "shoulder_lift", "wrist"]
    gripper = ["left_finger_joint", "right_finger_joint"]
    closed = "lower"                        # the limit of the gripper's joints at which it is closed, or "upper"; left
                                            # out: of two fingers, the limit at which they are nearer to each other
    hand = "hand"                           # the link that holds; default: the one that the gripper's joints hang on
    camera = "camera_link"                  # x forward, z up
    laser = "laser_link"

    [start]                                 # rad or m, at the beginning of an episode; others at 0
    shoulder_lift = 0.4

A robot with several grippers has, in place of `gripper`, `closed` and `hand`, one table for each:

    [[grippers]]
    joints = ["left_finger_joint"]
    hand = "left_hand"
    closed = "upper"

Joints that follow others (`<mimic>`) are not named: they go along.

What a file leaves out is found; `[]` and `""` say that there is none.
"""

from __future__ import annotations

import dataclasses
import os
import pathlib
import re
import tomllib
from collections.abc import Collection, Mapping, Sequence
from typing import Any

from ig2mj.agents.urdf.description import Description, RobotJoint
from ig2mj.errors import InputError, UnknownNameError
from ig2mj.files.content import decode_json, read_text

MAX_POSITION = 1e6
"""rad or m of a joint's start."""

BASES = ("differential", "fixed")
CLOSED = ("lower", "upper")
LEFT = frozenset(("left", "l", "fl", "rl", "bl", "ml", "lf", "lr", "lb", "lm"))
RIGHT = frozenset(("right", "r", "fr", "rr", "br", "mr", "rf", "rb", "rm"))
"""Words of a wheel's name that say on which side it is, as in `wheel_fl` and `rl_wheel_joint`."""
GRIPS = ("finger", "gripper", "jaw", "thumb")
PASSIVE = ("caster", "castor", "swivel")
CAMERAS = ("camera", "eyes", "cam_", "head_tilt", "head")
LASERS = ("laser", "scan", "lidar")


@dataclasses.dataclass(frozen=True)
class Gripper:
    """Joints that close together, the link that holds, and the limit at which they are closed.

    Attributes:
      closed: one of `CLOSED`; "": not said (`grip.with_closed_limits` finds it).
      reversed: joints that are closed at the other limit.
    """

    joints: tuple[str, ...]
    hand: str
    closed: str = "lower"
    reversed: tuple[str, ...] = ()

    def closes_low(self, joint: str) -> bool:
        """One of its joints is closed at its lower limit."""
        return (self.closed != "upper") != (joint in self.reversed)


@dataclasses.dataclass(frozen=True)
class Layout:
    """See the module's text.

    Attributes:
      base: one of `BASES`. wheels: joints on the left, then as many on the right; none where the base is fixed.
      arm: joints in the order of the action. gripper: joints that close, of all grippers.
      closed, reversed: see `Gripper`. hand, camera, laser: links; None: there is none.
      start: positions of joints, rad or m.
      several: the grippers of a robot with more than one, whose first one's hand is `hand`; else empty.
    """

    base: str
    wheels: tuple[str, ...] = ()
    arm: tuple[str, ...] = ()
    gripper: tuple[str, ...] = ()
    closed: str = "lower"
    hand: str | None = None
    camera: str | None = None
    laser: str | None = None
    start: Mapping[str, float] = dataclasses.field(default_factory=dict)
    several: tuple[Gripper, ...] = ()
    reversed: tuple[str, ...] = ()

    @property
    def grippers(self) -> tuple[Gripper, ...]:
        """All grippers, in the order of the action. One without a hand to hang on is none."""
        if self.several or not self.gripper or self.hand is None:
            return self.several
        return (Gripper(self.gripper, self.hand, self.closed, self.reversed),)

    @property
    def hands(self) -> tuple[str, ...]:
        """Links that hold something, each once."""
        own = () if self.hand is None else (self.hand,)
        return tuple(dict.fromkeys(gripper.hand for gripper in self.grippers)) or own

    @classmethod
    def found(cls, robot: Description, given: Mapping[str, Any] | None = None, where: str = "layout") -> Layout:
        """The layout of a robot.

        Args:
          given: what is not to be found but taken, as in the file. where: what errors name.

        Raises:
          InputError: an entry is of the wrong kind, or the robot cannot be driven so. UnknownNameError: the robot has
            no such joint or link.
        """
        given = dict(given or {})
        _check(robot, given, where)
        joints = [joint for joint in robot.joints if joint.mimics is None]
        wheels = tuple(given["wheels"] if "wheels" in given else _wheels(joints))
        even = len(wheels) > 0 and len(wheels) % 2 == 0
        base = given.get("base", "differential" if even else "fixed")
        if base == "differential" and not even:
            raise InputError(
                where, f"a differential drive has two wheels, or two, three ... on each side, not {len(wheels)}",
                element="wheels",
                fix='name them, left and right: wheels = ["left_wheel_joint", "right_wheel_joint"], or base = "fixed"',
            )  # fmt: skip
        wheels = wheels if base == "differential" else ()
        free = [joint for joint in joints if joint.name not in wheels and not _named(joint.name, PASSIVE)]
        several = _several(robot, free, given, where)
        gripper = [name for one in several for name in one.joints]
        if not several:
            without_hand = given.get("hand") == ""
            gripper = given.get("gripper", [] if without_hand else [j.name for j in free if _grips(j)])
            if gripper and without_hand:
                raise InputError(where, "a gripper has no hand", element="hand", fix="name its link, or gripper = []")
        rolling = {j.name for j in free if j.type == "continuous" and _named(j.name, ("wheel",))}
        arm = given.get("arm", [j.name for j in free if j.name not in gripper and j.name not in rolling])
        both = sorted(set(arm) & set(gripper))
        if both:
            raise InputError(where, f"joint '{both[0]}' is of the arm and of the gripper", element="arm, gripper")
        return cls(
            base=base,
            wheels=wheels,
            arm=tuple(arm),
            gripper=tuple(gripper),
            closed=given.get("closed", "" if gripper and not several else "lower"),
            hand=several[0].hand if several else _link(given, "hand", _hand(robot, arm, gripper)),
            camera=_link(given, "camera", _first(robot, CAMERAS)),
            laser=_link(given, "laser", _first(robot, LASERS)),
            start={joint: float(at) for joint, at in given.get("start", {}).items()},
            several=several,
        )

    @classmethod
    def load(cls, robot: Description, file: str | os.PathLike) -> Layout:
        """From a TOML or a JSON file. Raises as `found`; InputError: it cannot be read."""
        path = pathlib.Path(file)
        text = read_text(path, fix="name a TOML or JSON file")
        if path.suffix.lower() == ".json":
            given = decode_json(text, path, kind=dict)
        else:
            try:
                given = tomllib.loads(text)
            except (ValueError, RecursionError) as e:
                raise InputError(path, f"is not TOML: {e}") from e
        return cls.found(robot, given, str(path))


def _check(robot: Description, given: dict[str, Any], where: str) -> None:
    """Whether entries are known, of the right kind, and name what there is."""
    known = [field.name for field in dataclasses.fields(Layout) if field.name not in ("several", "reversed")] + [
        "grippers"
    ]
    for name, value in given.items():
        if name not in known:
            raise UnknownNameError(f"entry of {where}", name, known)
        if name == "grippers":
            _check_grippers(robot, given, where)
        elif name in ("wheels", "arm", "gripper"):
            if not isinstance(value, list | tuple) or not all(isinstance(entry, str) for entry in value):
                raise InputError(where, "must be a list of names of joints", element=name)
            _check_names("joint of the robot", value, [joint.name for joint in robot.joints])
        elif name == "start":
            if not isinstance(value, Mapping) or not all(_is_number(v) for v in value.values()):
                raise InputError(where, "must be a table of numbers by joint", element=name)
            _check_names("joint of the robot", list(value), [joint.name for joint in robot.joints])
        elif not isinstance(value, str):
            raise InputError(where, "must be a text", element=name)
        elif name in ("hand", "camera", "laser") and value:
            _check_names("link of the robot", [value], list(robot.frames))
        elif name in ("base", "closed") and value not in (choices := BASES if name == "base" else CLOSED):
            raise InputError(where, f"is '{value}'", element=name, fix=f"use {' or '.join(choices)}")


def _check_grippers(robot: Description, given: Mapping[str, Any], where: str) -> None:
    also = sorted({"gripper", "hand", "closed"} & set(given))
    if also:
        raise InputError(where, f"has both 'grippers' and '{also[0]}'", element="grippers", fix="keep one of them")
    if not isinstance(given["grippers"], list | tuple) or not all(isinstance(g, Mapping) for g in given["grippers"]):
        raise InputError(where, "must be a list of tables with joints and a hand", element="grippers")
    for one in given["grippers"]:
        for name in ("joints", "hand"):
            if name not in one:
                raise InputError(where, f"a gripper has no '{name}'", element="grippers")
        for name in one:
            if name not in ("joints", "hand", "closed"):
                raise UnknownNameError(f"entry of grippers of {where}", name, ["joints", "hand", "closed"])
        entries = {"gripper": one["joints"]} | {name: one[name] for name in ("hand", "closed") if name in one}
        _check(robot, entries, where)
        if not one["joints"] or not one["hand"]:
            raise InputError(where, "a gripper has joints and a hand", element="grippers")


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= MAX_POSITION


def _check_names(kind: str, names: Sequence[str], known: Sequence[str]) -> None:
    for name in names:
        if name not in known:
            raise UnknownNameError(kind, name, known)


def _named(name: str, parts: Sequence[str]) -> bool:
    return any(part in name.lower() for part in parts)


def _words(name: str) -> set[str]:
    """The words of a name: "wheelFL_joint" has wheel, fl and joint."""
    return {word.lower() for word in re.findall(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])", name)}


def _grips(joint: RobotJoint) -> bool:
    """It opens and closes a gripper, and does not turn without end."""
    return joint.type != "continuous" and (_named(joint.name, GRIPS) or _named(joint.child, GRIPS))


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
    chosen, taken = [j for j in free if _grips(j)], set(given.get("arm", ()))
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
    while link in above and (above[link].name in gripper or robot.leader(above[link].name) in gripper):
        link = above[link].parent
    return link


def _wheels(joints: Sequence[RobotJoint]) -> list[str]:
    """The driven wheels on the left, then those on the right, where there are as many."""
    rolling = [j.name for j in joints if j.type == "continuous" and "wheel" in j.name.lower()]
    rolling = [name for name in rolling if not _named(name, PASSIVE)]
    left, right = ([name for name in rolling if side & _words(name)] for side in (LEFT, RIGHT))
    apart = len(left) == len(right) and not set(left) & set(right)
    return [*left, *right] if apart else []


def _hand(robot: Description, arm: Sequence[str], gripper: Sequence[str]) -> str | None:
    """The link that the gripper hangs on, else the last one of the arm."""
    if gripper:
        return hand_of(robot, gripper[0], set(gripper))
    return robot.joint(arm[-1]).child if arm else None


def _first(robot: Description, names: Sequence[str]) -> str | None:
    """The first link of the likeliest name."""
    return next((link for part in names for link in robot.frames if part in link.lower()), None)


def _link(given: Mapping[str, Any], name: str, found: str | None) -> str | None:
    return (given[name] or None) if name in given else found
