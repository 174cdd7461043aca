"""`Description`: what `robot.json` says of a converted robot next to its MJCF (`ig2mj_converters.convert_robot`)."""

from __future__ import annotations

import pathlib

import msgspec

from ig2mj.errors import InputError
from ig2mj.files.content import read_struct
from ig2mj.files.shell import command

ROBOT_FILE = "robot.json"

FORMAT_VERSION = 1

MAX_EFFORT, MAX_SPEED, MAX_WHEEL_SPEED = 100.0, 1.0, 15.0
"""N m or N, and rad/s or m/s, where the URDF gives none; rad/s of a joint without limits: iGibson's."""


class RobotJoint(msgspec.Struct, frozen=True):
    """A joint that moves. parent, child: links; type: revolute, continuous, prismatic or floating.

    effort: N m or N. velocity: rad/s or m/s; 0 where the file gives none. mimics: the joint that it follows.
    passive: the file has motors, and none for it: it is moved by what it touches or is tied to.
    """

    name: str
    type: str
    parent: str
    child: str
    effort: float = 0.0
    velocity: float = 0.0
    mimics: str | None = None
    passive: bool = False

    @property
    def force(self) -> float:
        """N m or N."""
        return self.effort or MAX_EFFORT

    @property
    def speed(self) -> float:
        """rad/s or m/s."""
        return self.velocity or (MAX_WHEEL_SPEED if self.type == "continuous" else MAX_SPEED)


class FrameEntry(msgspec.Struct, frozen=True):
    """Where a link is. on: the link that moves it. pos: m in that link's frame. axes: rotation matrix."""

    on: str
    pos: tuple[float, float, float]
    axes: tuple[tuple[float, float, float], tuple[float, float, float], tuple[float, float, float]]


class Description(msgspec.Struct, frozen=True):
    """A robot. base: its root link. joints: without fixed ones. frames: of all links, by name; of MJCF also of its
    sites and cameras. start: positions of joints (rad or m) that its file begins with.
    omnidirectional: its file moves the base over the floor in every direction."""

    format_version: int
    name: str
    base: str
    joints: list[RobotJoint]
    frames: dict[str, FrameEntry]
    start: dict[str, float] = {}
    omnidirectional: bool = False

    @classmethod
    def load(cls, folder: pathlib.Path) -> Description:
        """Raises InputError: there is no such file, it is broken, or of another version."""
        file = folder / ROBOT_FILE
        again = f"convert the robot: {command('convert', 'robot', '--urdf', 'FILE', '--out', folder)}"
        made = read_struct(file, cls, fix=again)
        if made.format_version != FORMAT_VERSION:
            raise InputError(file, f"has format version {made.format_version}, not {FORMAT_VERSION}", fix=again)
        return made

    def leader(self, name: str) -> str:
        """The joint that a joint follows, over others that do; itself where it follows none."""
        by_name = {joint.name: joint for joint in self.joints}
        while name in by_name and (above := by_name[name].mimics) is not None:
            name = above
        return name

    def joint(self, name: str) -> RobotJoint:
        """The joint of this name."""
        return next(joint for joint in self.joints if joint.name == name)
