"""`Layout`: which joints of a converted robot drive, reach and grip, and where it looks from.

`ig2mj.agents.urdf.assignment` finds it from the robot's geometry and names. Where that is not right, a TOML (or JSON)
file corrects it: `layout.toml` in the robot's folder, which `ig2mj convert robot` writes, or `--robot-layout FILE`:

    base = "differential"                   # or "skid_steer", "omnidirectional", "fixed" (bolted to the floor)
    wheels = ["left_wheel_joint", "right_wheel_joint"]   # of more than two: all on the left, then all on the right
    arm = ["shoulder_pan", "shoulder_lift", "wrist"]     # joints of all arms, of heads and of lifts
    gripper = ["left_finger_joint", "right_finger_joint"]
    closed = "lower"                        # the limit of the gripper's joints at which it is closed, or "upper"; left
                                            # out: the limit at which its fingers are nearer to each other
    hand = "hand"                           # the link that holds; default: the one that the gripper's joints hang on
    suction = ["suction_cup"]               # links that hold what they touch; their axis that leads away from the arm
                                            # is the one along which they suck
    camera = "camera_link"                  # x forward, z up; z forward, y down where its name has "optical"
    laser = "laser_link"
    mount = 0.7                             # m: height of a pedestal under a fixed base

    [start]                                 # rad or m, at the beginning of an episode; others at 0
    shoulder_lift = 0.4

A robot with several grippers has, in place of `gripper`, `closed` and `hand`, one table for each:

    [[grippers]]
    joints = ["left_finger_joint"]
    hand = "left_hand"
    closed = "upper"

Joints that follow others (`<mimic>`, equalities of MJCF) are not named: they go along. What a file leaves out is found;
`[]` and `""` say that there is none.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping

DIFFERENTIAL, SKID_STEER, OMNIDIRECTIONAL, FIXED = "differential", "skid_steer", "omnidirectional", "fixed"
BASES = (DIFFERENTIAL, SKID_STEER, OMNIDIRECTIONAL, FIXED)
TURNING_WHEELS = (DIFFERENTIAL, SKID_STEER)
"""Bases that drive by the wheels on their left and on their right."""

CLOSED = ("lower", "upper")


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
      base: one of `BASES`. wheels: joints on the left, then as many on the right; of an omnidirectional base all, in
        any order; none where the base is fixed.
      arm: joints in the order of the action. gripper: joints that close, of all grippers.
      closed, reversed: see `Gripper`. hand, camera, laser: links; None: there is none.
      start: positions of joints, rad or m.
      several: the grippers of a robot with more than one, whose first one's hand is `hand`; else empty.
      suction: links that hold what they touch.
      mount: m, height of the pedestal; None: none, but in activities one that brings an arm up to the furniture.
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
    suction: tuple[str, ...] = ()
    mount: float | None = None

    @property
    def grippers(self) -> tuple[Gripper, ...]:
        """All grippers, in the order of the action. One without a hand to hang on is none."""
        if self.several or not self.gripper or self.hand is None:
            return self.several
        return (Gripper(self.gripper, self.hand, self.closed, self.reversed),)

    @property
    def hands(self) -> tuple[str, ...]:
        """Links that hold something, each once: of grippers, then of suction; else the arm's last."""
        own = () if self.hand is None else (self.hand,)
        return tuple(dict.fromkeys((*(gripper.hand for gripper in self.grippers), *self.suction))) or own

    @property
    def drives(self) -> bool:
        """Its base goes somewhere."""
        return self.base != FIXED

    def as_toml(self) -> str:
        """The text of a file that says all of it."""
        lines = [f'base = "{self.base}"' + " " * 4 + f"# one of {', '.join(BASES)}"]
        lines.append(f"wheels = {_list(self.wheels)}")
        lines.append(f"arm = {_list(self.arm)}")
        if not self.several:
            lines.append(f"gripper = {_list(self.gripper)}")
            if self.gripper:
                lines.append(f'closed = "{self.closed}"' if self.closed and not self.reversed else "# closed: found")
            lines.append(f"hand = {_text(self.hand)}")
        lines.append(f"suction = {_list(self.suction)}")
        lines.append(f"camera = {_text(self.camera)}")
        lines.append(f"laser = {_text(self.laser)}")
        lines.append("# mount = 0.7  # m: a pedestal" if self.mount is None else f"mount = {self.mount!r}")
        lines += ["", "[start]  # rad or m; others at 0", *(f"{_key(n)} = {v!r}" for n, v in self.start.items())]
        for one in self.several:
            lines += ["", "[[grippers]]", f"joints = {_list(one.joints)}", f"hand = {_text(one.hand)}"]
            if one.closed and not one.reversed:
                lines.append(f'closed = "{one.closed}"')
        return "\n".join(lines) + "\n"


def _text(value: str | None) -> str:
    escaped = (value or "").replace("\\", "\\\\").replace('"', '\\"')
    return f'"{escaped}"'


def _key(name: str) -> str:
    return _text(name)


def _list(names: tuple[str, ...]) -> str:
    return f"[{', '.join(map(_text, names))}]"
