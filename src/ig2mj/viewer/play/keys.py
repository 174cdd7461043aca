"""Keys of `ig2mj play` and what they stand for: pure data, and `Held`, which keys act now.

MuJoCo's viewer tells of keys that go down, not of those that come up. So a movement goes on for `HOLD` seconds after
its key was last heard, and while a key is held down for as long as the keyboard repeats it.

There are two sets: the arrows with the numeric keypad, and letters for keyboards without one. MuJoCo's viewer has
those letters for marks of its own, which the session switches off again.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Collection

HOLD = 0.25
"""Seconds."""

_ARROWS = {"right": 262, "left": 263, "down": 264, "up": 265}
_PAGE_UP, _PAGE_DOWN, _HOME, _END = 266, 267, 268, 269
_PAD = {**{str(n): 320 + n for n in range(10)}, ".": 330, "/": 331, "*": 332, "-": 333, "+": 334}


@dataclasses.dataclass(frozen=True)
class Binding:
    """What a key does.

    Attributes:
      command: its name. keys: codes of GLFW. shown: how they are written. moves: it goes on while held; else it is
        done once.
    """

    command: str
    keys: tuple[int, ...]
    shown: str
    moves: bool = True


def _pad(command: str, pad: str, letter: str, moves: bool = True) -> Binding:
    return Binding(command, (_PAD[pad], ord(letter)), f"pad {pad}, {letter}", moves)


BINDINGS: tuple[Binding, ...] = (
    Binding("forward", (_ARROWS["up"],), "up"),
    Binding("backward", (_ARROWS["down"],), "down"),
    Binding("turn left", (_ARROWS["left"],), "left"),
    Binding("turn right", (_ARROWS["right"],), "right"),
    Binding("look up", (_PAGE_UP,), "page up"),
    Binding("look down", (_PAGE_DOWN,), "page down"),
    Binding("rise", (_HOME,), "home"),
    Binding("sink", (_END,), "end"),
    _pad("hand forward", "8", "T"),
    _pad("hand back", "2", "V"),
    _pad("hand left", "4", "F"),
    _pad("hand right", "6", "H"),
    _pad("hand up", "9", "Y"),
    _pad("hand down", "3", "N"),
    _pad("hand roll left", "7", "A"),
    _pad("hand roll right", "1", "D"),
    _pad("hand pitch up", "-", "U"),
    _pad("hand pitch down", "+", "J"),
    _pad("hand turn left", "/", "Q"),
    _pad("hand turn right", "*", "E"),
    _pad("close or open", "5", "B", moves=False),
    _pad("other hand", "0", "X", moves=False),
    _pad("hand back to rest", ".", "Z", moves=False),
    Binding("see with the robot's eye", (ord("I"),), "I", moves=False),
)

BY_KEY: dict[int, Binding] = {key: binding for binding in BINDINGS for key in binding.keys}


_NEEDS = {
    "forward": ("body_x", "forward"),
    "turn": ("body_yaw", "turn_left"),
    "rise": ("body_z",),
    "look up": ("eye_pitch", "head_tilt"),
    "hand": ("eef_x", "right_hand_x"),
    "close or open": ("gripper", "right_hand_trigger"),
    "other hand": ("left_hand_x",),
}
"""Numbers of an action without which a key does nothing, by the beginning of its command."""


def key_rows(names: Collection[str]) -> list[tuple[str, str]]:
    """Keys and what they do for a robot, for the window: what moves one way and the other shares a row.

    Args:
      names: the controller's `action_names`.
    """
    rows: list[tuple[str, str]] = []
    waiting: Binding | None = None
    for binding in BINDINGS:
        if not binding.moves:
            if _usable(binding.command, names):
                rows.append((binding.shown, binding.command))
        elif waiting is None:
            waiting = binding
        else:
            if _usable(waiting.command, names):
                rows.append((_together(waiting.shown, binding.shown), _together(waiting.command, binding.command)))
            waiting = None
    return rows


def _usable(command: str, names: Collection[str]) -> bool:
    return next(
        (any(n in names for n in needed) for start, needed in _NEEDS.items() if command.startswith(start)), True
    )


def _together(first: str, second: str) -> str:
    """Two texts in one; words that both begin with are written once."""
    if ", " in first:  # keys of both sets
        pairs = zip(first.split(", "), second.split(", "), strict=True)
        return ", ".join(_together(one, other).replace(", ", " ") for one, other in pairs)
    ours, theirs, same = first.split(), second.split(), 0
    while same < min(len(ours), len(theirs)) - 1 and ours[same] == theirs[same]:
        same += 1
    return f"{first}, {' '.join(theirs[same:])}"


class Held:
    """Movements whose keys are down, as far as that can be determined.

    Attributes:
      until: when each movement ends, s, by command.
    """

    def __init__(self) -> None:
        self.until: dict[str, float] = {}

    def press(self, key: int, now: float) -> str | None:
        """Takes a key that went down (or was repeated); the command, where it is to be done once.

        Args:
          now: s.
        """
        binding = BY_KEY.get(key)
        if binding is None:
            return None
        if not binding.moves:
            return binding.command
        self.until[binding.command] = now + HOLD
        return None

    def moves(self, now: float) -> frozenset[str]:
        """Movements that go on at a time."""
        return frozenset(command for command, end in self.until.items() if now < end)
