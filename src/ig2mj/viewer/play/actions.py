"""From what a person wants to the action of the humanoid, of Fetch or of another robot that drives. Pure."""

from __future__ import annotations

import dataclasses
from collections.abc import Collection, Sequence

import numpy as np
from jaxtyping import Float

WALK, TURN = 0.6, 1.2
"""m/s and rad/s of a body."""

REACH, TWIST = 0.4, 1.2
"""m/s and rad/s of a hand."""

LOOK = 1.0
"""rad/s of a head."""

CLOSE = 5.0
"""1/s: how fast a hand closes."""

_AXES = {
    "x": ("hand forward", "hand back"),
    "y": ("hand left", "hand right"),
    "z": ("hand up", "hand down"),
    "roll": ("hand roll right", "hand roll left"),
    "pitch": ("hand pitch down", "hand pitch up"),
    "yaw": ("hand turn left", "hand turn right"),
}
"""Numbers of a hand's pose, in the frame of the robot's base: what makes them larger, and smaller."""


@dataclasses.dataclass
class Wish:
    """What a person wants of a robot.

    Attributes:
      moves: movements that go on (`ig2mj.viewer.play.keys`). hand: the one that is moved. closed: of each hand.
      reset: hands that go back to rest now.
    """

    moves: Collection[str] = ()
    hand: int = 0
    closed: tuple[bool, ...] = (False, False)
    reset: Collection[int] = ()

    def sign(self, more: str, less: str) -> int:
        """1, -1 or 0 for a pair of movements."""
        return (more in self.moves) - (less in self.moves)


def action_of(wish: Wish, names: Sequence[str], high: Float[np.ndarray, "n"], period: float) -> Float[np.ndarray, "n"]:
    """The whole action of a robot, every number as a share of its limit.

    Args:
      names, high: the controller's `action_names` and `action_high`. period: s of an action.
    """
    row = np.zeros(len(names))
    place = {name: k for k, name in enumerate(names)}
    if "body_x" in place:
        _humanoid(row, place, wish, period)
        return np.clip(row / high, -1.0, 1.0)
    for name, more, less in (("forward", "forward", "backward"), ("turn_left", "turn left", "turn right")):
        if name in place:
            row[place[name]] = 0.5 * wish.sign(more, less)
    if "head_tilt" in place:
        row[place["head_tilt"]] = 0.5 * wish.sign("look down", "look up")
    if "eef_x" in place:
        for (more, less), name in zip(_AXES.values(), ("x", "y", "z", "rx", "ry", "rz"), strict=True):
            row[place[f"eef_{name}"]] = wish.sign(more, less)
    if "gripper" in place:
        row[place["gripper"]] = -1.0 if wish.closed[0] else 1.0
    return np.clip(row, -1.0, 1.0)


def _humanoid(row: np.ndarray, place: dict[str, int], wish: Wish, period: float) -> None:
    """In the controller's own units: m and rad of an action."""
    row[place["body_x"]] = WALK * period * wish.sign("forward", "backward")
    row[place["body_yaw"]] = TURN * period * wish.sign("turn left", "turn right")
    row[place["body_z"]] = WALK * period * wish.sign("rise", "sink")
    row[place["eye_pitch"]] = LOOK * period * wish.sign("look down", "look up")
    sides = ("left_hand", "right_hand")
    for axis, (more, less) in _AXES.items():
        speed = REACH if axis in "xyz" else TWIST
        row[place[f"{sides[wish.hand]}_{axis}"]] = speed * period * wish.sign(more, less)
    for number, side in enumerate(sides):
        row[place[f"{side}_trigger"]] = CLOSE * period * (1 if wish.closed[number] else -1)
        row[place[f"{side}_reset"]] = float(number in wish.reset)
